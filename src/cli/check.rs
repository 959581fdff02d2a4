//! `flexura check`, with repairs and baselines.

use super::artefacts::write_atomic;
use super::commands::{FAILED, code, open, print, unreadable};
use super::lints::LintFlags;
use super::render::{counts, report, tell};
use super::{Common, Format};
use clap::Args;
use flexura::diagnostic::{Fix, Severity, apply};
use flexura::lint::baseline::Baseline;
use flexura::pipeline::{self, BuildOutcome, Compiler, FileError, Files, Request, SolidFile, placeless};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct Check {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    lints: LintFlags,
    /// Make the repairs that leave what is built as it is
    #[arg(long, help_heading = "Repairs")]
    fix: bool,
    /// Make also repairs that change the design, or guess what was meant
    #[arg(long, help_heading = "Repairs")]
    unsafe_fixes: bool,
    /// Write the present findings into a file; with --baseline they are not told again
    #[arg(long, value_name = "FILE", help_heading = "Findings", conflicts_with_all = ["fix", "unsafe_fixes", "baseline"])]
    write_baseline: Option<PathBuf>,
}

/// Repairs can make others possible; more rounds than this would go in a circle.
const MOST_ROUNDS: usize = 16;

/// Runs `check`.
pub fn check(arguments: &Check) -> u8 {
    let common = &arguments.common;
    let mut opened = match open(common) {
        Ok(opened) => opened,
        Err(why) => return unreadable(common, &why),
    };
    match arguments.lints.levels(opened.folder.root()) {
        Ok(levels) => opened.request.levels = levels,
        Err(stopped) => {
            report(&stopped.diagnostics, &stopped.sources, common.format);
            return FAILED;
        }
    }
    // A lock that cannot be read is said by what needs it.
    let _ = opened.read_lock(common, Path::new("out"));
    let mut files = Overlay { below: &opened.folder, texts: BTreeMap::new() };
    let mut out = pipeline::check(&opened.request, &Compiler::default(), &files);
    let repaired = if arguments.fix || arguments.unsafe_fixes {
        repair(&opened.request, &mut out, &mut files, arguments.unsafe_fixes)
    } else {
        0
    };
    for (name, text) in &files.texts {
        if let Err(e) = write_atomic(&opened.folder.root().join(name), text.as_bytes()) {
            out.diagnostics.push(placeless(Severity::Error, "E0731", e.to_string()));
        }
    }
    if let Some(path) = &arguments.write_baseline {
        let baseline = Baseline::of(&out.diagnostics, &out.sources, &out.files);
        let text = baseline.write().unwrap_or_default();
        if let Err(e) = write_atomic(path, text.as_bytes()) {
            out.diagnostics.push(placeless(Severity::Error, "E0731", e.to_string()));
        } else if common.format == Format::Human {
            let known = baseline.count();
            let many = if known == 1 { "finding" } else { "findings" };
            tell(&format!("{}: {known} {many} known from now on\n", path.display()));
        }
        out.diagnostics.retain(|d| d.code.starts_with('E'));
    }
    opened.name_as_written(&mut out.sources);
    report(&out.diagnostics, &out.sources, common.format);
    if common.format == Format::Human && !super::manners::Manners::chosen().quiet {
        if repaired > 0 {
            tell(&format!("{}: {repaired} repaired\n", common.source.display()));
        }
        match (&out.assembly, counts(&out.diagnostics)) {
            (Some(assembly), counts) if counts.is_empty() => {
                print(&format!("{}: no errors\n", assembly.name));
            }
            (_, counts) => tell(&format!("{}: {counts}\n", common.source.display())),
        }
    }
    code(&out)
}

/// Makes repairs until there are none left; returns how many. One after which there would be more errors than before is
/// left out.
fn repair(request: &Request, out: &mut BuildOutcome, files: &mut Overlay, risky: bool) -> usize {
    let errors = |out: &BuildOutcome| out.diagnostics.iter().filter(|d| d.is_error()).count();
    let mut done = 0;
    // A file's name in the source map is its path below the design's folder, except for the standard library's.
    for _ in 0..MOST_ROUNDS {
        let own: Vec<u32> = out.files.iter().map(|f| f.id).collect();
        let usable = |f: &&Fix| (f.safe || risky) && f.edits.iter().all(|e| own.contains(&e.at.file));
        let fixes: Vec<&Fix> = out.diagnostics.iter().filter_map(|d| d.fixes.iter().find(usable)).collect();
        // All at once, else one alone: another may be what makes an error.
        let attempts = std::iter::once(fixes.clone()).chain(fixes.iter().map(|f| vec![*f]));
        let mut better = None;
        for attempt in attempts {
            let mut texts = files.texts.clone();
            let mut count = 0;
            for (file, text, n) in apply(&out.sources, attempt) {
                if let Some(source) = out.sources.files.get(file as usize) {
                    texts.insert(source.name.clone(), text);
                    count += n;
                }
            }
            if count == 0 {
                continue;
            }
            let tried = Overlay { below: files.below, texts };
            let after = pipeline::check(request, &Compiler::default(), &tried);
            if errors(&after) <= errors(out) {
                better = Some((after, tried.texts, count));
                break;
            }
        }
        let Some((after, texts, count)) = better else { break };
        (*out, files.texts) = (after, texts);
        done += count;
    }
    done
}

/// A folder with some of its files in memory.
struct Overlay<'a> {
    below: &'a dyn Files,
    texts: BTreeMap<String, String>,
}

impl Files for Overlay<'_> {
    fn read(&self, path: &str) -> Result<String, FileError> {
        match self.texts.get(path) {
            Some(text) => Ok(text.clone()),
            None => self.below.read(path),
        }
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        self.below.solid(path)
    }
}
