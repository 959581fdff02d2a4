//! `flexura view`: the report of a design on this machine's own address, renewed with every save, with the optimiser's
//! progress and sliders for the parameters.

mod engine;
mod files;
mod guard;
mod saves;
mod server;
mod stages;
mod state;

use super::commands::{FAILED, FINE, print};
use super::lints::LintFlags;
use super::manners::Manners;
use super::render::{refuse, tell};
use super::{Common, Format, Optimizer, interrupt, word};
use clap::Args;
use engine::{Asked, Engine};
use flexura::pipeline::Compiler;
use server::Service;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arguments of `view`.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  flexura view leg.mech\n  flexura view leg.mech --port 8080 --open\n\nThe page is for this machine alone. Of your files only the lock is written, as `build` does; what sliders try out is\nkept in memory. Ctrl-C ends it."
)]
pub struct View {
    /// The design, a `.mech` file
    source: PathBuf,
    /// The port on 127.0.0.1 [default: any that is free]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Open the page in the browser
    #[arg(long)]
    open: bool,
    /// The variant of this name, in place of the design as it stands
    #[arg(long, value_name = "NAME", value_parser = word)]
    variant: Option<String>,
    /// Iterations of the optimiser at most
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    iterations: u32,
    /// By the configuration only, as the next.
    #[arg(skip = Optimizer::Lm)]
    optimizer: Optimizer,
    #[arg(skip)]
    threads: Option<u16>,
    #[command(flatten)]
    lints: LintFlags,
}

impl View {
    /// The design.
    pub fn source(&self) -> &Path {
        &self.source
    }

    /// Takes what the configuration says and the command line does not.
    pub fn configure(&mut self, iterations: Option<u32>, optimizer: Option<Optimizer>, threads: Option<u16>) {
        self.iterations = iterations.unwrap_or(self.iterations);
        self.optimizer = optimizer.unwrap_or(self.optimizer);
        self.threads = threads;
    }
}

/// Runs `view`.
pub fn view(arguments: &View) -> u8 {
    let common = Common {
        source: arguments.source.clone(),
        overrides: Vec::new(),
        steps: None,
        variant: arguments.variant.clone(),
        threads: None,
        watch: false,
        format: Format::Human,
    };
    if let Err(why) = super::commands::open(&common) {
        return super::commands::unreadable(&common, &why);
    }
    if let Some(n) = arguments.threads {
        // What the view computes runs in threads of its own: they share the process's pool.
        if let Err(why) = rayon::ThreadPoolBuilder::new().num_threads(usize::from(n)).build_global() {
            return refuse("E0754", format!("cannot start {n} threads: {why}"), Format::Human);
        }
    }
    let source = engine::source_of(&common);
    let compiler = Compiler { method: arguments.optimizer.into(), iterations: arguments.iterations as usize };
    let engine = Arc::new(Engine::new(Asked { common, lints: arguments.lints.clone(), compiler }));
    let service = match Service::new(Arc::clone(&engine), arguments.port) {
        Ok(service) => service,
        Err(why) => return refuse("E0756", why, Format::Human),
    };
    let address = service.address();
    let quiet = Manners::chosen().quiet;
    interrupt::during(move || {
        if !quiet {
            tell("ending: the best point of a running optimisation is kept (Ctrl-C again ends at once)\n");
        }
    });
    std::thread::spawn(move || service.run());
    let follower = {
        let engine = Arc::clone(&engine);
        std::thread::spawn(move || engine.follow())
    };
    {
        let engine = Arc::clone(&engine);
        std::thread::spawn(move || engine.make_solids());
    }
    if print(&format!("{address}\n")) != FINE {
        return FAILED;
    }
    if !quiet {
        tell(&format!("showing {}; Ctrl-C ends\n", arguments.source.display()));
    }
    if arguments.open {
        open(&address);
    }
    saves::watch(&engine, &source);
    engine.end();
    if follower.join().is_err() {
        return FAILED;
    }
    FINE
}

/// Asks the system to show the page.
fn open(address: &str) {
    let (program, before): (&str, &[&str]) = match std::env::consts::OS {
        "windows" => ("cmd", &["/c", "start", ""]),
        "macos" => ("open", &[]),
        _ => ("xdg-open", &[]),
    };
    let mut command = std::process::Command::new(program);
    let silent = std::process::Stdio::null;
    command.args(before).arg(address).stdin(silent()).stdout(silent()).stderr(silent());
    if let Err(e) = command.spawn() {
        tell(&format!("the browser cannot be opened ({e}): open {address} yourself\n"));
    }
}
