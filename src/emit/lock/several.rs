//! The lock of several designs: one file, the name of the design before each path and after each heading.

use super::Lock;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Heading of one of several designs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Head {
    /// Digest of the design.
    pub design: String,
    /// Iterations of its run.
    pub iterations: usize,
    /// Whether it converged.
    pub converged: bool,
    /// How it went.
    pub history: super::History,
}

impl Lock {
    /// One lock of several designs, each with its name.
    pub fn join(locks: impl IntoIterator<Item = (String, Lock)>) -> Self {
        let mut out = Self { solver: super::SOLVER_VERSION.into(), intact: true, ..Self::default() };
        out.solution.converged = true;
        for (name, lock) in locks {
            let s = &lock.solution;
            out.solution.iterations += s.iterations;
            out.solution.converged &= s.converged;
            out.solution.values.extend(s.values.iter().map(|(path, v)| (format!("{name}.{path}"), *v)));
            out.units.extend(lock.units.iter().map(|(path, u)| (format!("{name}.{path}"), u.clone())));
            let head = Head {
                design: lock.design,
                iterations: s.iterations,
                converged: s.converged,
                history: lock.history,
            };
            out.named.insert(name, head);
        }
        out
    }

    /// The part of one of several designs; without a digest if it has none.
    pub fn part(&self, name: &str) -> Self {
        let head = self.named.get(name).cloned().unwrap_or_default();
        let inside = |path: &String| Some(path.strip_prefix(name)?.strip_prefix('.')?.to_string());
        let mut out = Self {
            design: head.design,
            solver: self.solver.clone(),
            units: self.units.iter().filter_map(|(p, u)| Some((inside(p)?, u.clone()))).collect(),
            intact: self.intact,
            ..Self::default()
        };
        out.solution.values =
            self.solution.values.iter().filter_map(|(p, v)| Some((inside(p)?, *v))).collect();
        out.solution.iterations = head.iterations;
        out.solution.converged = head.converged;
        out.history = head.history;
        out
    }
}

/// Lines of a heading: one, or one a design.
pub(super) fn lines(
    named: &BTreeMap<String, Head>,
    key: &str,
    alone: &str,
    of: impl Fn(&Head) -> String,
) -> String {
    if named.is_empty() {
        return format!("{key} {alone}\n");
    }
    named.iter().fold(String::new(), |mut out, (name, head)| {
        let _ = writeln!(out, "{key} {name} {}", of(head));
        out
    })
}
