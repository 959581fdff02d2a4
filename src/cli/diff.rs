//! `flexura diff`: two versions of a design, from the disk or from git, also as git's own diff program.

use super::Format;
use super::commands::{FAILED, FINE, print};
use super::git::Revision;
use super::render;
use super::sources::{Folder, read_text};
use super::style::Style;
use clap::Args;
use flexura::diagnostic::Severity;
use flexura::diff::{Diff as Changes, NameChange, Number, Row, Simulated, compare};
use flexura::pipeline::{
    Compiler, Examined, Extent, FileError, Files, Request, SolidFile, Values, examine, placeless,
};
use std::fmt::Write;
use std::path::Path;
use std::process::Command;
use std::sync::Arc;

/// Numbers of a kind that a person is shown; `--format json` has all.
const MOST_OF_A_KIND: usize = 8;
/// From this change on, in percent, the factor says more.
const MOST_PERCENT: f64 = 1000.0;

/// Arguments of `flexura diff`.
///
/// A and B are files or `REVISION:PATH` as in `git show`; `flexura diff REVISION FILE` compares a file with what it was,
/// `flexura diff FILE` with the newest commit. Each version is simulated with the values of its own lock where this belongs
/// to it, else with its own start; so is each of its variants that both have. As a program for `git diff` it takes the arguments git gives
/// (docs/version-control.md).
#[derive(Debug, Args)]
pub struct Diff {
    /// The old version and the new one
    #[arg(required = true, num_args = 1..=9, value_names = ["A", "B"])]
    versions: Vec<String>,
    /// Number of threads [default: one a core]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// How to report
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
}

/// One version of a design.
struct Version {
    /// As it is told.
    name: String,
    /// Its file's name.
    source: String,
    /// Its files; none where this version does not exist.
    files: Option<Box<dyn Files + Send + Sync>>,
}

/// A folder in which one file reads otherwise.
struct Instead {
    name: String,
    text: String,
    others: Option<Box<dyn Files + Send + Sync>>,
}

impl Files for Instead {
    fn read(&self, path: &str) -> Result<String, FileError> {
        match &self.others {
            _ if path == self.name => Ok(self.text.clone()),
            Some(others) => others.read(path),
            None => Err(FileError::NotFound),
        }
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        self.others.as_ref().map_or(Err(FileError::NotFound), |others| others.solid(path))
    }
}

/// `flexura diff`.
pub fn run(arguments: &Diff) -> u8 {
    super::sarif::refuse(arguments.format);
    let texts: Vec<&str> = arguments.versions.iter().map(String::as_str).collect();
    // Git calls with the path alone where a merge is not resolved, and says so in its environment.
    let from_git = std::env::var_os("GIT_DIFF_PATH_COUNTER").is_some();
    let pair = match texts.as_slice() {
        [path] if from_git => return print(&format!("{path}: a merge that is not resolved\n")),
        [file] => at_revision("HEAD", file),
        [a, b] if !Path::new(a).exists() && !a.contains(':') && Path::new(b).exists() => at_revision(a, b),
        [a, b] => version(a).and_then(|a| Ok((a, version(b)?))),
        [path, old, old_hex, _, new, new_hex, _, ..] if texts.len() != 8 => {
            let new_path = texts.get(7).copied().unwrap_or(path);
            if !path.ends_with(".mech") {
                return by_lines(old, new);
            }
            driven(path, old, old_hex, false).and_then(|a| Ok((a, driven(new_path, new, new_hex, true)?)))
        }
        _ => Err("write `flexura diff A B`".into()),
    };
    match pair {
        Ok((before, after)) => told(&before, &after, arguments.format),
        Err(why) => refused(&why, arguments.format),
    }
}

fn refused(why: &str, format: Format) -> u8 {
    let found = [placeless(Severity::Error, "E0730", why)];
    render::report(&found, &Default::default(), format);
    FAILED
}

fn at_revision(rev: &str, file: &str) -> Result<(Version, Version), String> {
    let (files, source) = Revision::of_file(Path::new(file), rev).map_err(|why| cannot_read(file, &why))?;
    let before = Version { name: format!("{rev}:{file}"), source, files: Some(Box::new(files)) };
    Ok((before, version(file)?))
}

/// A file on the disk, or `REVISION:PATH`.
fn version(text: &str) -> Result<Version, String> {
    let failed = |why: &str| cannot_read(text, why);
    if let Some((rev, path)) = text.split_once(':')
        && !Path::new(text).exists()
    {
        let (files, source) = Revision::of(Path::new("."), rev, path).map_err(|why| failed(&why))?;
        return Ok(Version { name: text.into(), source, files: Some(Box::new(files)) });
    }
    let (files, source) = Folder::of(Path::new(text)).map_err(|e| failed(&e.to_string()))?;
    Ok(Version { name: text.into(), source, files: Some(Box::new(files)) })
}

fn cannot_read(what: &str, why: &str) -> String {
    format!("cannot read `{what}`: {why}")
}

/// A version as git hands it over: a temporary file and the name of the object in it. Imports and the lock are those of
/// a revision that holds this object; where there is none, it has none.
fn driven(path: &str, file: &str, object: &str, newest: bool) -> Result<Version, String> {
    let side = if newest { "new" } else { "old" };
    let name = format!("{path} ({side})");
    if file == "/dev/null" || file == "nul" {
        return Ok(Version { name, source: path.into(), files: None });
    }
    // The working tree's own file stands where its imports are.
    if file == path {
        return Ok(Version { name, ..version(path)? });
    }
    let text = read_text(Path::new(file)).map_err(|e| cannot_read(path, &e.to_string()))?;
    let source = path.rsplit('/').next().unwrap_or(path).to_string();
    let others = Revision::holding(path, object, newest).map(|(files, _)| Box::new(files) as Box<_>);
    Ok(Version { name, files: Some(Box::new(Instead { name: source.clone(), text, others })), source })
}

/// What git shows by itself, for files that are no designs.
fn by_lines(old: &str, new: &str) -> u8 {
    let git = Command::new("git").args(["diff", "--no-index", "--no-ext-diff", "--", old, new]).status();
    match git {
        Ok(_) => FINE,
        Err(e) => refused(&format!("git cannot be run: {e}"), Format::Human),
    }
}

/// Examines a version as far as asked.
fn examined(version: &Version, variant: Option<&str>, extent: Extent) -> Result<Examined, String> {
    let Some(files) = &version.files else { return Ok(Examined::default()) };
    // Read once here so that an unreadable design is told from an unreadable import.
    files.read(&version.source).map_err(|e| cannot_read(&version.name, &e.to_string()))?;
    let stem = version.source.strip_suffix(".mech").unwrap_or(&version.source);
    let lock = format!("{stem}{}.lock", variant.map(|v| format!(".{v}")).unwrap_or_default());
    let lock = match files.read(&lock) {
        Ok(text) => Some((lock, text)),
        Err(FileError::NotFound) => None,
        Err(e) => return Err(cannot_read(&format!("the lock of {}", version.name), &e.to_string())),
    };
    let variant = variant.map(String::from);
    let request = Request { source: version.source.clone(), variant, lock, ..Request::default() };
    Ok(examine(&request, Values::LockOrStart, extent, &Compiler::default(), files.as_ref()))
}

/// What differs, of the design as it stands or of a variant, and both versions of it.
fn compared(
    before: &Version,
    after: &Version,
    variant: Option<&str>,
) -> Result<(Changes, Examined, Examined), String> {
    let both =
        |extent| rayon::join(|| examined(before, variant, extent), || examined(after, variant, extent));
    let pair = |(a, b): (Result<Examined, String>, Result<Examined, String>)| Ok::<_, String>((a?, b?));
    let (a, b) = pair(both(Extent::Values))?;
    let changes = compare(&a, &b);
    // Only what differs, and can be simulated, is worth the time.
    let fine = [&a, &b].iter().all(|e| !e.outcome.failed());
    if changes.unchanged || !fine {
        return Ok((changes, a, b));
    }
    let (a, b) = pair(both(Extent::Volume))?;
    Ok((compare(&a, &b), a, b))
}

/// Variants of both versions that do something else, each with what differs; what the text says is told of the whole.
fn variants(
    before: &Version,
    after: &Version,
    [a, b]: [&Examined; 2],
) -> Result<Vec<(String, Changes)>, String> {
    let mut found = Vec::new();
    for name in a.outcome.variants.iter().filter(|v| b.outcome.variants.contains(v)) {
        let (mut changes, ..) = compared(before, after, Some(name))?;
        changes.names.clear();
        changes.lines.clear();
        let differs = changes.behaviour.iter().any(Row::differs) || changes.values[0] != changes.values[1];
        if !changes.numbers.is_empty() || differs {
            found.push((name.clone(), changes));
        }
    }
    Ok(found)
}

fn told(before: &Version, after: &Version, format: Format) -> u8 {
    let found = compared(before, after, None).and_then(|(changes, a, b)| {
        let variants = variants(before, after, [&a, &b])?;
        Ok((changes, a, b, variants))
    });
    let (changes, a, b, variants) = match found {
        Ok(found) => found,
        Err(why) => return refused(&why, format),
    };
    match format {
        Format::Human => {
            let style = Style::stdout();
            let mut text = human([before, after], [&a, &b], &changes, style);
            for (name, changes) in &variants {
                let _ = writeln!(text, "\n{}", style.bold(&format!("variant {name}")));
                numbers(&mut text, &changes.numbers, style);
                behaviour(&mut text, changes, style);
            }
            print(&text)
        }
        Format::Json | Format::Sarif => {
            let mut value = serde_json::json!(changes);
            if let Some(fields) = value.as_object_mut() {
                let side = |v: &Version, e: &Examined| {
                    serde_json::json!({
                        "name": v.name,
                        "diagnostics": render::json(&e.outcome.diagnostics, &e.outcome.sources),
                    })
                };
                fields.insert("before".into(), side(before, &a));
                fields.insert("after".into(), side(after, &b));
                let variants =
                    variants.iter().map(|(name, changes)| (name.clone(), serde_json::json!(changes)));
                fields.insert("variants".into(), variants.collect::<serde_json::Map<_, _>>().into());
            }
            print(&format!("{value}\n"))
        }
    }
}

fn human(versions: [&Version; 2], examined: [&Examined; 2], changes: &Changes, style: Style) -> String {
    let mut text = String::new();
    for ((word, version), (examined, values)) in
        ["before", "after "].iter().zip(versions).zip(examined.iter().zip(changes.values))
    {
        let how = match values {
            _ if version.files.is_none() => "does not exist".into(),
            Simulated::Not => render::counts(&examined.outcome.diagnostics),
            Simulated::Lock => "with the values of its lock".into(),
            Simulated::Start => "with the values of its own start: it has no lock of this state".into(),
            Simulated::Partly => "partly with the values of its lock, else of its own start".into(),
        };
        let _ = writeln!(text, "{word}  {}  {}", style.bold(&version.name), style.dim(&how));
    }
    if changes.unchanged {
        text.push_str("no change of the design\n");
        return text;
    }
    names(&mut text, changes, style);
    numbers(&mut text, &changes.numbers, style);
    behaviour(&mut text, changes, style);
    text
}

fn names(text: &mut String, changes: &Changes, style: Style) {
    if !changes.names.is_empty() {
        let _ = writeln!(text, "\n{}", style.dim("names"));
    }
    for n in &changes.names {
        let inside = if n.scope.is_empty() { String::new() } else { style.dim(&format!("  in {}", n.scope)) };
        let what = format!("{} {}", n.kind, n.name);
        let line = match n.change {
            NameChange::Added => style.green(&format!("+ {what}")),
            NameChange::Removed => style.red(&format!("- {what}")),
            NameChange::Renamed => {
                format!("~ {what} is now called {}", n.to.as_deref().unwrap_or("otherwise"))
            }
        };
        let _ = writeln!(text, "  {line}{inside}");
    }
    if !changes.lines.is_empty() {
        let _ = writeln!(text, "\n{}", style.dim("lines"));
    }
    for l in &changes.lines {
        let _ = writeln!(text, "  {}  {}", style.bold(&l.what), style.dim(&l.scope));
        let _ = writeln!(text, "    {}", style.red(&format!("- {}", l.before)));
        let _ = writeln!(text, "    {}", style.green(&format!("+ {}", l.after)));
    }
}

fn numbers(text: &mut String, numbers: &[Number], style: Style) {
    if numbers.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n{}", style.dim("numbers"));
    let mut kinds: Vec<&str> = numbers.iter().map(|n| n.kind).collect();
    kinds.dedup();
    let of = |kind: &str| numbers.iter().filter(move |n| n.kind == kind).collect::<Vec<_>>();
    let name = |n: &Number| format!("{} {}", n.kind, n.name);
    let shown = || kinds.iter().flat_map(|kind| of(kind).into_iter().take(MOST_OF_A_KIND));
    let width = shown().map(|n| name(n).chars().count()).max().unwrap_or(0);
    for kind in &kinds {
        let all = of(kind);
        for n in all.iter().take(MOST_OF_A_KIND) {
            let (before, after) = (number(n.before), number(n.after));
            let _ = writeln!(text, "  {:width$}  {before:>10}  {after:>10}  {}", name(n), n.unit);
        }
        if all.len() > MOST_OF_A_KIND {
            let more =
                format!("  and {} more of this kind: --format json has all", all.len() - MOST_OF_A_KIND);
            let _ = writeln!(text, "{}", style.dim(&more));
        }
    }
}

fn behaviour(text: &mut String, changes: &Changes, style: Style) {
    if changes.behaviour.is_empty() {
        let why = "what they do is not compared: one of them cannot be simulated";
        let _ = writeln!(text, "\n{}", style.dim(why));
        return;
    }
    let width = changes.behaviour.iter().map(|r| r.name.chars().count()).max().unwrap_or(0);
    let heading = format!("{:width$}  {:>10}  {:>10}  {:>8}", "behaviour", "before", "after", "change");
    let _ = writeln!(text, "\n{}", style.dim(&heading));
    for row in &changes.behaviour {
        let shown = |v: Option<f64>| v.map_or("-".into(), number);
        let change = match row.percent().filter(|_| row.differs()) {
            Some(p) if p >= MOST_PERCENT && row.before > Some(0.0) => format!("×{:.0}", p / 100.0 + 1.0),
            Some(p) if p.abs() >= 0.05 => format!("{p:+.1} %"),
            Some(_) => "±0.0 %".into(),
            None => String::new(),
        };
        let line = format!(
            "{:width$}  {:>10}  {:>10}  {change:>8}  {}{}",
            row.name,
            shown(row.before),
            shown(row.after),
            row.unit,
            verdict(row, style)
        );
        let _ = writeln!(text, "{}", if row.differs() { line } else { style.dim(&line) });
    }
}

fn verdict(row: &Row, style: Style) -> String {
    let word = |holds: Option<bool>| match holds {
        Some(true) => style.green("holds"),
        Some(false) => style.red("FAILS"),
        None => "-".into(),
    };
    match row.holds {
        None => String::new(),
        Some([a, b]) if a == b => format!("  {}", word(b)),
        Some([a, b]) => format!("  {} → {}", word(a), word(b)),
    }
}

/// As many digits as tell two neighbours apart, and no more.
fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && size < 1e-3 { format!("{value:.2e}") } else { format!("{value:.4}") }
}
