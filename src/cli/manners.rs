//! How the command behaves whatever it does: colour, and how much it says. Set once, before anything else.

use clap::{Args, ValueEnum};
use std::sync::OnceLock;

/// Options of every command.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct Manners {
    /// When to colour; `auto`: on a terminal, unless NO_COLOR or CLICOLOR=0 is set (CLICOLOR_FORCE=1: always)
    #[arg(long, value_enum, global = true, value_name = "WHEN", default_value_t = Colour::Auto, help_heading = "Manners")]
    pub color: Colour,
    /// Say nothing but errors
    #[arg(long, short, global = true, conflicts_with = "verbose", help_heading = "Manners")]
    pub quiet: bool,
    /// Say more: which files were read, and how long it took
    #[arg(long, short, global = true, help_heading = "Manners")]
    pub verbose: bool,
}

/// When to colour.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Colour {
    /// On a terminal
    #[default]
    Auto,
    /// Into files and pipes too
    Always,
    /// Not even on a terminal
    Never,
}

static CHOSEN: OnceLock<Manners> = OnceLock::new();

impl Manners {
    /// Makes these count for the whole run.
    pub fn choose(self) {
        let _ = CHOSEN.set(self);
    }

    /// Those of this run.
    pub fn chosen() -> Self {
        CHOSEN.get().copied().unwrap_or_default()
    }
}

impl Colour {
    /// Whether to colour a stream, by the variables of the environment (`get`) and whether it is a terminal.
    pub fn wanted(self, get: impl Fn(&str) -> Option<String>, terminal: bool) -> bool {
        let set = |name: &str| get(name).filter(|v| !v.is_empty());
        match self {
            Colour::Always => true,
            Colour::Never => false,
            Colour::Auto if set("NO_COLOR").is_some() => false,
            Colour::Auto if set("CLICOLOR_FORCE").is_some_and(|v| v != "0") => true,
            Colour::Auto if set("CLICOLOR").is_some_and(|v| v == "0") => false,
            Colour::Auto => terminal && get("TERM").is_none_or(|t| t != "dumb"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flag_counts_more_than_the_environment_and_that_more_than_the_terminal() {
        let env = |list: &'static [(&str, &str)]| {
            move |name: &str| list.iter().find(|(n, _)| *n == name).map(|(_, v)| (*v).to_string())
        };
        for (colour, variables, terminal, wanted) in [
            (Colour::Auto, &[][..], true, true),
            (Colour::Auto, &[], false, false),
            (Colour::Auto, &[("NO_COLOR", "1")], true, false),
            (Colour::Auto, &[("NO_COLOR", "")], true, true),
            (Colour::Auto, &[("CLICOLOR", "0")], true, false),
            (Colour::Auto, &[("CLICOLOR", "1")], false, false),
            (Colour::Auto, &[("CLICOLOR_FORCE", "1")], false, true),
            (Colour::Auto, &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], true, false),
            (Colour::Auto, &[("TERM", "dumb")], true, false),
            (Colour::Always, &[("NO_COLOR", "1")], false, true),
            (Colour::Never, &[("CLICOLOR_FORCE", "1")], true, false),
        ] {
            assert_eq!(
                colour.wanted(env(variables), terminal),
                wanted,
                "{colour:?} {variables:?} {terminal}"
            );
        }
    }
}
