//! `flexura explain`.

use super::commands::{FAILED, print};
use super::{Format, render, style::Style};
use clap::Args;
use flexura::diagnostic::{Diagnostic, Severity, SourceMap};
use flexura::lint::explain;
use flexura::pipeline::placeless;
use serde_json::json;

/// Arguments of `explain`.
#[derive(Debug, Args)]
pub struct Explain {
    /// A code, such as W1107, or a rule's name, such as better-rest
    #[arg(required_unless_present = "list")]
    code: Option<String>,
    /// Every code with its one-line summary
    #[arg(long, conflicts_with = "code")]
    list: bool,
    /// How to tell it
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
}

/// Runs `explain`.
pub fn explain(arguments: &Explain) -> u8 {
    super::sarif::refuse(arguments.format);
    let Some(word) = &arguments.code else {
        return match arguments.format {
            Format::Human => print(&explain::list()),
            Format::Json | Format::Sarif => print(&format!("{}\n", json!({ "codes": explain::all() }))),
        };
    };
    // Codes may be typed in small letters; names of rules are.
    let upper = word.to_ascii_uppercase();
    let found = explain::one(word).or_else(|| explain::one(&upper));
    match (found, arguments.format) {
        (Some(one), Format::Human) => {
            print(&shown(one.page.as_deref().unwrap_or(""), Style::stdout().is_coloured()))
        }
        (Some(one), Format::Json | Format::Sarif) => print(&format!("{}\n", json!(one))),
        (None, _) => {
            render::report(&[unknown(word)], &SourceMap::default(), arguments.format);
            FAILED
        }
    }
}

/// A code or name that is none.
fn unknown(word: &str) -> Diagnostic {
    let near: Vec<String> = explain::nearest(word).into_iter().map(|n| format!("`{n}`")).collect();
    placeless(Severity::Error, "E0764", format!("there is no code or rule `{word}`")).help(
        match near.as_slice() {
            [] => "`flexura explain --list` shows all".into(),
            near => format!("did you mean {}? `flexura explain --list` shows all", near.join(" or ")),
        },
    )
}

/// A page for the terminal: headings bold, samples indented, fences left out.
fn shown(page: &str, coloured: bool) -> String {
    let mut out = String::new();
    let mut sample = false;
    for line in page.lines() {
        if line.starts_with("```") {
            sample = !sample;
            continue;
        }
        let heading = line.trim_start_matches('#');
        match (sample, heading.len() < line.len()) {
            (true, _) => out.push_str(&format!("    {line}")),
            (false, true) if coloured => out.push_str(&format!("\u{1b}[1m{}\u{1b}[0m", heading.trim_start())),
            (false, true) => out.push_str(heading.trim_start()),
            (false, false) => out.push_str(line),
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn pages_are_plain_where_there_is_no_colour() {
        let page = "# W1 a\n\n## Why\n\nBecause.\n\n```text\nlet x = 1\n```\n";
        assert_eq!(shown(page, false), "W1 a\n\nWhy\n\nBecause.\n\n    let x = 1\n");
        assert!(shown(page, true).contains("\u{1b}[1mWhy\u{1b}[0m"));
    }
}
