//! Findings as SARIF on the standard output.

use super::Format;
use clap::CommandFactory;
use flexura::diagnostic::{Diagnostic, SourceMap, sarif};

/// The manual, for its table of codes: the tests see to it that every code is there.
const MANUAL: &str = include_str!("../../docs/language.md");

/// Prints the log of one run.
pub fn print(found: &[Diagnostic], sources: &SourceMap) -> u8 {
    let tool = sarif::Tool { version: env!("CARGO_PKG_VERSION"), summary: &summary };
    super::commands::print(&format!("{:#}\n", sarif::log(found, sources, &tool)))
}

/// What a code stands for.
fn summary(code: &str) -> Option<String> {
    let line = MANUAL.lines().find_map(|l| l.strip_prefix("| ")?.strip_prefix(code)?.strip_prefix(" | "))?;
    Some(line.trim_end().trim_end_matches('|').trim_end().to_string())
}

/// Ends the program where the output is not a list of findings.
pub fn refuse(format: Format) {
    if format == Format::Sarif {
        let message = "`--format sarif` is for the findings of `check` and `build`";
        super::Cli::command().error(clap::error::ErrorKind::InvalidValue, message).exit();
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn codes_have_the_manuals_words() {
        assert_eq!(super::summary("E0101").as_deref(), Some("a name that is declared nowhere in reach"));
        assert_eq!(super::summary("E9999"), None);
    }
}
