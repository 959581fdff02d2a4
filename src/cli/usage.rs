//! Wrong usage, told as every other finding is: code, reason, next action.

use super::{manners::Colour, render};
use clap::error::ErrorKind;
use flexura::diagnostic::{Severity, SourceMap};
use flexura::pipeline::placeless;
use std::process::ExitCode;

/// Exit code: the command line itself is wrong.
const WRONG: u8 = 2;

/// Help, version, or what is wrong with the command line.
pub fn answer(error: &clap::Error) -> ExitCode {
    if matches!(
        error.kind(),
        ErrorKind::DisplayHelp
            | ErrorKind::DisplayVersion
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    ) {
        let _ = error.print();
        return ExitCode::from(if error.use_stderr() { WRONG } else { 0 });
    }
    // The colour asked for may stand before what is wrong.
    if std::env::args().any(|a| a == "--color=never") {
        super::manners::Manners { color: Colour::Never, ..Default::default() }.choose();
    }
    let text = error.render().to_string();
    let (message, help) = parts(&text);
    render::show(&[placeless(Severity::Error, "E0752", message).help(help)], &SourceMap::default());
    ExitCode::from(WRONG)
}

/// What is wrong on one line, and what to do: tips and usage.
fn parts(text: &str) -> (String, String) {
    let mut message = Vec::new();
    let mut help = Vec::new();
    for paragraph in text.split("\n\n").map(str::trim).filter(|p| !p.is_empty()) {
        let line = paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
        match line.strip_prefix("error: ") {
            Some(line) => message.push(line.to_string()),
            None if line.starts_with("For more information") => help.push("`--help` tells more".into()),
            None => help.push(line.trim_start_matches("tip: ").to_string()),
        }
    }
    (message.join(" "), help.join("; "))
}

#[cfg(test)]
mod tests {
    #[test]
    fn reason_and_next_action_are_told_apart() {
        let text = "error: unexpected argument '--outt' found\n\n  tip: a similar argument exists: '--out'\n\n\
                    Usage: flexura build <SOURCE>\n\nFor more information, try '--help'.\n";
        let (message, help) = super::parts(text);
        assert_eq!(message, "unexpected argument '--outt' found");
        assert_eq!(
            help,
            "a similar argument exists: '--out'; Usage: flexura build <SOURCE>; `--help` tells more"
        );
    }
}
