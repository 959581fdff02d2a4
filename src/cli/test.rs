//! `flexura test`: the `require` lines of many designs, from their locks.

use super::commands::{FAILED, FINE, Opened, open, print};
use super::progress::Silent;
use super::render;
use super::style::Style;
use super::{Common, Format, junit};
use clap::{Args, ValueEnum};
use flexura::diagnostic::{Diagnostic, Severity, SourceMap, terminal};
use flexura::pipeline::{Compiler, Examined, Extent, RequirementResult, Values, examine, placeless};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Arguments of `flexura test`.
///
/// Every design is simulated with the values of its lock and held against its `require` lines; exit code 1 where one
/// fails or a design cannot be tested. Its variants are tested too, each from its own lock. In folders all `.mech` files are looked at, also in folders below; files without a
/// mechanism, and parts that another design imports and that have no lock of their own, are passed over.
#[derive(Debug, Args)]
pub struct Test {
    /// Designs (`.mech` files), or folders of them
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Solve designs that have no current lock, and write their locks as `build` does
    #[arg(long)]
    solve: bool,
    /// Number of threads [default: one a core]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// How to report
    #[arg(long, value_enum, default_value_t = Report::Human)]
    format: Report,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Report {
    /// For people
    Human,
    /// For scripts: exactly one JSON object on the standard output
    Json,
    /// For build servers: a JUnit report on the standard output
    Junit,
}

/// What became of a design.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// All requirements hold.
    Pass,
    /// One fails.
    Fail,
    /// It could not be tested.
    Error,
    /// There is nothing to test.
    Skipped,
}

/// A design that was tested.
pub struct Tested {
    /// As the user can reach it.
    pub source: String,
    /// Which of its variants; none: as it stands.
    pub variant: Option<String>,
    /// What became of it.
    pub status: Status,
    /// Why it was passed over.
    pub why: &'static str,
    /// Its requirements, in their order.
    pub requirements: Vec<RequirementResult>,
    /// Findings, those of requirements included.
    pub diagnostics: Vec<Diagnostic>,
    /// The files they point into.
    pub sources: SourceMap,
}

impl Tested {
    /// Source and variant.
    pub fn name(&self) -> String {
        match &self.variant {
            Some(variant) => format!("{} ({variant})", self.source),
            None => self.source.clone(),
        }
    }

    /// Findings as text without colours; only those that `wanted` picks.
    pub fn told(&self, wanted: impl Fn(&Diagnostic) -> bool) -> String {
        let found: Vec<Diagnostic> = self.diagnostics.iter().filter(|d| wanted(d)).cloned().collect();
        terminal::render(&found, &self.sources, terminal::Style::default())
    }

    /// The finding that says why this requirement fails.
    pub fn failure(&self, requirement: &RequirementResult) -> Option<&Diagnostic> {
        // Of instances, the name of the design stands before the line.
        let says = |d: &&Diagnostic| {
            let line = d.message.split_once(": ").map_or("", |(_, line)| line);
            let text = requirement.text.as_str();
            text == line || text.strip_suffix(line).is_some_and(|before| before.ends_with(": "))
        };
        self.diagnostics.iter().filter(|d| is_requirement(d)).find(says)
    }
}

/// Whether a finding is that of a requirement.
pub fn is_requirement(d: &Diagnostic) -> bool {
    d.code == "E0801"
}

/// A design to be tested.
#[derive(Clone)]
struct Unit {
    path: PathBuf,
    /// As it stands, or one of its variants.
    variant: Option<String>,
    /// The user named the file itself.
    named: bool,
}

/// `flexura test`.
pub fn run(arguments: &Test) -> u8 {
    let mut missing = Vec::new();
    let units = units(&arguments.paths, &mut missing);
    let examine_all = |units: &[Unit]| -> Vec<(Examined, Vec<PathBuf>)> {
        units.par_iter().map(|u| examined(u, arguments.solve)).collect()
    };
    let plain = examine_all(&units);
    let of = |(unit, (examined, _)): (&Unit, &(Examined, Vec<PathBuf>))| -> Vec<Unit> {
        let variants = examined.outcome.variants.iter();
        variants.map(|v| Unit { variant: Some(v.clone()), ..unit.clone() }).collect()
    };
    let variants: Vec<Vec<Unit>> = units.iter().zip(&plain).map(of).collect();
    let mut more = examine_all(&variants.concat()).into_iter();
    let (mut all, mut found) = (Vec::new(), Vec::new());
    for ((unit, examined), variants) in units.into_iter().zip(plain).zip(variants) {
        all.push(unit);
        found.push(examined);
        found.extend(more.by_ref().take(variants.len()));
        all.extend(variants);
    }
    let units = all;
    let imported: BTreeSet<&PathBuf> = found.iter().flat_map(|(_, read)| read.iter().skip(1)).collect();
    let judge = |(unit, (examined, read)): (&Unit, &(Examined, Vec<PathBuf>))| {
        let is_part = read.first().is_some_and(|own| imported.contains(own));
        judged(unit, examined, is_part)
    };
    let mut tested: Vec<Tested> = missing.into_iter().map(not_found).collect();
    tested.extend(units.iter().zip(&found).map(judge));
    let printed = match arguments.format {
        Report::Human => human(&tested),
        Report::Json => print(&format!("{}\n", json(&tested))),
        Report::Junit => match junit::report(&tested) {
            Ok(text) => print(&text),
            Err(e) => {
                super::render::refuse("E0731", format!("no report can be written: {e}"), super::Format::Human)
            }
        },
    };
    let bad = tested.iter().any(|t| matches!(t.status, Status::Fail | Status::Error));
    printed.max(if bad { FAILED } else { FINE })
}

/// The designs below the paths, each once, in the order of the arguments and of the names.
fn units(paths: &[PathBuf], missing: &mut Vec<(PathBuf, String)>) -> Vec<Unit> {
    let mut units: Vec<Unit> = Vec::new();
    for path in paths {
        if path.is_dir() {
            let mut below = Vec::new();
            if let Err((at, why)) = collect(path, &mut below) {
                missing.push((at, why));
            }
            if below.is_empty() {
                missing.push((path.clone(), "there is no `.mech` file in this folder".into()));
            }
            units.extend(below.into_iter().map(|path| Unit { path, variant: None, named: false }));
        } else {
            units.push(Unit { path: path.clone(), variant: None, named: true });
        }
    }
    let mut seen = BTreeSet::new();
    units.retain(|u| u.path.canonicalize().map_or(true, |full| seen.insert(full)));
    units
}

/// `.mech` files below a folder in the order of their names. Hidden folders and links are left alone: a link may lead
/// round in a circle.
fn collect(folder: &Path, into: &mut Vec<PathBuf>) -> Result<(), (PathBuf, String)> {
    let failed = |e: std::io::Error| (folder.to_path_buf(), e.to_string());
    let mut entries =
        std::fs::read_dir(folder).map_err(failed)?.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        let kind = entry.file_type().map_err(failed)?;
        let hidden = entry.file_name().to_string_lossy().starts_with('.');
        if kind.is_dir() && !hidden {
            collect(&path, into)?;
        } else if kind.is_file() && path.extension().is_some_and(|e| e == "mech") {
            into.push(path);
        }
    }
    Ok(())
}

/// Examines a design; also the files it read, its own first.
fn examined(unit: &Unit, solve: bool) -> (Examined, Vec<PathBuf>) {
    let path = unit.path.as_path();
    let common = Common { variant: unit.variant.clone(), ..Common::of(path) };
    let mut found = Examined::default();
    let mut opened = match open(&common) {
        Ok(opened) => opened,
        Err(why) => {
            found.outcome = super::commands::unopened(&why);
            return (found, Vec::new());
        }
    };
    let lock = match opened.read_lock(&common, Path::new("")) {
        Ok(lock) => lock,
        Err(why) => {
            found.outcome = super::commands::unopened(&why);
            return (found, Vec::new());
        }
    };
    let never = AtomicBool::new(false);
    let values = if solve { Values::Solve(&Silent, &never) } else { Values::Lock };
    let Opened { request, folder, .. } = &opened;
    found = examine(request, values, Extent::Measures, &Compiler::default(), folder);
    let files = found.outcome.sources.files.iter();
    let own = files.filter(|f| f.name.ends_with(".mech") && !f.name.starts_with("std/"));
    let read = own.map(|f| folder.root().join(&f.name)).collect();
    opened.name_as_written(&mut found.outcome.sources);
    if let Some(text) = &found.outcome.lock
        && let Err(e) = super::artefacts::write_atomic(&lock, text.as_bytes())
    {
        found.outcome.diagnostics.push(placeless(Severity::Error, "E0731", e.to_string()));
    }
    for d in found.outcome.diagnostics.iter_mut().filter(|d| d.code == "E0714") {
        let variant = unit.variant.as_ref().map(|v| format!(" --variant {v}")).unwrap_or_default();
        d.help = Some(format!("`flexura build {}{variant}` solves it and writes its lock", path.display()));
    }
    (found, read)
}

fn judged(unit: &Unit, examined: &Examined, is_part: bool) -> Tested {
    let out = &examined.outcome;
    let errors: Vec<&str> =
        out.diagnostics.iter().filter(|d| d.is_error()).map(|d| d.code.as_str()).collect();
    let only = |code: &str| !unit.named && !errors.is_empty() && errors.iter().all(|c| *c == code);
    let no_lock = !unit.path.with_extension("lock").exists();
    let (status, why) = if only("E0401") {
        (Status::Skipped, "declares no mechanism")
    } else if only("E0714") && is_part && no_lock {
        (Status::Skipped, "a part of another design, without a lock of its own")
    } else if errors.iter().any(|c| *c != "E0801") {
        (Status::Error, "")
    } else if out.requirements.iter().any(|r| !r.pass) {
        (Status::Fail, "")
    } else {
        (Status::Pass, "")
    };
    Tested {
        source: unit.path.display().to_string(),
        variant: unit.variant.clone(),
        status,
        why,
        requirements: out.requirements.clone(),
        diagnostics: if status == Status::Skipped { Vec::new() } else { out.diagnostics.clone() },
        sources: out.sources.clone(),
    }
}

fn not_found((path, why): (PathBuf, String)) -> Tested {
    let message = format!("cannot read `{}`: {why}", path.display());
    Tested {
        source: path.display().to_string(),
        variant: None,
        status: Status::Error,
        why: "",
        requirements: Vec::new(),
        diagnostics: vec![placeless(Severity::Error, "E0730", message)],
        sources: SourceMap::default(),
    }
}

/// A line a design, failing requirements below it; findings on the standard error.
fn human(tested: &[Tested]) -> u8 {
    let style = Style::stdout();
    let width = tested.iter().map(|t| t.name().chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for t in tested {
        // What a requirement measured stands in the summary.
        let found: Vec<Diagnostic> = t.diagnostics.iter().filter(|d| !is_requirement(d)).cloned().collect();
        render::show(&found, &t.sources);
        let (verdict, what) = match t.status {
            Status::Pass if t.requirements.is_empty() => (style.green("pass"), "no requirements".into()),
            Status::Pass => (style.green("pass"), count(t.requirements.len(), "requirement")),
            Status::Fail => {
                let failing = t.requirements.iter().filter(|r| !r.pass).count();
                (style.red("FAIL"), format!("{failing} of {}", count(t.requirements.len(), "requirement")))
            }
            Status::Error => (style.red("FAIL"), render::counts(&found)),
            Status::Skipped => (style.dim("skip"), t.why.into()),
        };
        let _ = writeln!(text, "{verdict}  {:width$}  {what}", t.name());
        for r in t.requirements.iter().filter(|r| !r.pass) {
            let measured =
                r.value.map_or("could not be measured".into(), |v| format!("measured {v:.3} {}", r.unit));
            let _ = writeln!(text, "        {}  {measured}", r.text);
        }
    }
    let of = |status| tested.iter().filter(|t| t.status == status).count();
    let lines: usize = tested.iter().map(|t| t.requirements.len()).sum();
    let sums: Vec<String> =
        [(Status::Pass, "passed"), (Status::Fail, "failed"), (Status::Error, "could not be tested")]
            .into_iter()
            .filter(|(status, _)| of(*status) > 0)
            .map(|(status, word)| format!("{} {word}", of(status)))
            .collect();
    let designs = tested.len() - of(Status::Skipped);
    let _ = writeln!(
        text,
        "\n{}, {}: {}",
        count(designs, "design"),
        count(lines, "requirement"),
        if sums.is_empty() { "nothing to test".into() } else { sums.join(", ") }
    );
    print(&text)
}

fn count(n: usize, one: &str) -> String {
    format!("{n} {one}{}", if n == 1 { "" } else { "s" })
}

fn json(tested: &[Tested]) -> serde_json::Value {
    let of = |status| tested.iter().filter(|t| t.status == status).count();
    let designs: Vec<_> = tested
        .iter()
        .map(|t| {
            serde_json::json!({
                "source": t.source,
                "variant": t.variant,
                "status": t.status,
                "requirements": t.requirements,
                "diagnostics": render::json(&t.diagnostics, &t.sources),
            })
        })
        .collect();
    serde_json::json!({
        "designs": designs,
        "passed": of(Status::Pass),
        "failed": of(Status::Fail),
        "errors": of(Status::Error),
        "skipped": of(Status::Skipped),
    })
}

impl Common {
    /// A design as it is written.
    pub fn of(source: &Path) -> Self {
        let (source, overrides) = (source.to_path_buf(), Vec::new());
        Self {
            source,
            overrides,
            steps: None,
            variant: None,
            threads: None,
            format: Format::Human,
            watch: false,
        }
    }
}
