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
        if let Some(path) = configuration(folder) {
            match read(&path, &mut sources).and_then(|(text, file)| config::parse(&text, file)) {
                Ok(config) => levels.config = config,
                Err(why) => found.extend(why),
            }
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

/// The nearest configuration: beside the source, or in a folder above it up to that of the repository.
fn configuration(folder: &Path) -> Option<PathBuf> {
    let top = folder.ancestors().find(|a| a.join(".git").exists()).unwrap_or(folder);
    let within = folder.ancestors().take_while(|a| a.starts_with(top));
    within.map(|a| a.join(config::NAME)).find(|p| p.is_file())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_configuration_of_the_repository_counts() {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("repository/designs/leg");
        std::fs::create_dir_all(&inner).unwrap();
        std::fs::write(outer.path().join(config::NAME), "").unwrap();
        assert_eq!(configuration(&inner), None, "without a repository only beside the source");
        std::fs::create_dir(outer.path().join("repository/.git")).unwrap();
        assert_eq!(configuration(&inner), None, "not above the repository");
        let shared = outer.path().join("repository").join(config::NAME);
        std::fs::write(&shared, "").unwrap();
        assert_eq!(configuration(&inner), Some(shared));
        let own = inner.join(config::NAME);
        std::fs::write(&own, "").unwrap();
        assert_eq!(configuration(&inner), Some(own));
    }
}
