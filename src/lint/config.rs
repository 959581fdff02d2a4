//! `flexura.toml`: levels for all designs below its folder.
//!
//! ```toml
//! [lints]
//! warnings = "deny"
//! W1031 = "allow"
//! ```

use super::levels::{Level, Selector};
use crate::diagnostic::{Diagnostic, Origin};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;
use toml::Spanned;

/// Name of the file.
pub const NAME: &str = "flexura.toml";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    #[serde(default)]
    lints: BTreeMap<Spanned<String>, Spanned<String>>,
    /// Read by the command.
    #[serde(default, rename = "build")]
    _build: toml::Table,
}

/// The levels in a configuration's text; `file` is its index in the source map.
///
/// # Errors
/// E0740 where the text is no such configuration, E0741 for codes and levels that do not exist.
pub fn parse(text: &str, file: u32) -> Result<Vec<(Selector, Level)>, Vec<Diagnostic>> {
    let at = |span: Range<usize>| Origin { file, start: span.start as u32, end: span.end as u32 };
    let config: Config = toml::from_str(text).map_err(|e| {
        let place = at(e.span().unwrap_or(0..0));
        let message = format!("this configuration cannot be read: {}", e.message());
        vec![
            Diagnostic::error("E0740", message, place)
                .help("it holds a table `[lints]` with lines like `W1031 = \"allow\"`"),
        ]
    })?;
    let (mut levels, mut found) = (Vec::new(), Vec::new());
    for (code, level) in &config.lints {
        let selector: Result<Selector, String> = code.get_ref().parse();
        match (selector, Level::named(level.get_ref())) {
            (Ok(selector), Some(level)) => levels.push((selector, level)),
            (Err(why), _) => {
                found.push(
                    Diagnostic::error("E0741", why, at(code.span()))
                        .help("write a code, `warnings` or `all`"),
                );
            }
            (_, None) => {
                let message = format!("there is no level `{}`", level.get_ref());
                let d = Diagnostic::error("E0741", message, at(level.span()));
                found.push(d.help("levels are \"allow\", \"warn\" and \"deny\""));
            }
        }
    }
    if found.is_empty() { Ok(levels) } else { Err(found) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_read_and_mistakes_have_places() {
        let levels = parse("[lints]\nW1001 = \"deny\"\nall = \"warn\"\n", 3).unwrap();
        assert!(levels.contains(&(Selector::Code("W1001".into()), Level::Deny)));
        assert!(levels.contains(&(Selector::All, Level::Warn)));
        assert_eq!(parse("", 0), Ok(Vec::new()));
        for (text, code, place) in [
            ("[lints]\nW1001 = deny\n", "E0740", "deny"),
            ("[lint]\n", "E0740", "lint"),
            ("[lints]\nW1999 = \"deny\"\n", "E0741", "W1999"),
            ("[lints]\nE0101 = \"allow\"\n", "E0741", "E0101"),
            ("[lints]\nW1001 = \"off\"\n", "E0741", "\"off\""),
        ] {
            let found = parse(text, 3).unwrap_err();
            let at = found[0].labels[0].at;
            assert_eq!((found[0].code.as_str(), at.file), (code, 3), "{text}");
            assert!(text[at.start as usize..at.end as usize].contains(place), "{text}: {at:?}");
        }
    }
}
