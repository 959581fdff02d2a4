//! `flexura.toml`: what a project's commands do where nothing is said. The nearest one counts: beside the source, or in
//! a folder above it up to that of the repository. Its table `[lints]` is the linter's.
//!
//! ```toml
//! [build]
//! out = "made"
//! iterations = 300
//! optimizer = "lm"
//! threads = 2
//! ```

use super::sources::read_text;
use super::{Build, Cli, Command, Common, Optimizer};
use clap::ArgMatches;
use clap::parser::ValueSource;
use flexura::diagnostic::{Diagnostic, Origin, Severity, SourceMap};
use flexura::lint::config::NAME;
use flexura::pipeline::placeless;
use serde::Deserialize;
use std::path::{Path, PathBuf};

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Config {
    #[serde(default)]
    build: BuildTable,
    /// Read where findings are judged.
    #[serde(default, rename = "lints")]
    _lints: toml::Table,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct BuildTable {
    /// Relative to the configuration's folder.
    out: Option<PathBuf>,
    iterations: Option<u32>,
    optimizer: Option<OptimizerName>,
    threads: Option<std::num::NonZeroU16>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum OptimizerName {
    Lm,
    Lbfgs,
    CmaEs,
}

impl From<OptimizerName> for Optimizer {
    fn from(name: OptimizerName) -> Self {
        match name {
            OptimizerName::Lm => Self::Lm,
            OptimizerName::Lbfgs => Self::Lbfgs,
            OptimizerName::CmaEs => Self::CmaEs,
        }
    }
}

/// Findings about the configuration, and the texts they point into.
pub type Faults = (Vec<Diagnostic>, SourceMap);

/// Puts the configuration's values where the command line gave none.
pub fn apply(cli: &mut Cli, matches: &ArgMatches) -> Result<(), Faults> {
    let Some((_, given)) = matches.subcommand() else { return Ok(()) };
    // Not every command has every option, and of one that it has not it must not be asked.
    let said = |name: &str| {
        given.try_contains_id(name).is_ok() && given.value_source(name) == Some(ValueSource::CommandLine)
    };
    let Some(source) = cli.command.source() else { return Ok(()) };
    let Some((config, folder)) = read(source)? else { return Ok(()) };
    let table = config.build;
    if let (false, Some(threads), Some(common)) = (said("threads"), table.threads, cli.command.common_mut()) {
        common.threads = Some(threads.get());
    }
    if let (
        Some(out),
        Command::Build(Build { out: chosen, .. }) | Command::Simulate(super::Simulate { out: chosen, .. }),
    ) = (table.out.filter(|_| !said("out")), &mut cli.command)
    {
        *chosen = folder.join(out);
    }
    let iterations = table.iterations.filter(|_| !said("iterations"));
    let optimizer = table.optimizer.map(Optimizer::from);
    match &mut cli.command {
        Command::Build(build) => {
            build.iterations = iterations.unwrap_or(build.iterations);
            build.optimizer = optimizer.filter(|_| !said("optimizer")).unwrap_or(build.optimizer);
        }
        Command::View(view) => view.configure(iterations, optimizer, table.threads.map(|n| n.get())),
        _ => (),
    }
    Ok(())
}

impl Command {
    /// Options of commands that read a design.
    pub fn common(&self) -> Option<&Common> {
        match self {
            Command::Check(check) => Some(&check.common),
            Command::Ir(common) => Some(common),
            Command::Build(build) => Some(&build.common),
            Command::Simulate(simulate) => Some(&simulate.common),
            _ => None,
        }
    }

    /// The design whose configuration counts.
    fn source(&self) -> Option<&Path> {
        match self {
            Command::View(view) => Some(view.source()),
            _ => self.common().map(|c| c.source.as_path()),
        }
    }

    fn common_mut(&mut self) -> Option<&mut Common> {
        match self {
            Command::Check(check) => Some(&mut check.common),
            Command::Ir(common) => Some(common),
            Command::Build(build) => Some(&mut build.common),
            Command::Simulate(simulate) => Some(&mut simulate.common),
            _ => None,
        }
    }
}

/// The configuration that counts for a source, and its folder.
fn read(source: &Path) -> Result<Option<(Config, PathBuf)>, Faults> {
    // An unreadable source is told by the command itself.
    let Some(folder) = source.canonicalize().ok().and_then(|p| p.parent().map(Path::to_path_buf)) else {
        return Ok(None);
    };
    let mut sources = SourceMap::default();
    let Found { folder, text, file } = match found(&folder, &mut sources) {
        Ok(Some(found)) => found,
        Ok(None) => return Ok(None),
        Err(why) => return Err((vec![*why], sources)),
    };
    match toml::from_str(&text) {
        Ok(config) => Ok(Some((config, folder))),
        Err(e) => {
            let place = e.span().unwrap_or(0..0);
            let at = Origin { file, start: place.start as u32, end: place.end as u32 };
            let message = format!("this configuration cannot be read: {}", e.message().trim_end());
            let help = "it may hold a table `[build]` with out, iterations, optimizer, threads, and a table `[lints]`";
            Err((vec![Diagnostic::error("E0740", message, at).help(help)], sources))
        }
    }
}

/// A configuration's text, its index in the source map, and its folder.
pub struct Found {
    /// Where it stands.
    pub folder: PathBuf,
    /// What it says.
    pub text: String,
    /// Its index.
    pub file: u32,
}

/// The configuration that counts for designs in a folder: beside them, or above up to the repository's folder.
///
/// # Errors
/// E0730 where it cannot be read.
pub fn found(folder: &Path, sources: &mut SourceMap) -> Result<Option<Found>, Box<Diagnostic>> {
    let top = folder.ancestors().find(|a| a.join(".git").exists()).unwrap_or(folder);
    let within = folder.ancestors().take_while(|a| a.starts_with(top));
    let Some(folder) = within.into_iter().find(|a| a.join(NAME).is_file()) else { return Ok(None) };
    let path = folder.join(NAME);
    let text = read_text(&path).map_err(|why| {
        Box::new(placeless(Severity::Error, "E0730", format!("cannot read `{}`: {why}", path.display())))
    })?;
    let file = sources.add(path.display().to_string(), text.clone());
    Ok(Some(Found { folder: folder.to_path_buf(), text, file }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_configuration_of_the_repository_counts() {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("repository/designs/leg");
        let counts = || found(&inner, &mut SourceMap::default()).unwrap().map(|f| f.folder);
        std::fs::create_dir_all(&inner).unwrap();
        std::fs::write(outer.path().join(NAME), "").unwrap();
        assert_eq!(counts(), None, "without a repository only beside the source");
        std::fs::create_dir(outer.path().join("repository/.git")).unwrap();
        assert_eq!(counts(), None, "not above the repository");
        let shared = outer.path().join("repository");
        std::fs::write(shared.join(NAME), "").unwrap();
        assert_eq!(counts(), Some(shared));
        std::fs::write(inner.join(NAME), "").unwrap();
        assert_eq!(counts(), Some(inner.clone()));
    }
}
