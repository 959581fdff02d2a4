//! `flexura fmt`: one look for all files.

use super::artefacts::write_atomic;
use super::commands::{FAILED, FINE, print};
use super::manners::Manners;
use super::render;
use super::sources::{MOST_BYTES, read_text};
use clap::Args;
use flexura::diagnostic::{Diagnostic, Origin, Severity, SourceMap};
use flexura::pipeline::placeless;
use flexura::syntax::format::format;
use std::io::Read;
use std::path::{Path, PathBuf};

/// What `flexura fmt` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  flexura fmt                      every .mech file below this folder
  flexura fmt leg.mech parts/      one file, and all in a folder
  flexura fmt --check              for CI: shows what would change, exit code 1
  flexura fmt - <leg.mech          from the standard input to the standard output")]
pub struct Fmt {
    /// Files, folders (all `.mech` files below them), or `-` for the standard input
    #[arg(default_value = ".")]
    paths: Vec<PathBuf>,
    /// Write nothing: show what would change and exit with 1 if anything would
    #[arg(long)]
    check: bool,
}

/// Deepest folder that is looked into: links could lead in circles, and these are not followed either.
const DEEPEST: usize = 32;

/// `flexura fmt`.
pub fn fmt(arguments: &Fmt) -> u8 {
    let mut run = Run { check: arguments.check, ..Run::default() };
    for path in &arguments.paths {
        if path.as_os_str() == "-" {
            run.standard_input();
        } else if path.is_dir() {
            run.folder(path, 0);
        } else {
            run.file(path);
        }
    }
    render::show(&run.found, &run.sources);
    if arguments.check && run.changed > 0 && !Manners::chosen().quiet {
        let files = if run.changed == 1 { "file is" } else { "files are" };
        render::tell(&format!("{} {files} not formatted; `flexura fmt` does it\n", run.changed));
    }
    match run.found.iter().any(Diagnostic::is_error) || arguments.check && run.changed > 0 || run.failed {
        true => FAILED,
        false => FINE,
    }
}

#[derive(Default)]
struct Run {
    check: bool,
    /// Files that are, or would be, written anew.
    changed: usize,
    /// The standard output went away.
    failed: bool,
    found: Vec<Diagnostic>,
    sources: SourceMap,
}

impl Run {
    fn fault(&mut self, code: &str, message: String) {
        self.found.push(placeless(Severity::Error, code, message));
    }

    fn folder(&mut self, folder: &Path, depth: usize) {
        let entries = match std::fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(e) => return self.fault("E0730", format!("cannot read `{}`: {e}", folder.display())),
        };
        let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
        paths.sort();
        for path in paths {
            let hidden = path.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with('.'));
            let Ok(kind) = path.symlink_metadata() else { continue };
            if kind.is_dir() && !hidden && depth < DEEPEST {
                self.folder(&path, depth + 1);
            } else if kind.is_file() && path.extension().is_some_and(|e| e == "mech") {
                self.file(&path);
            }
        }
    }

    fn file(&mut self, path: &Path) {
        let old = match read_text(path) {
            Ok(old) => old,
            Err(why) => return self.fault("E0730", format!("cannot read `{}`: {why}", path.display())),
        };
        let name = path.display().to_string();
        let Some(new) = self.formatted(&name, &old) else { return };
        if new == old {
            return;
        }
        self.changed += 1;
        if self.check {
            self.failed |= print(&difference(&name, &old, &new)) != FINE;
            return;
        }
        // A link stays one: what it leads to is written.
        let target = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        if let Err(e) = write_atomic(&target, new.as_bytes()) {
            self.fault("E0731", e.to_string());
        }
    }

    fn standard_input(&mut self) {
        let mut bytes = Vec::new();
        let read = std::io::stdin().lock().take(MOST_BYTES + 1).read_to_end(&mut bytes);
        let old = match (read, String::from_utf8(bytes)) {
            (Ok(n), Ok(text)) if n as u64 <= MOST_BYTES => text,
            (Ok(_), Ok(_)) => return self.fault("E0730", "the standard input is too large".into()),
            (Ok(_), Err(_)) => return self.fault("E0730", "the standard input is not UTF-8 text".into()),
            (Err(e), _) => return self.fault("E0730", format!("cannot read the standard input: {e}")),
        };
        let new = self.formatted("standard input", &old);
        self.changed += usize::from(new.as_ref().is_some_and(|new| *new != old));
        // What cannot be formatted goes through as it is: an editor's buffer is replaced by what comes out.
        let new = new.unwrap_or_else(|| old.clone());
        let out = if self.check { difference("standard input", &old, &new) } else { new };
        self.failed |= print(&out) != FINE;
    }

    /// The new text; none where the old one is to stay.
    fn formatted(&mut self, name: &str, old: &str) -> Option<String> {
        let file = self.sources.add(name, old);
        match format(file, old) {
            Ok(new) => {
                if new.left > 0 {
                    let parts = if new.left == 1 { "1 part" } else { &format!("{} parts", new.left) };
                    let start = new.first_left.unwrap_or(0);
                    let at = Origin { file, start, end: start };
                    let text = format!("`{name}`: {parts} with errors left as written");
                    let help = "`flexura check` tells what is wrong";
                    self.found.push(Diagnostic::warning("W0751", text, at).help(help));
                }
                Some(new.text)
            }
            Err(why) => {
                self.found.push(*why);
                None
            }
        }
    }
}

/// What would change, as a unified diff.
fn difference(name: &str, old: &str, new: &str) -> String {
    similar::TextDiff::from_lines(old, new)
        .unified_diff()
        .context_radius(2)
        .header(name, &format!("{name} (formatted)"))
        .to_string()
}
