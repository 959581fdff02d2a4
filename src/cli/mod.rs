//! Commands and their arguments. Everything that touches the world (disk, terminal, clock, signals,
//! threads) lives in this folder.

mod artefacts;
mod check;
mod commands;
mod config;
mod coupon;
mod diff;
mod doc;
mod events;
mod explain;
mod fmt;
mod git;
mod human;
mod interrupt;
mod junit;
mod lints;
mod lsp;
mod manners;
mod new;
mod progress;
mod released;
mod render;
mod sarif;
mod shells;
mod sources;
mod style;
mod test;
mod usage;
mod view;
mod watch;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;

/// Compliant mechanisms from text: optimised flexures, printable parts, motor code.
///
/// Exit codes: 0 fine; 1 the design has errors, a requirement fails, a file cannot be read or written, or a check finds
/// something to do; 2 wrong usage; 130 ended by Ctrl-C.
#[derive(Debug, Parser)]
#[command(name = "flexura", version, arg_required_else_help = true, max_term_width = 100, after_help = EXAMPLES)]
struct Cli {
    #[command(flatten)]
    manners: manners::Manners,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Read a design and say what is wrong with it
    ///
    /// With a current lock beside the design, its solution is looked at too. Findings are silenced where they are
    /// known: `allow CODE "reason"` in the text, a flexura.toml, the flags below. `flexura explain CODE` tells of each.
    #[command(
        after_help = "Examples:\n  flexura check leg.mech\n  flexura check leg.mech --watch\n  flexura check leg.mech --format json"
    )]
    Check(check::Check),
    /// Solve a design and write its parts and sketches
    ///
    /// The solved values go into NAME.lock beside the source; with --set or --steps it goes into the
    /// output folder, so that trying things out leaves the design's own lock alone. Ctrl-C ends the
    /// optimisation and keeps the best point found; a second one ends the program at once.
    #[command(
        after_help = "Examples:\n  flexura build leg.mech --out made\n  flexura build leg.mech --set \"r=25 mm\"\n  flexura build leg.mech --frozen      for CI: refuses to solve, the lock must be current\n  flexura build leg.mech --resume --iterations 300"
    )]
    Build(Build),
    /// Write the motion over the cycle as CSV
    ///
    /// Shows the lock's values if it belongs to the design, else the design's start. One row a state:
    /// drive values (deg), traced points (mm), drive torques (N*mm), elastic energy (N*mm) and the largest
    /// von Mises stress (MPa). With --format json the same table is one object: columns, rows, diagnostics.
    #[command(
        after_help = "Examples:\n  flexura simulate leg.mech -o motion.csv\n  flexura simulate leg.mech --rigid\n  flexura simulate leg.mech --poses --format json"
    )]
    Simulate(Simulate),
    /// Print the elaborated design as JSON
    #[command(after_help = "Examples:\n  flexura ir leg.mech > leg.json")]
    Ir(Common),
    /// Check the `require` lines of many designs
    Test(test::Test),
    /// Give `.mech` files their one look
    ///
    /// Line breaks stay the author's; indentation, spaces and columns become the formatter's. Comments and tokens are
    /// kept, which is verified before anything is written. Statements with errors are left as they are.
    Fmt(fmt::Fmt),
    /// Write a design to begin with
    New(new::New),
    /// Show the standard library, or a file of your own, by its doc comments
    Doc(doc::Doc),
    /// Compare two versions of a design: names, numbers, behaviour
    Diff(diff::Diff),
    /// Tell what a finding means, why it matters and what to do
    Explain(explain::Explain),
    /// Print completions for a shell
    Completions(shells::Completions),
    /// Print the manual pages
    Man(shells::Man),
    /// Find out how stiff a material really is: a test piece to print, and what its readings give
    #[command(
        after_help = "Examples:\n  flexura coupon pla\n  flexura coupon pla --measured coupon/measured.csv\n  flexura coupon pa12_mjf --on mjf"
    )]
    Coupon(coupon::Arguments),
    /// Speak with an editor: the language server, on the standard input and output
    Lsp(lsp::Lsp),
    /// Show a design as it is written: its report in a browser, renewed with every save
    View(view::View),
}

const EXAMPLES: &str = "Examples:
  flexura check leg.mech                   what is wrong with a design
  flexura build leg.mech                   solve it, write parts and sketches into out/
  flexura build leg.mech --set \"r=25 mm\"  try another size
  flexura build leg.mech --watch           again after every change
  flexura view leg.mech                    see it move while you write, with sliders
  flexura simulate leg.mech -o motion.csv  the motion as a table
  flexura fmt                              one look for all files

Defaults of a project stand in flexura.toml, beside the design or above it in its repository:
  [build]
  out = \"made\"
  iterations = 300";

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
    /// Do it again whenever the design, what it imports or flexura.toml changes; Ctrl-C ends
    #[arg(long)]
    watch: bool,
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
    #[command(flatten)]
    lints: lints::LintFlags,
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
    /// Tell an editor what goes on: lines of JSON on the standard error
    #[arg(long, hide = true)]
    events: bool,
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
    /// Under the load case of this name
    #[arg(long, value_name = "NAME", value_parser = word)]
    case: Option<String>,
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
    // Outermost first: what was given counts more than what is configured, and that more than what is built in.
    let matches = match Cli::command().try_get_matches() {
        Ok(matches) => matches,
        Err(e) => return usage::answer(&e),
    };
    let cli = match Cli::from_arg_matches(&matches) {
        Ok(cli) => cli,
        Err(e) => return usage::answer(&e),
    };
    cli.manners.choose();
    let watching = cli.command.common().is_some_and(|c| c.watch);
    let once = || {
        let began = std::time::Instant::now();
        let code = match Cli::from_arg_matches(&matches) {
            Ok(cli) => configured(cli, &matches),
            Err(_) => commands::FAILED,
        };
        if cli.manners.verbose {
            for (path, _) in sources::seen() {
                render::tell(&format!("read {}\n", path.display()));
            }
            render::tell(&format!("took {:.3} s\n", began.elapsed().as_secs_f64()));
        }
        code
    };
    ExitCode::from(if watching { watch::watch(once) } else { once() })
}

/// One run, with the configuration as it is now.
fn configured(mut cli: Cli, matches: &clap::ArgMatches) -> u8 {
    if let Err((found, sources)) = config::apply(&mut cli, matches) {
        let format = cli.command.common().map_or(Format::Human, |c| c.format);
        render::report(&found, &sources, format);
        return commands::FAILED;
    }
    let threads = match &cli.command {
        Command::Check(check) => check.common.threads,
        Command::Explain(_) => None,
        Command::Ir(common) => common.threads,
        Command::Build(build) => build.common.threads,
        Command::Simulate(simulate) => simulate.common.threads,
        Command::Test(test) => test.threads,
        Command::Diff(diff) => diff.threads,
        _ => None,
    };
    if let Command::Simulate(Simulate { common, .. }) | Command::Ir(common) = &cli.command {
        sarif::refuse(common.format);
    }
    let run = || match &cli.command {
        Command::Check(arguments) => check::check(arguments),
        Command::Build(arguments) => commands::build(arguments),
        Command::Simulate(arguments) => commands::simulate(arguments),
        Command::Ir(common) => commands::ir(common),
        Command::Test(arguments) => test::run(arguments),
        Command::Fmt(arguments) => fmt::fmt(arguments),
        Command::New(arguments) => new::run(arguments),
        Command::Coupon(arguments) => coupon::run(arguments),
        Command::Doc(arguments) => doc::run(arguments),
        Command::Diff(arguments) => diff::run(arguments),
        Command::Explain(arguments) => explain::explain(arguments),
        Command::Completions(arguments) => shells::completions(arguments),
        Command::Man(arguments) => shells::man(arguments),
        Command::Lsp(arguments) => lsp::lsp(arguments),
        Command::View(arguments) => view::view(arguments),
    };
    match threads {
        None => run(),
        Some(n) => match rayon::ThreadPoolBuilder::new().num_threads(usize::from(n)).build() {
            Ok(pool) => pool.install(run),
            Err(e) => {
                let message = format!("cannot start {n} threads: {e}");
                render::refuse("E0754", message, Format::Human)
            }
        },
    }
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
