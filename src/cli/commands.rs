//! One function a command: files to a request, the pipeline, its outcome to files and reports.

use super::artefacts::{Output, WriteError, write_atomic, write_below};
use super::events::Events;
use super::interrupt;
use super::manners::Manners;
use super::progress::Terminal;
use super::render::tell;
use super::sources::{Folder, read_text};
use super::style::Style;
use super::{Build, Common, Format, Simulate, human, render};
use flexura::diagnostic::{Severity, SourceMap};
use flexura::emit::csv::{MotionTable, columns, values, write_csv};
use flexura::pipeline::{self, BuildOutcome, Compiler, FileError, Progress, Request, Show, placeless};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code: all is well.
pub const FINE: u8 = 0;
/// Exit code: the design has errors, a requirement fails, or a file cannot be read or written.
pub const FAILED: u8 = 1;

/// `flexura ir`.
pub fn ir(common: &Common) -> u8 {
    let opened = match open(common) {
        Ok(opened) => opened,
        Err(why) => return unreadable(common, &why),
    };
    let mut out = pipeline::check(&opened.request, &Compiler::default(), &opened.folder);
    opened.name_as_written(&mut out.sources);
    match &out.assembly {
        // The output is the design: findings go to the standard error in either format.
        Some(assembly) => {
            render::show(&out.diagnostics, &out.sources);
            let text = match assembly.single() {
                Some(design) => serde_json::to_string_pretty(design),
                None => serde_json::to_string_pretty(assembly),
            };
            match text {
                Ok(text) => print(&format!("{text}\n")),
                Err(e) => render::refuse("E0731", e.to_string(), common.format),
            }
        }
        None => {
            render::report(&out.diagnostics, &out.sources, common.format);
            FAILED
        }
    }
}

/// `flexura simulate`.
pub fn simulate(arguments: &Simulate) -> u8 {
    let common = &arguments.common;
    let mut opened = match open(common) {
        Ok(opened) => opened,
        Err(why) => return unreadable(common, &why),
    };
    opened.request.fresh = arguments.fresh;
    opened.request.frozen = arguments.frozen;
    opened.request.case.clone_from(&arguments.case);
    if let Err(why) = opened.read_lock(common, &arguments.out) {
        return unreadable(common, &why);
    }
    let show = Show { rigid: arguments.rigid, poses: arguments.poses };
    let (mut out, simulation) =
        pipeline::simulate(&opened.request, show, &Compiler::default(), &opened.folder);
    opened.name_as_written(&mut out.sources);
    let to_stdout = arguments.output == Path::new("-");
    if let (Some(simulation), false) = (&simulation, to_stdout)
        && let Err(e) = write_atomic(&arguments.output, write_csv(&simulation.motion).as_bytes())
    {
        out.diagnostics.push(placeless(Severity::Error, "E0731", e.to_string()));
    }
    let table = simulation.as_ref().map(|s| &s.motion).filter(|_| to_stdout);
    let printed = match common.format {
        // The table may go to the standard output: findings for people never do.
        Format::Human => {
            render::show(&out.diagnostics, &out.sources);
            table.map_or(FINE, |table| print(&write_csv(table)))
        }
        Format::Json | Format::Sarif => print(&format!("{}\n", motion_json(&out, table))),
    };
    printed.max(code(&out))
}

/// The motion for scripts: the columns and rows of the CSV, unless they went into a file, and the findings.
fn motion_json(out: &BuildOutcome, table: Option<&MotionTable>) -> serde_json::Value {
    let columns = table.map(columns);
    let rows = table.map(|t| (0..t.states.len()).map(|step| values(t, step)).collect::<Vec<_>>());
    serde_json::json!({
        "columns": columns,
        "rows": rows,
        "diagnostics": render::json(&out.diagnostics, &out.sources),
    })
}

/// `flexura build`.
pub fn build(arguments: &Build) -> u8 {
    let format = arguments.common.format;
    if arguments.events {
        let events = Events::new();
        let built =
            build_one(arguments, arguments.common.variant.as_deref(), &events, &AtomicBool::new(false));
        events.outcome(&built.0, &built.1);
        return finish_build(&built.0, format, &built.1);
    }
    let progress = Terminal::new(format == Format::Human && !Manners::chosen().quiet);
    let cancel = interrupt::during(progress.on_stop());
    let mut builds = vec![build_one(arguments, arguments.common.variant.as_deref(), &progress, &cancel)];
    if arguments.all_variants {
        let variants = builds.first().map(|(out, _)| out.variants.clone()).unwrap_or_default();
        for variant in &variants {
            // What was interrupted is not taken up by the next one.
            if !cancel.load(Ordering::SeqCst) {
                builds.push(build_one(arguments, Some(variant), &progress, &cancel));
            }
        }
    }
    progress.finish();
    interrupt::over();
    match builds.as_slice() {
        [(out, written)] if !arguments.all_variants => finish_build(out, format, written),
        _ => finish_builds(&builds, format),
    }
}

type Built = (BuildOutcome, Vec<(String, usize)>);

/// Builds the design as it stands, or a variant of it, into its folder; also what was written.
fn build_one(
    arguments: &Build,
    variant: Option<&str>,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Built {
    let common = &Common { variant: variant.map(String::from), ..arguments.common.clone() };
    let folder = variant.map_or(arguments.out.clone(), |variant| arguments.out.join(variant));
    let mut opened = match open(common) {
        Ok(opened) => opened,
        Err(why) => return (unopened(&why), Vec::new()),
    };
    opened.request.fresh = arguments.fresh;
    opened.request.resume = arguments.resume;
    opened.request.frozen = arguments.frozen;
    match arguments.lints.levels(opened.folder.root()) {
        Ok(levels) => opened.request.levels = levels,
        Err(stopped) => {
            let out = BuildOutcome {
                diagnostics: stopped.diagnostics,
                sources: stopped.sources,
                ..BuildOutcome::default()
            };
            return (out, Vec::new());
        }
    }
    let lock_path = match opened.read_lock(common, &folder) {
        Ok(path) => path,
        Err(why) => return (unopened(&why), Vec::new()),
    };
    let compiler = Compiler { method: arguments.optimizer.into(), iterations: arguments.iterations as usize };
    let made = Output(&folder);
    let mut out = pipeline::build_upon(&opened.request, &made, &compiler, &opened.folder, progress, cancel);
    opened.name_as_written(&mut out.sources);
    let written = match write(&out, &folder, &lock_path) {
        Ok(written) => written,
        Err(e) => {
            out.diagnostics.push(placeless(Severity::Error, "E0731", e.to_string()));
            Vec::new()
        }
    };
    (out, written)
}

/// Reports the builds of a design and of its variants.
fn finish_builds(builds: &[Built], format: Format) -> u8 {
    let names = builds.first().map(|(out, _)| out.variants.as_slice()).unwrap_or_default();
    let names = std::iter::once(None).chain(names.iter().map(Some));
    let mut worst = FINE;
    let mut all = Vec::new();
    let (mut found, mut sources) = (Vec::new(), SourceMap::default());
    for ((out, written), name) in builds.iter().zip(names) {
        match format {
            Format::Human => {
                let of = name.map_or("as it stands".into(), |name| format!("variant {name}"));
                print(&format!("{}\n", Style::stdout().bold(&of)));
                worst = worst.max(finish_build(out, format, written));
            }
            Format::Json => all.push(serde_json::json!({ "variant": name, "build": json(out) })),
            Format::Sarif => {
                let new: Vec<_> = out.diagnostics.iter().filter(|d| !found.contains(*d)).cloned().collect();
                found.extend(new);
                // All read the same files in the same order; locks are the last.
                if out.sources.files.len() > sources.files.len() {
                    sources = out.sources.clone();
                }
            }
        }
        worst = worst.max(code(out));
    }
    match format {
        Format::Human => {}
        Format::Json => worst = worst.max(print(&format!("{}\n", serde_json::json!({ "builds": all })))),
        Format::Sarif => worst = worst.max(super::sarif::print(&found, &sources)),
    }
    worst
}

/// Reports a build, in either format.
fn finish_build(out: &BuildOutcome, format: Format, written: &[(String, usize)]) -> u8 {
    match format {
        Format::Human => {
            render::show(&out.diagnostics, &out.sources);
            match &out.assembly {
                Some(_) if Manners::chosen().quiet => {}
                Some(_) => {
                    print(&human::report(out, written, Style::stdout()));
                }
                None => tell(&format!("{}\n", render::counts(&out.diagnostics))),
            }
        }
        Format::Json => {
            print(&format!("{}\n", json(out)));
        }
        Format::Sarif => {
            super::sarif::print(&out.diagnostics, &out.sources);
        }
    }
    code(out)
}

/// The object that scripts rely on.
fn json(out: &BuildOutcome) -> serde_json::Value {
    serde_json::json!({
        "design_parameters": out.assembly.as_ref().map(|a| a.designs.iter().map(|d| d.free.len()).sum::<usize>()),
        "iterations": out.solution.as_ref().map(|s| s.iterations),
        "before": out.before,
        "after": out.after,
        "seconds": out.seconds,
        "artefacts": out.made().map(|(name, _)| name).collect::<Vec<_>>(),
        "diagnostics": render::json(&out.diagnostics, &out.sources),
    })
}

/// Writes lock and artefacts, and the manifest last: it is true only of what is there. Returns paths and sizes.
fn write(out: &BuildOutcome, folder: &Path, lock_path: &Path) -> Result<Vec<(String, usize)>, WriteError> {
    let mut written = Vec::new();
    if let Some(lock) = &out.lock {
        write_atomic(lock_path, lock.as_bytes())?;
        written.push((lock_path.display().to_string(), lock.len()));
    }
    for artefact in out.artefacts.iter().chain(&out.manifest) {
        write_below(folder, &artefact.name, &artefact.bytes)?;
    }
    written.extend(out.made().map(|(name, bytes)| (folder.join(name).display().to_string(), bytes)));
    Ok(written)
}

/// The exit code of an outcome.
pub fn code(out: &BuildOutcome) -> u8 {
    if out.failed() { FAILED } else { FINE }
}

/// Writes to the standard output; a reader that went away is no reason to panic.
pub fn print(text: &str) -> u8 {
    let mut stdout = std::io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Ok(()) => FINE,
        Err(_) => FAILED,
    }
}

/// A source and the folder it stands in.
pub struct Opened {
    /// Where its files are.
    pub folder: Folder,
    /// What is asked of it.
    pub request: Request,
    /// Folder as the user wrote it, for messages and for the lock.
    shown: PathBuf,
}

/// Opens a design.
pub fn open(common: &Common) -> Result<Opened, (PathBuf, FileError)> {
    let fail = |e| (common.source.clone(), e);
    let (folder, source) = Folder::of(&common.source).map_err(fail)?;
    // Read once here so that an unreadable source is told from an unreadable import.
    read_text(&folder.root().join(&source)).map_err(fail)?;
    // As the user wrote it, unless a symbolic link to the source leads elsewhere.
    let written = common.source.parent().map(Path::to_path_buf).unwrap_or_default();
    let same = Path::new(".").join(&written).canonicalize().is_ok_and(|p| p == folder.root());
    let shown = if same { written } else { folder.root().to_path_buf() };
    let request = Request {
        source,
        overrides: common.overrides.clone(),
        steps: common.steps.map(|n| n as usize),
        variant: common.variant.clone(),
        ..Request::default()
    };
    Ok(Opened { folder, request, shown })
}

impl Opened {
    /// Gives the design's files the names by which the user can reach them: editors jump to these.
    pub fn name_as_written(&self, sources: &mut SourceMap) {
        for file in &mut sources.files {
            if file.name.ends_with(".mech") && !file.name.starts_with("std/") {
                file.name = self.shown.join(&file.name).display().to_string();
            }
        }
    }

    /// Reads the lock, if there is one; returns where it belongs.
    pub fn read_lock(&mut self, common: &Common, out: &Path) -> Result<PathBuf, (PathBuf, FileError)> {
        let stem = self.request.source.strip_suffix(".mech").unwrap_or(&self.request.source);
        let variant = self.request.variant.as_ref().map(|v| format!(".{v}")).unwrap_or_default();
        let name = format!("{stem}{variant}.lock");
        let tried_out = !common.overrides.is_empty() || common.steps.is_some();
        let path = if tried_out { out.join(&name) } else { self.shown.join(&name) };
        match read_text(&path) {
            Ok(text) => self.request.lock = Some((path.display().to_string(), text)),
            Err(FileError::NotFound) => {}
            Err(_) if self.request.fresh => {}
            Err(e) => return Err((path, e)),
        }
        Ok(path)
    }
}

/// Tells that a file could not be read.
pub fn unreadable(common: &Common, why: &(PathBuf, FileError)) -> u8 {
    render::report(&unopened(why).diagnostics, &SourceMap::default(), common.format);
    FAILED
}

/// The outcome when not even the first file could be read.
pub fn unopened((path, why): &(PathBuf, FileError)) -> BuildOutcome {
    let message = format!("cannot read `{}`: {why}", path.display());
    BuildOutcome {
        diagnostics: vec![placeless(Severity::Error, "E0730", message)],
        ..BuildOutcome::default()
    }
}
