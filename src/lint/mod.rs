//! Lints: what compiles, but a real part may suffer from. One file a rule in `rules/`, whose doc comment is its page
//! in `flexura explain`; a rule reads one stage and changes nothing.
//!
//! | file | holds |
//! | --- | --- |
//! | `rules/` | the rules, and the table of them |
//! | `views`, `walk`, `dyads`, `shapes` | what rules look at: texts, designs, motions, flexures, solutions |
//! | `levels`, `config`, `baseline` | which findings are told and how loudly |
//! | `explain` | pages and the list of all codes |

pub mod baseline;
pub mod config;
mod dyads;
pub mod explain;
pub mod levels;
mod rules;
mod shapes;
mod strain;
mod views;
mod walk;

use crate::diagnostic::{Diagnostic, Origin, Severity};
pub use levels::{Level, Levels, Selector};
pub use rules::RULES;
pub use shapes::{Flexure, flexures as flexure_shapes};
pub use views::{OfDesign, OfFlexures, OfMotion, OfParts, OfSolution, Part, Text};

/// How far a design has come. A rule of one stage can be asked once that is reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// The texts are understood.
    #[default]
    Text,
    /// They make a design.
    Design,
    /// Its conventional mechanism moves.
    Motion,
    /// Its flexures have a shape at the start.
    Flexures,
    /// It is solved and simulated.
    Solution,
    /// Its parts are made.
    Parts,
}

impl Stage {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Text => "the text",
            Self::Design => "the design",
            Self::Motion => "the motion of the ordinary mechanism",
            Self::Flexures => "the flexures at the start",
            Self::Solution => "the solution",
            Self::Parts => "the printed parts",
        }
    }
}

/// One rule: where it looks, and what it finds there.
pub struct Rule {
    /// Stable code, `W1000` to `W1999`.
    pub code: &'static str,
    /// Stable name, in words joined by `-`.
    pub name: &'static str,
    /// How its findings are told where nothing else is asked for.
    pub severity: Severity,
    /// The function, by the stage it needs.
    pub check: Check,
}

/// A rule's function.
pub enum Check {
    /// From the texts alone.
    Text(fn(&Text) -> Vec<Diagnostic>),
    /// From an elaborated design.
    Design(fn(&OfDesign) -> Vec<Diagnostic>),
    /// From the conventional motion.
    Motion(fn(&OfMotion) -> Vec<Diagnostic>),
    /// From the flexures' shapes at the start.
    Flexures(fn(&OfFlexures) -> Vec<Diagnostic>),
    /// From the simulated solution.
    Solution(fn(&OfSolution) -> Vec<Diagnostic>),
    /// From the printed parts.
    Parts(fn(&OfParts) -> Vec<Diagnostic>),
    /// Found where levels are applied: it is about other findings.
    Findings,
}

impl Rule {
    /// A finding of this rule.
    fn finds(&self, message: impl Into<String>, at: Origin) -> Diagnostic {
        match self.severity {
            Severity::Advice => Diagnostic::advice(self.code, message, at),
            _ => Diagnostic::warning(self.code, message, at),
        }
    }

    /// The stage it needs.
    pub fn stage(&self) -> Stage {
        match self.check {
            Check::Text(_) | Check::Findings => Stage::Text,
            Check::Design(_) => Stage::Design,
            Check::Motion(_) => Stage::Motion,
            Check::Flexures(_) => Stage::Flexures,
            Check::Solution(_) => Stage::Solution,
            Check::Parts(_) => Stage::Parts,
        }
    }
}

/// A rule with the text of its file.
pub struct Entry {
    /// The rule.
    pub rule: &'static Rule,
    /// The text of its file, whose head is its page.
    source: &'static str,
}

impl Entry {
    /// The page: the doc comment at the head of the rule's file.
    pub fn page(&self) -> String {
        let head = self.source.lines().map_while(|l| l.strip_prefix("//!"));
        let lines: Vec<&str> = head.map(|l| l.strip_prefix(' ').unwrap_or(l).trim_end()).collect();
        lines.join("\n")
    }
}

/// The rule with this code or name.
pub fn find(word: &str) -> Option<&'static Entry> {
    RULES.iter().find(|e| e.rule.code == word || e.rule.name == word)
}

/// Findings of all rules that need nothing but the texts.
pub fn text(view: &Text) -> Vec<Diagnostic> {
    gather(|check| if let Check::Text(f) = check { f(view) } else { Vec::new() })
}

/// Findings of all rules that need a design and nothing more.
pub fn design(view: &OfDesign) -> Vec<Diagnostic> {
    gather(|check| if let Check::Design(f) = check { f(view) } else { Vec::new() })
}

/// Findings of all rules that need the conventional motion.
pub fn motion(view: &OfMotion) -> Vec<Diagnostic> {
    gather(|check| if let Check::Motion(f) = check { f(view) } else { Vec::new() })
}

/// Findings of all rules that need the flexures' shapes.
pub fn flexures(view: &OfFlexures) -> Vec<Diagnostic> {
    gather(|check| if let Check::Flexures(f) = check { f(view) } else { Vec::new() })
}

/// Findings of all rules that need a solution.
pub fn solution(view: &OfSolution) -> Vec<Diagnostic> {
    gather(|check| if let Check::Solution(f) = check { f(view) } else { Vec::new() })
}

/// Findings of all rules that need the parts.
pub fn parts(view: &OfParts) -> Vec<Diagnostic> {
    gather(|check| if let Check::Parts(f) = check { f(view) } else { Vec::new() })
}

fn gather(run: impl Fn(&Check) -> Vec<Diagnostic>) -> Vec<Diagnostic> {
    RULES.iter().flat_map(|e| run(&e.rule.check)).collect()
}

/// What every rule's file begins with.
mod prelude {
    pub use super::views::{Block, OfDesign, OfFlexures, OfMotion, OfParts, OfSolution, Text};
    pub(in crate::lint) use super::walk;
    pub use super::{Check, Rule};
    pub use crate::diagnostic::{Diagnostic, Edit, Fix, Origin, Severity};
    pub use crate::syntax::ast::{self, Ident, StatementKind};
}
