//! `flexura completions` and `flexura man`: made from the arguments themselves, so that they are never out of date.

use super::artefacts::write_below;
use super::commands::{FAILED, FINE, print};
use super::{Cli, render};
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use flexura::diagnostic::{Severity, SourceMap};
use flexura::pipeline::placeless;
use std::path::PathBuf;

/// What `flexura completions` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  flexura completions bash > ~/.local/share/bash-completion/completions/flexura
  flexura completions zsh  > ~/.zfunc/_flexura
  flexura completions fish > ~/.config/fish/completions/flexura.fish")]
pub struct Completions {
    /// For which shell
    #[arg(value_enum)]
    shell: Shell,
}

/// What `flexura man` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  flexura man | man -l -           read it now
  flexura man --out ~/.local/share/man/man1")]
pub struct Man {
    /// Write one page a command into this folder, in place of the main page to the standard output
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
}

/// `flexura completions`.
pub fn completions(arguments: &Completions) -> u8 {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command(), "flexura", &mut text);
    print(&String::from_utf8_lossy(&text))
}

/// `flexura man`.
pub fn man(arguments: &Man) -> u8 {
    let mut command = Cli::command();
    command.build();
    let Some(folder) = &arguments.out else {
        return page(&command).map_or(FAILED, |(_, text)| print(&String::from_utf8_lossy(&text)));
    };
    let commands = std::iter::once(&command).chain(command.get_subcommands());
    for (name, text) in commands.filter(|c| c.get_name() != "help").filter_map(page) {
        if let Err(e) = write_below(folder, &name, &text) {
            render::show(&[placeless(Severity::Error, "E0731", e.to_string())], &SourceMap::default());
            return FAILED;
        }
    }
    FINE
}

/// File name and text of a command's page.
fn page(command: &clap::Command) -> Option<(String, Vec<u8>)> {
    // What the shell is given: `flexura build`; what the page is called: `flexura-build`.
    let name = command.get_bin_name().unwrap_or("flexura").replace(' ', "-");
    let man = clap_mangen::Man::new(command.clone());
    let mut text = Vec::new();
    man.render(&mut text).ok()?;
    Some((format!("{name}.1"), text))
}
