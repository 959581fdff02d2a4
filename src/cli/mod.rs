//! Commands and their arguments. Everything that touches the world (disk, terminal, clock, signals,
//! threads) lives in this folder.

mod artefacts;
mod commands;
mod diff;
mod git;
mod human;
mod junit;
mod progress;
mod released;
mod render;
mod sarif;
mod sources;
mod style;
mod test;

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;

/// Compliant mechanisms from text: optimised flexures, printable parts, motor code.
///
/// Exit codes: 0 fine, 1 the design has errors or a requirement fails, 2 wrong usage.
#[derive(Debug, Parser)]
#[command(name = "flexura", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Read a design and say what is wrong with it
    Check(Common),
    /// Solve a design and write its parts and sketches
    ///
    /// The solved values go into NAME.lock beside the source; with --set or --steps it goes into the
    /// output folder, so that trying things out leaves the design's own lock alone. Ctrl-C ends the
    /// optimisation and keeps the best point found; a second one ends the program at once.
    Build(Build),
    /// Write the motion over the cycle as CSV
    ///
    /// Shows the lock's values if it belongs to the design, else the design's start. One row a state:
    /// drive values (deg), traced points (mm), drive torques (N*mm), elastic energy (N*mm) and the largest
    /// von Mises stress (MPa). With --format json the same table is one object: columns, rows, diagnostics.
    Simulate(Simulate),
    /// Print the elaborated design as JSON
    Ir(Common),
    /// Check the `require` lines of many designs
    Test(test::Test),
    /// Compare two versions of a design: names, numbers, behaviour
    Diff(diff::Diff),
}

/// What every command takes.
#[derive(Clone, Debug, Args)]
struct Common {
    /// The design, a `.mech` file
    source: PathBuf,
    /// Override a parameter, e.g. --set "r=25 mm" (repeatable)
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    overrides: Vec<(String, String)>,
    /// Number of steps of the cycle
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    steps: Option<u32>,
    /// The variant of this name, in place of the design as it stands
    #[arg(long, value_name = "NAME", value_parser = word)]
    variant: Option<String>,
    /// Number of threads [default: one a core]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// How to report
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people
    Human,
    /// For scripts: exactly one JSON object on the standard output
    Json,
    /// For code review services: the findings as SARIF 2.1.0 (check and build)
    Sarif,
}

#[derive(Debug, Args)]
struct Build {
    #[command(flatten)]
    common: Common,
    /// Build the design as it stands and all its variants, each into a folder of its name in the output folder
    #[arg(long, conflicts_with = "variant")]
    all_variants: bool,
    /// Folder for everything that is made
    #[arg(long, value_name = "FOLDER", default_value = "out")]
    out: PathBuf,
    /// Ignore the lock and solve from the design's own start
    #[arg(long)]
    fresh: bool,
    /// Go on from the lock where its solution had not converged
    #[arg(long, conflicts_with = "fresh")]
    resume: bool,
    /// Refuse to solve: the lock must belong to the design
    #[arg(long, conflicts_with_all = ["fresh", "resume"])]
    frozen: bool,
    /// Iterations of the optimiser at most; the best point found is kept
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    iterations: u32,
    /// Which optimiser; all keep the bounds
    #[arg(long, value_enum, default_value_t = Optimizer::Lm)]
    optimizer: Optimizer,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Optimizer {
    /// Levenberg-Marquardt: uses that the goals are sums of squares; the faster one
    Lm,
    /// L-BFGS: uses gradients only; for comparison with the literature
    Lbfgs,
    /// CMA-ES: uses values only; for comparison with the literature
    CmaEs,
}

impl From<Optimizer> for flexura::optimize::Method {
    fn from(optimizer: Optimizer) -> Self {
        match optimizer {
            Optimizer::Lm => Self::LevenbergMarquardt,
            Optimizer::Lbfgs => Self::Lbfgs,
            Optimizer::CmaEs => Self::CmaEs,
        }
    }
}

#[derive(Debug, Args)]
struct Simulate {
    #[command(flatten)]
    common: Common,
    /// The conventional mechanism's motion
    #[arg(long)]
    rigid: bool,
    /// Add the pose of every moving body: translation t (mm) and rotation vector (rad) from the rest pose
    ///
    /// A point of the body that lies at X in the rest pose lies at x = t + R X, with R the rotation by the
    /// vector's length about its direction. Columns pose.BODY.tx_mm to pose.BODY.rz_rad.
    #[arg(long)]
    poses: bool,
    /// Where to write the table; `-` is the standard output
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    output: PathBuf,
    /// Folder of the lock when --set or --steps is given
    #[arg(long, value_name = "FOLDER", default_value = "out")]
    out: PathBuf,
    /// Ignore the lock and show the design's own start
    #[arg(long)]
    fresh: bool,
    /// Refuse to show anything but the lock's values
    #[arg(long, conflicts_with = "fresh")]
    frozen: bool,
}

/// Runs the command line.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let threads = match &cli.command {
        Command::Check(common) | Command::Ir(common) => common.threads,
        Command::Build(build) => build.common.threads,
        Command::Simulate(simulate) => simulate.common.threads,
        Command::Test(test) => test.threads,
        Command::Diff(diff) => diff.threads,
    };
    if let Command::Simulate(Simulate { common, .. }) | Command::Ir(common) = &cli.command {
        sarif::refuse(common.format);
    }
    let run = || match &cli.command {
        Command::Check(common) => commands::check(common),
        Command::Build(arguments) => commands::build(arguments),
        Command::Simulate(arguments) => commands::simulate(arguments),
        Command::Ir(common) => commands::ir(common),
        Command::Test(arguments) => test::run(arguments),
        Command::Diff(arguments) => diff::run(arguments),
    };
    let code = match threads {
        None => run(),
        Some(n) => match rayon::ThreadPoolBuilder::new().num_threads(usize::from(n)).build() {
            Ok(pool) => pool.install(run),
            Err(e) => {
                render::tell(&format!("error: cannot start {n} threads: {e}\n"));
                commands::FAILED
            }
        },
    };
    ExitCode::from(code)
}

/// A name of the language: it becomes a part of file names.
fn word(text: &str) -> Result<String, String> {
    let plain = !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if plain { Ok(text.into()) } else { Err("it is a name: letters, digits and `_`".into()) }
}

/// `NAME=VALUE`.
fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
            Ok((name.trim().into(), value.trim().into()))
        }
        _ => Err("write it as NAME=VALUE, for example r=25 mm".into()),
    }
}
