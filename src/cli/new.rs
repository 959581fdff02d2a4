//! `flexura new`: a design to begin with.

use super::artefacts::write_atomic;
use super::commands::{FAILED, print};
use super::doc::nearest;
use super::render;
use clap::Args;
use flexura::diagnostic::{Diagnostic, Severity, SourceMap};
use flexura::elaborate::{std_modules, std_text};
use flexura::pipeline::placeless;
use std::path::Path;

#[derive(Debug, Args)]
pub struct New {
    /// Name of the design: a folder of this name is made, with NAME.mech in it
    name: String,
    /// What to begin with: hinge, four_bar, chebyshev, jansen and klann have flexures; every other mechanism of the
    /// library (`flexura doc mechanisms`) has ordinary joints
    #[arg(long, value_name = "START", default_value = "hinge")]
    from: String,
}

/// A design to begin with.
struct Start {
    name: &'static str,
    text: &'static str,
}

/// Those with flexures. All other mechanisms of the library are there with ordinary joints.
const COMPLIANT: &[Start] = &[
    Start { name: "hinge", text: include_str!("../../starts/hinge.mech") },
    Start { name: "four_bar", text: include_str!("../../starts/four_bar.mech") },
    Start { name: "chebyshev", text: include_str!("../../examples/chebyshev/chebyshev.mech") },
    Start { name: "jansen", text: include_str!("../../examples/jansen/jansen.mech") },
    Start { name: "klann", text: include_str!("../../examples/klann/klann.mech") },
];

/// What is made is not kept in version control; the lock beside the source is.
const IGNORED: &str = "out/\n";

/// Runs it.
pub fn run(arguments: &New) -> u8 {
    match make(arguments) {
        Ok(text) => print(&text),
        Err(diagnostic) => {
            render::show(&[*diagnostic], &SourceMap::default());
            FAILED
        }
    }
}

/// Names of all starts, those with flexures first.
fn starts() -> Vec<String> {
    let compliant = COMPLIANT.iter().map(|s| s.name.to_string());
    let others = std_modules()
        .into_iter()
        .filter_map(|m| m.strip_prefix("mechanisms.").map(String::from))
        .filter(|m| COMPLIANT.iter().all(|s| s.name != m));
    compliant.chain(others).collect()
}

fn text_of(start: &str) -> Option<&'static str> {
    let compliant = COMPLIANT.iter().find(|s| s.name == start).map(|s| s.text);
    compliant.or_else(|| std_text(&format!("mechanisms.{start}")))
}

fn make(arguments: &New) -> Result<String, Box<Diagnostic>> {
    let failed = |code, message: String| Box::new(placeless(Severity::Error, code, message));
    let New { name, from } = arguments;
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    if !plain || !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        let mut d = *failed("E0763", format!("`{name}` is no name for a design"));
        d = d.help("use letters, digits, `_` and `-`, and begin with a letter");
        return Err(Box::new(d));
    }
    let Some(text) = text_of(from) else {
        let d = *failed("E0761", format!("there is no start `{from}`"));
        let all = starts();
        return Err(Box::new(match nearest(from, all.iter().cloned()) {
            Some(near) => d.help(format!("did you mean `--from {near}`? There are {}", all.join(", "))),
            None => d.help(format!("there are {}", all.join(", "))),
        }));
    };
    let folder = Path::new(name);
    // Also a link that leads nowhere is in the way.
    if folder.symlink_metadata().is_ok() {
        let d = *failed("E0762", format!("`{name}` is there already"));
        return Err(Box::new(d.help("nothing is overwritten: choose another name, or move it away")));
    }
    let file = folder.join(format!("{name}.mech"));
    let text = renamed(text, &name.replace('-', "_"));
    for (path, bytes) in [(file.clone(), text.as_str()), (folder.join(".gitignore"), IGNORED)] {
        write_atomic(&path, bytes.as_bytes()).map_err(|e| failed("E0731", e.to_string()))?;
    }
    let shown = file.display();
    Ok(format!("{shown}\n\nflexura check {shown}\nflexura build {shown}\n"))
}

/// The text with its mechanism called `name`.
fn renamed(text: &str, name: &str) -> String {
    let rename = |line: &str| match line.strip_prefix("mechanism ").and_then(|rest| rest.split_once(' ')) {
        Some((_, rest)) => format!("mechanism {name} {rest}\n"),
        None => format!("{line}\n"),
    };
    text.lines().map(rename).collect()
}
