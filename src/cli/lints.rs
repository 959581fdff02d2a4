//! Which findings are told: flags, the configuration file, the baseline. Read here, judged in `flexura::lint`.

use super::sources::read_text;
use clap::Args;
use flexura::diagnostic::{Diagnostic, Severity, SourceMap};
use flexura::lint::baseline::Baseline;
use flexura::lint::{Level, Levels, Selector, config};
use flexura::pipeline::{FileError, placeless};
use std::path::{Path, PathBuf};

/// Flags of commands that tell findings.
#[derive(Clone, Debug, Default, Args)]
pub struct LintFlags {
    /// Do not tell this finding: a code, a rule's name, `warnings` or `all` (repeatable)
    #[arg(long, value_name = "CODE", help_heading = "Findings")]
    allow: Vec<Selector>,
    /// Tell this finding as a warning
    #[arg(long, value_name = "CODE", help_heading = "Findings")]
    warn: Vec<Selector>,
    /// Tell this finding as an error, e.g. --deny warnings
    #[arg(long, value_name = "CODE", help_heading = "Findings")]
    deny: Vec<Selector>,
    /// Tell only what is not in this file, written by `check --write-baseline`
    #[arg(long, value_name = "FILE", help_heading = "Findings")]
    baseline: Option<PathBuf>,
}

/// What stops a command before it begins, with the texts it points into.
pub struct Stopped {
    /// Findings about the command's own files.
    pub diagnostics: Vec<Diagnostic>,
    /// Those files.
    pub sources: SourceMap,
}

impl LintFlags {
    /// The levels of a command for a design in `folder`.
    pub fn levels(&self, folder: &Path) -> Result<Levels, Stopped> {
        let mut sources = SourceMap::default();
        let mut found = Vec::new();
        let mut levels = Levels::default();
        let all = [(&self.allow, Level::Allow), (&self.warn, Level::Warn), (&self.deny, Level::Deny)];
        for (selectors, level) in all {
            levels.flags.extend(selectors.iter().map(|s| (s.clone(), level)));
        }
        match super::config::found(folder, &mut sources) {
            Ok(None) => {}
            Ok(Some(own)) => match config::parse(&own.text, own.file) {
                Ok(config) => levels.config = config,
                Err(why) => found.extend(why),
            },
            Err(why) => found.push(*why),
        }
        if let Some(path) = &self.baseline {
            match read(path, &mut sources).and_then(|(text, file)| Baseline::parse(&text, file)) {
                Ok(baseline) => levels.baseline = Some(baseline),
                Err(why) => found.extend(why),
            }
        }
        if found.is_empty() { Ok(levels) } else { Err(Stopped { diagnostics: found, sources }) }
    }
}

fn read(path: &Path, sources: &mut SourceMap) -> Result<(String, u32), Vec<Diagnostic>> {
    let unread = |why: FileError| {
        let message = format!("cannot read `{}`: {why}", path.display());
        vec![placeless(Severity::Error, "E0730", message)]
    };
    let text = read_text(path).map_err(unread)?;
    let file = sources.add(path.display().to_string(), text.clone());
    Ok((text, file))
}
