//! Annotated source files: a `.mech` file that says itself which diagnostics it must give.
//!
//! A comment line `//~ E0012 some text` (or `//~ W0103 …`) expects a diagnostic with that code whose
//! primary label starts on the nearest line above that is no such comment. The text, if any, must
//! occur in the message, a label or the help. Several comments below each other expect several
//! diagnostics on the same line. A file fails for every expected diagnostic that is missing and
//! for every diagnostic that no comment expects.

use flexura::diagnostic::Diagnostic;
use std::path::Path;

/// What one annotation asks for.
#[derive(Clone, Debug, PartialEq)]
struct Expected {
    line: usize,
    code: String,
    text: String,
}

/// Compares the diagnostics of `source` (whose index in the source map is `file`) with its
/// annotations. The error lists every difference, one a line.
pub fn compare(source: &str, file: u32, found: &[Diagnostic]) -> Result<(), String> {
    let mut open = annotations(source)?;
    let mut differences = Vec::new();
    for diagnostic in found {
        let Some(label) = diagnostic.labels.first() else {
            differences.push(format!("no place: {} {}", diagnostic.code, diagnostic.message));
            continue;
        };
        let line = line_of(source, label.at.start as usize);
        let fits = |e: &Expected| label.at.file == file && e.line == line && matches(e, diagnostic);
        match open.iter().position(fits) {
            Some(at) => drop(open.remove(at)),
            None => {
                let help = diagnostic.help.as_deref().unwrap_or("");
                differences.push(format!(
                    "unexpected on line {line}: {} {} [{help}]",
                    diagnostic.code, diagnostic.message
                ));
            }
        }
    }
    differences.extend(open.iter().map(|e| format!("missing on line {}: {} {}", e.line, e.code, e.text)));
    if differences.is_empty() { Ok(()) } else { Err(differences.join("\n")) }
}

/// Runs [`compare`] on every `.mech` file of a folder, with the diagnostics that `diagnose` gives
/// for its name and text in a source map where it has index 0.
///
/// # Panics
/// If a file differs from its annotations, has none, or the folder holds no file.
pub fn check_folder(folder: &Path, diagnose: impl Fn(&Path, &str) -> Vec<Diagnostic>) {
    let mut paths: Vec<_> = std::fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "mech"))
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "no test files in {}", folder.display());
    let mut failures = Vec::new();
    for path in paths {
        let source = std::fs::read_to_string(&path).unwrap();
        let result = match annotations(&source) {
            Ok(list) if list.is_empty() => Err("no annotation: it tests nothing".to_owned()),
            _ => compare(&source, 0, &diagnose(&path, &source)),
        };
        if let Err(differences) = result {
            failures.push(format!("{}:\n{differences}", path.display()));
        }
    }
    assert!(failures.is_empty(), "\n{}", failures.join("\n\n"));
}

fn matches(expected: &Expected, diagnostic: &Diagnostic) -> bool {
    let mut texts = vec![diagnostic.message.as_str()];
    texts.extend(diagnostic.labels.iter().map(|l| l.text.as_str()));
    texts.extend(diagnostic.help.as_deref());
    diagnostic.code == expected.code && texts.iter().any(|t| t.contains(&expected.text))
}

fn annotations(source: &str) -> Result<Vec<Expected>, String> {
    let mut list = Vec::new();
    let mut line = 0;
    for (number, text) in source.split('\n').enumerate() {
        let Some(annotation) = text.trim().strip_prefix("//~") else {
            line = number + 1;
            continue;
        };
        let (code, text) = annotation.trim().split_once(' ').unwrap_or((annotation.trim(), ""));
        if line == 0 || code.is_empty() {
            return Err(format!("line {}: an annotation without a line above or a code", number + 1));
        }
        list.push(Expected { line, code: code.into(), text: text.trim().into() });
    }
    Ok(list)
}

fn line_of(source: &str, byte: usize) -> usize {
    source.as_bytes().iter().take(byte).filter(|b| **b == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use super::compare;
    use flexura::diagnostic::{Diagnostic, Origin};

    const SOURCE: &str = "one\n//~ E0001 odd\ntwo\n";

    fn error(code: &str, start: u32) -> Diagnostic {
        Diagnostic::error(code, "something odd", Origin { file: 0, start, end: start })
    }

    #[test]
    fn expected_diagnostics_pass() {
        assert_eq!(compare(SOURCE, 0, &[error("E0001", 1)]), Ok(()));
    }

    #[test]
    fn missing_unexpected_and_misplaced_diagnostics_fail() {
        assert!(compare(SOURCE, 0, &[]).unwrap_err().starts_with("missing on line 1"));
        let twice = compare(SOURCE, 0, &[error("E0001", 1), error("E0001", 1)]).unwrap_err();
        assert!(twice.starts_with("unexpected on line 1") && !twice.contains("missing"));
        let misplaced = compare(SOURCE, 0, &[error("E0001", 19)]).unwrap_err();
        assert!(misplaced.contains("unexpected on line 3") && misplaced.contains("missing on line 1"));
        assert!(compare(SOURCE, 0, &[error("E0002", 1)]).is_err());
        assert!(compare(SOURCE, 1, &[error("E0001", 1)]).is_err(), "a diagnostic of another file");
        assert!(compare("a\n//~ E0001 even\n", 0, &[error("E0001", 0)]).is_err(), "another text");
    }
}
