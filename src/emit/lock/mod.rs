//! The lock file: the solved design as text, readable, mergeable, exact to the bit.
//!
//! ```text
//! # flexura lock 1
//! design sha256:…         key: digest of the elaborated design
//! solver 3                a solver that would find another optimum counts as another design
//! values sha256:…         digest of the entries: notices an edit or a bad merge
//! iterations 23
//! converged true
//! history 0 1 2 23        which iterations are told of (16 at most)
//! term track(tip) 12.3 1.45 0.8 0.021   and what a term of the objective was there
//!
//! heel.thickness = 0.8 mm
//! ```

use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Design, Fittings, LoadKind, ObjectiveKind, Solution};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write;

mod history;
mod several;
pub use history::History;
pub use several::Head;

/// Raised whenever the solver would find something else for the same design.
pub const SOLVER_VERSION: &str = "8";
const TITLE: &str = "# flexura lock 1";

/// How a damaged lock is mended; said with every error of this file.
const MEND: &str = "build with `--fresh`, or delete the lock, to solve the design again";

/// The content of a lock file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lock {
    /// Digest of the design it was solved for, `sha256:…` (see [`design_digest`]).
    pub design: String,
    /// Version of the solver that solved it.
    pub solver: String,
    /// Values by path, and how the run ended.
    pub solution: Solution,
    /// Unit of every value, by path (`1` where there is none).
    pub units: BTreeMap<String, String>,
    /// Whether the values are the ones that were written (false: edited since).
    pub intact: bool,
    /// How the optimiser came to the values, where that was kept. Nothing depends on it.
    pub history: History,
    /// Headings by name where the lock is of several designs.
    pub named: BTreeMap<String, Head>,
}

/// What a lock is worth for a design.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LockState {
    /// Solved for exactly this design: nothing to do.
    Current,
    /// Solved for another state of the design, or by another solver: a start.
    Stale,
    /// Of this design, but its values were changed by hand or a merge: a start.
    Edited,
}

impl Lock {
    /// The lock of a design and its solution.
    pub fn new(design: &Design, solution: Solution) -> Self {
        let units = design.free.iter().map(|v| (v.path.clone(), v.unit.clone())).collect();
        let (design, solver) = (design_digest(design), SOLVER_VERSION.into());
        Self { design, solver, solution, units, intact: true, ..Self::default() }
    }

    /// What this lock is worth for a design.
    pub fn state(&self, design: &Design) -> LockState {
        if self.design != design_digest(design) || self.solver != SOLVER_VERSION {
            return LockState::Stale;
        }
        let complete = self.solution.values.len() == design.free.len()
            && design.free.iter().all(|v| self.value(&v.path, &v.unit).is_some());
        if complete && self.intact { LockState::Current } else { LockState::Edited }
    }

    /// Values of the design's free variables in its order: the lock's where path and unit agree, kept within
    /// the present bounds, else the variable's own start.
    pub fn start_values(&self, design: &Design) -> Vec<f64> {
        let start = |v: &crate::ir::FreeVariable| match self.value(&v.path, &v.unit) {
            Some(value) => value.max(v.lower).min(v.upper),
            None => v.start,
        };
        design.free.iter().map(start).collect()
    }

    fn value(&self, path: &str, unit: &str) -> Option<f64> {
        let same_unit = self.units.get(path).is_some_and(|u| u == unit);
        self.solution.values.get(path).copied().filter(|_| same_unit)
    }

    /// The file's text.
    pub fn write(&self) -> String {
        let entries = self.entries();
        let line =
            |key: &str, alone: &str, of: fn(&Head) -> String| several::lines(&self.named, key, alone, of);
        let (iterations, converged) =
            (self.solution.iterations.to_string(), self.solution.converged.to_string());
        format!(
            "{TITLE}\n# The solved design. Keep it beside its source; `flexura build` reads and writes it.\n\
             {}solver {}\nvalues {}\n{}{}{}\n{entries}",
            line("design", &self.design, |h| h.design.clone()),
            self.solver,
            digest(entries.as_bytes()),
            line("iterations", &iterations, |h| h.iterations.to_string()),
            line("converged", &converged, |h| h.converged.to_string()),
            history::lines(self),
        )
    }

    fn entries(&self) -> String {
        let mut out = String::new();
        for (path, value) in &self.solution.values {
            let _ = write!(out, "{path} = {value:?}");
            match self.units.get(path).map(String::as_str) {
                None | Some("1" | "") => out.push('\n'),
                Some(unit) => {
                    let _ = writeln!(out, " {unit}");
                }
            }
        }
        out
    }

    /// Reads a lock file; `file` is its index in the source map.
    ///
    /// # Errors
    /// One diagnostic a line that cannot be understood.
    pub fn parse(text: &str, file: u32) -> Result<Self, Vec<Diagnostic>> {
        Parser { text, file, lock: Lock::default(), seen: BTreeMap::new(), found: Vec::new() }.run()
    }
}

/// Digest of all of a design that can change what is solved: not of comments, places, exports,
/// requirements or the printer. Stable under the order in which fields are declared.
pub fn design_digest(design: &Design) -> String {
    let mut design = design.clone();
    // Motors, plates and holes change the form of links; only weight and what keeps links apart ask for that.
    let apart = design.all_objectives().any(|o| matches!(o.kind, ObjectiveKind::Collision { .. }));
    let weighed = design.all_loads().any(|l| matches!(l.kind, LoadKind::Gravity { .. }));
    if !weighed {
        for body in &mut design.bodies {
            // What keeps links apart sees primitives only.
            body.fittings.solids.clear();
            if !apart {
                body.fittings = Fittings::default();
                body.holes.clear();
            }
        }
    }
    // Nor do the places of what is left out count.
    design.drop_unused();
    let mut value = match serde_json::to_value(&design) {
        Ok(value) => value,
        // Plain data of numbers, strings and lists always serialises; this key matches no lock.
        Err(e) => Value::String(e.to_string()),
    };
    if let Value::Object(fields) = &mut value {
        fields.remove("exports");
        // Where fillets begin follows the rod, not the other way round.
        for rod in fields.get_mut("rods").and_then(Value::as_array_mut).into_iter().flatten() {
            if let Value::Object(rod) = rod {
                rod.remove("fillet_mm");
            }
        }
        fields.remove("requirements");
        for case in fields.get_mut("cases").and_then(Value::as_array_mut).into_iter().flatten() {
            if let Value::Object(case) = case {
                case.remove("requirements");
            }
        }
        for drive in fields.get_mut("drives").and_then(Value::as_array_mut).into_iter().flatten() {
            if let Some(Value::Object(motor)) = drive.get_mut("motor") {
                motor.remove("motion");
            }
        }
        if let Some(Value::Object(process)) = fields.get_mut("process") {
            process.remove("machine");
        }
        // Angles are only looked at.
        if let Some(Value::Object(aims)) = fields.get_mut("aims") {
            aims.remove("angles");
            aims.remove("workspaces");
            if aims.is_empty() {
                fields.remove("aims");
            }
        }
    }
    let mut canonical = format!("flexura design, solver {SOLVER_VERSION}\n");
    write_canonical(&value, &mut canonical);
    digest(canonical.as_bytes())
}

/// JSON with sorted keys and without places in the text.
fn write_canonical(value: &Value, out: &mut String) {
    match value {
        Value::Object(fields) => {
            let sorted: BTreeMap<_, _> =
                fields.iter().filter(|(key, _)| !matches!(key.as_str(), "origin" | "origins")).collect();
            out.push('{');
            for (key, value) in sorted {
                let _ = write!(out, "{key:?}:");
                write_canonical(value, out);
                out.push(',');
            }
            out.push('}');
        }
        Value::Array(items) => {
            out.push('[');
            for item in items {
                write_canonical(item, out);
                out.push(',');
            }
            out.push(']');
        }
        plain => {
            let _ = write!(out, "{plain}");
        }
    }
}

/// `sha256:…` of some bytes.
pub fn digest(bytes: &[u8]) -> String {
    let mut out = String::from("sha256:");
    for byte in Sha256::digest(bytes) {
        let _ = write!(out, "{byte:02x}");
    }
    out
}

struct Parser<'a> {
    text: &'a str,
    file: u32,
    lock: Lock,
    /// Place of every header key and path met so far.
    seen: BTreeMap<String, Origin>,
    found: Vec<Diagnostic>,
}

impl Parser<'_> {
    fn run(mut self) -> Result<Lock, Vec<Diagnostic>> {
        let mut start = 0;
        let mut written_digest = None;
        for (number, raw) in self.text.split_inclusive('\n').enumerate() {
            let line = raw.trim_end_matches(['\n', '\r']);
            let at = self.place(start, line.len());
            start += raw.len();
            if number == 0 && line != TITLE {
                self.found.push(title_error(line, at));
                break;
            }
            if ["<<<<<<<", "=======", ">>>>>>>", "|||||||"].iter().any(|mark| line.starts_with(mark)) {
                self.fail("E0702", "the lock holds both sides of a merge that was not resolved", at);
                break;
            }
            if line.trim().is_empty() || line.starts_with('#') {
                continue;
            }
            if line.contains('=') { self.entry(line, at) } else { self.header(line, at, &mut written_digest) }
        }
        if self.text.is_empty() {
            self.found.push(title_error("", self.place(0, 0)));
        }
        if self.found.is_empty() {
            self.complete();
        }
        self.lock.intact = written_digest.is_some_and(|d| d == digest(self.lock.entries().as_bytes()));
        if self.found.is_empty() { Ok(self.lock) } else { Err(self.found) }
    }

    fn place(&self, start: usize, len: usize) -> Origin {
        let clamp = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        Origin { file: self.file, start: clamp(start), end: clamp(start + len) }
    }

    fn fail(&mut self, code: &str, message: impl Into<String>, at: Origin) {
        self.found.push(Diagnostic::error(code, message, at).help(MEND));
    }

    /// Notes a key; a second one is an error.
    fn once(&mut self, key: &str, at: Origin) {
        if let Some(first) = self.seen.get(key).copied() {
            let message = format!("`{key}` stands in the lock twice");
            self.found.push(Diagnostic::error("E0704", message, at).also(first, "first here").help(MEND));
        } else {
            self.seen.insert(key.into(), at);
        }
    }

    fn header(&mut self, line: &str, at: Origin, written_digest: &mut Option<String>) {
        let (key, value) = line.split_once(' ').unwrap_or((line, ""));
        let value = value.trim();
        if matches!(key, "history" | "term") {
            return self.told(key, value, at);
        }
        if let ("design" | "iterations" | "converged", Some((name, value))) = (key, value.split_once(' ')) {
            return self.named(key, name, value, at);
        }
        self.once(key, at);
        match key {
            "design" | "values" if !is_digest(value) => {
                self.fail(
                    "E0703",
                    format!("`{key}` needs a digest, `sha256:` and 64 hexadecimal digits"),
                    at,
                );
            }
            "design" => self.lock.design = value.into(),
            "values" => *written_digest = Some(value.into()),
            "solver" => self.lock.solver = value.into(),
            "iterations" => match value.parse() {
                Ok(n) => self.lock.solution.iterations = n,
                Err(_) => self.fail("E0703", "`iterations` needs a whole number", at),
            },
            "converged" => match value.parse() {
                Ok(yes) => self.lock.solution.converged = yes,
                Err(_) => self.fail("E0703", "`converged` needs `true` or `false`", at),
            },
            _ => self.fail("E0703", "this line is neither `path = value unit` nor a known heading", at),
        }
    }

    /// A line of the history. It names its design where there are several.
    fn told(&mut self, key: &str, value: &str, at: Origin) {
        let line = history::Line::read(key, value);
        let Some(line) = line.filter(|l| history::keep(&mut self.lock, l)) else {
            return self.fail("E0703", format!("`{key}` has a value that cannot be read"), at);
        };
        self.once(&format!("{key} {} {}", line.design, line.term), at);
    }

    /// A heading of one of several designs.
    fn named(&mut self, key: &str, name: &str, value: &str, at: Origin) {
        self.once(&format!("{key} {name}"), at);
        let head = self.lock.named.entry(name.into()).or_default();
        let read = match key {
            "design" => {
                head.design = value.into();
                is_digest(value)
            }
            "iterations" => value.parse().map(|n| head.iterations = n).is_ok(),
            _ => value.parse().map(|yes| head.converged = yes).is_ok(),
        };
        if !read {
            self.fail("E0703", format!("`{key} {name}` has a value that cannot be read"), at);
        }
    }

    fn entry(&mut self, line: &str, at: Origin) {
        let (path, rest) = line.split_once('=').unwrap_or((line, ""));
        let path = path.trim();
        let mut words = rest.split_whitespace();
        let number = words.next().and_then(|w| w.parse::<f64>().ok()).filter(|v| v.is_finite());
        let unit = words.next().unwrap_or("1");
        if path.is_empty() || path.contains(char::is_whitespace) || words.next().is_some() {
            return self.fail("E0703", "an entry is written `path = value unit`", at);
        }
        let Some(number) = number else {
            return self.fail("E0703", format!("`{path}` needs a finite number"), at);
        };
        self.once(path, at);
        self.lock.solution.values.insert(path.into(), number);
        self.lock.units.insert(path.into(), unit.into());
    }

    fn complete(&mut self) {
        let end = self.place(self.text.len(), 0);
        for key in ["design", "solver", "values", "iterations", "converged"] {
            let of_designs = |name: &String| self.seen.contains_key(&format!("{key} {name}"));
            let named = matches!(key, "design" | "iterations" | "converged") && !self.lock.named.is_empty();
            let stated =
                if named { self.lock.named.keys().all(of_designs) } else { self.seen.contains_key(key) };
            if !stated {
                self.fail("E0705", format!("the lock has no `{key}` line: it is incomplete"), end);
            }
        }
    }
}

fn title_error(line: &str, at: Origin) -> Diagnostic {
    let message = if line.starts_with("# flexura lock ") {
        "this lock was written by another version of flexura"
    } else {
        "this is not a flexura lock: its first line should be `# flexura lock 1`"
    };
    Diagnostic::error("E0701", message, at).help(MEND)
}

fn is_digest(text: &str) -> bool {
    text.strip_prefix("sha256:")
        .is_some_and(|hex| hex.len() == 64 && hex.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')))
}

#[cfg(test)]
mod tests;
