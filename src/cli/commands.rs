//! One function a command: files to a request, the pipeline, its outcome to files and reports.

use super::artefacts::{Output, WriteError, write_atomic, write_below};
use super::interrupt;
use super::manners::Manners;
use super::progress::Terminal;
use super::render::tell;
use super::sources::{Folder, read_text};
use super::style::Style;
use super::{Build, Common, Format, Simulate, human, render};
use flexura::diagnostic::{Severity, SourceMap};
use flexura::emit::csv::{MotionTable, columns, values, write_csv};
use flexura::pipeline::{self, BuildOutcome, Compiler, FileError, Request, Show, placeless};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Exit code: all is well.
pub const FINE: u8 = 0;
/// Exit code: the design has errors, a requirement fails, or a file cannot be read or written.
pub const FAILED: u8 = 1;

/// `flexura check`.
pub fn check(common: &Common) -> u8 {
    let opened = match open(common) {
        Ok(opened) => opened,
        Err(why) => return unreadable(common, &why),
    };
    let mut out = pipeline::check(&opened.request, &Compiler::default(), &opened.folder);
    opened.name_as_written(&mut out.sources);
    render::report(&out.diagnostics, &out.sources, common.format);
    if common.format == Format::Human && !Manners::chosen().quiet {
        match (&out.assembly, render::counts(&out.diagnostics)) {
            (Some(assembly), counts) if counts.is_empty() => {
                print(&format!("{}: no errors\n", assembly.name));
            }
            (_, counts) => tell(&format!("{}: {counts}\n", common.source.display())),
        }
    }
    code(&out)
}

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
                Err(e) => {
                    tell(&format!("error: {e}\n"));
                    FAILED
                }
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
        Format::Json => print(&format!("{}\n", motion_json(&out, table))),
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
    let common = &arguments.common;
    let mut opened = match open(common) {
        Ok(opened) => opened,
        Err(why) => return finish_build(unopened(&why), common.format, &[]),
    };
    opened.request.fresh = arguments.fresh;
    opened.request.resume = arguments.resume;
    opened.request.frozen = arguments.frozen;
    let lock_path = match opened.read_lock(common, &arguments.out) {
        Ok(path) => path,
        Err(why) => return finish_build(unopened(&why), common.format, &[]),
    };
    let progress = Terminal::new(common.format == Format::Human && !Manners::chosen().quiet);
    let cancel = interrupt::during(progress.on_stop());
    let compiler = Compiler { method: arguments.optimizer.into(), iterations: arguments.iterations as usize };
    let made = Output(&arguments.out);
    let mut out = pipeline::build_upon(&opened.request, &made, &compiler, &opened.folder, &progress, &cancel);
    progress.finish();
    interrupt::over();
    opened.name_as_written(&mut out.sources);
    let written = match write(&out, &arguments.out, &lock_path) {
        Ok(written) => written,
        Err(e) => {
            out.diagnostics.push(placeless(Severity::Error, "E0731", e.to_string()));
            Vec::new()
        }
    };
    finish_build(out, common.format, &written)
}

/// Reports a build, in either format.
fn finish_build(out: BuildOutcome, format: Format, written: &[(String, usize)]) -> u8 {
    match format {
        Format::Human => {
            render::show(&out.diagnostics, &out.sources);
            match &out.assembly {
                Some(_) if Manners::chosen().quiet => {}
                Some(_) => {
                    print(&human::report(&out, written, Style::stdout()));
                }
                None => tell(&format!("{}\n", render::counts(&out.diagnostics))),
            }
        }
        Format::Json => {
            print(&format!("{}\n", json(&out)));
        }
    }
    code(&out)
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

fn code(out: &BuildOutcome) -> u8 {
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
struct Opened {
    folder: Folder,
    request: Request,
    /// Folder as the user wrote it, for messages and for the lock.
    shown: PathBuf,
}

fn open(common: &Common) -> Result<Opened, (PathBuf, FileError)> {
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
        ..Request::default()
    };
    Ok(Opened { folder, request, shown })
}

impl Opened {
    /// Gives the design's files the names by which the user can reach them: editors jump to these.
    fn name_as_written(&self, sources: &mut SourceMap) {
        for file in &mut sources.files {
            if file.name.ends_with(".mech") && !file.name.starts_with("std/") {
                file.name = self.shown.join(&file.name).display().to_string();
            }
        }
    }

    /// Reads the lock, if there is one; returns where it belongs.
    fn read_lock(&mut self, common: &Common, out: &Path) -> Result<PathBuf, (PathBuf, FileError)> {
        let stem = self.request.source.strip_suffix(".mech").unwrap_or(&self.request.source);
        let name = format!("{stem}.lock");
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

fn unreadable(common: &Common, why: &(PathBuf, FileError)) -> u8 {
    render::report(&unopened(why).diagnostics, &SourceMap::default(), common.format);
    FAILED
}

/// The outcome when not even the first file could be read.
fn unopened((path, why): &(PathBuf, FileError)) -> BuildOutcome {
    let message = format!("cannot read `{}`: {why}", path.display());
    BuildOutcome {
        diagnostics: vec![placeless(Severity::Error, "E0730", message)],
        ..BuildOutcome::default()
    }
}
