//! The optimised values written into the text: each `free` then starts where the optimiser ended, so that the text alone
//! holds the result. What stands in a flexure of the library, or in one text for several joints that were given different
//! values, stays in the lock.

use super::actions::Overlay;
use crate::elaborate::{Elaborated, Files, Options, elaborate, quantity};
use crate::emit::lock::{Lock, LockState};
use crate::ir::FreeVariable;
use crate::syntax::parse;
use crate::syntax::tree::{Kind, Node};
use std::collections::BTreeMap;
use std::ops::Range;

/// What can be written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Applied {
    /// Replacements of start values, by file.
    pub edits: BTreeMap<String, Vec<(Range<usize>, String)>>,
    /// Free values whose start is that value already.
    pub there: usize,
    /// Free values that the text has no place of their own for.
    pub elsewhere: usize,
}

impl Applied {
    /// How many start values change.
    pub fn count(&self) -> usize {
        self.edits.values().map(Vec::len).sum()
    }

    /// In words.
    pub fn told(&self) -> String {
        let mut told = match self.count() {
            1 => "1 start value written".to_string(),
            n => format!("{n} start values written"),
        };
        if self.there > 0 {
            told.push_str(&format!(", {} there already", self.there));
        }
        if self.elsewhere > 0 {
            let why = "flexures of the library, or one text for several joints";
            told.push_str(&format!(", {} stay in the lock ({why})", self.elsewhere));
        }
        told
    }
}

/// Largest distance of a written value from the optimised one, relative to it: five digits are written.
const ROUNDING: f64 = 1e-4;

/// The start values that a root file's lock knows better. Each is written and read again: one that would not come to the
/// optimised value (a placed mechanism scales it, say) is not written. `within` picks those that begin in a range of bytes of
/// the root file.
///
/// # Errors
/// Why there is nothing to write, and what to do.
pub fn optimised(
    root: &str,
    files: &dyn Files,
    lock: Option<&str>,
    within: Option<&Range<usize>>,
) -> Result<Applied, String> {
    let out = elaborate(root, files, &Options::default());
    let Some(assembly) = &out.assembly else { return Err("the design has errors: mend them first".into()) };
    let lock = lock.ok_or("there is no lock: build the design first")?;
    let lock = Lock::parse(lock, 0).map_err(|_| "the lock cannot be read: build the design again")?;
    let single = assembly.single().is_some();
    let mut wanted: BTreeMap<(u32, u32), Vec<(&FreeVariable, f64)>> = BTreeMap::new();
    for design in &assembly.designs {
        let part = if single { lock.clone() } else { lock.part(&design.name) };
        if part.state(design) != LockState::Current {
            return Err("the lock is of another state of the design: build it first".into());
        }
        for free in &design.free {
            let value = part.solution.values.get(&free.path).copied().unwrap_or(free.start);
            wanted.entry((free.origin.file, free.origin.start)).or_default().push((free, value));
        }
    }
    let mut applied = Applied::default();
    let mut trees: BTreeMap<u32, Node> = BTreeMap::new();
    for ((file, start), of) in wanted {
        let Some(source) = out.sources.files.get(file as usize) else { continue };
        if within.is_some_and(|w| file != 0 || !(w.start <= start as usize && start as usize <= w.end)) {
            continue;
        }
        let Some((free, value)) = of.first().copied() else { continue };
        let text = inside(value, free);
        let common = of.iter().all(|(f, v)| f.unit == free.unit && inside(*v, f) == text);
        if source.name.starts_with("std/") || !common {
            applied.elsewhere += of.len();
            continue;
        }
        if of.iter().all(|(f, _)| close(f.start, value)) {
            applied.there += of.len();
            continue;
        }
        let tree = trees.entry(file).or_insert_with(|| parse(file, &source.text).tree);
        let place = start_of(tree, start);
        let fits = place.filter(|at| comes_to(&out, root, files, &source.name, at, &text, &of));
        match fits {
            Some(at) => applied.edits.entry(source.name.clone()).or_default().push((at, text)),
            None => applied.elsewhere += of.len(),
        }
    }
    Ok(applied)
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * b.abs()
}

/// The value rounded as it is shown, towards the middle where rounding would leave the bounds.
fn inside(value: f64, free: &FreeVariable) -> String {
    let text = quantity(value, &free.unit);
    let size = 10_f64.powf(value.abs().max(f64::MIN_POSITIVE).log10().floor() - 4.0);
    let middle = 0.5 * (free.lower + free.upper);
    // Only where it rests on a bound: there a written bound reads back as itself, any other number is moved.
    let at = |bound: f64| (value - bound).abs() <= size && quantity(bound, &free.unit) != text;
    if at(free.lower) || at(free.upper) {
        return quantity(value + size * (middle - value).signum(), &free.unit);
    }
    text
}

/// The place of the start value in the `free` that begins at a byte.
fn start_of(tree: &Node, at: u32) -> Option<Range<usize>> {
    if tree.kind == Kind::Free && tree.start == at {
        let trivia =
            |n: &&Node| !matches!(n.kind, Kind::Space | Kind::Newline | Kind::Comment | Kind::Keyword);
        return tree.children.iter().find(trivia).map(Node::range);
    }
    let within = |n: &&Node| n.start <= at && at < n.end;
    tree.children.iter().filter(within).find_map(|n| start_of(n, at))
}

/// Whether the text, changed in this one place, gives the free values the start that was meant.
fn comes_to(
    out: &Elaborated,
    root: &str,
    files: &dyn Files,
    file: &str,
    at: &Range<usize>,
    text: &str,
    wanted: &[(&FreeVariable, f64)],
) -> bool {
    let Some(old) = out.sources.files.iter().find(|f| f.name == file) else { return false };
    let mut new = old.text.clone();
    new.replace_range(at.clone(), text);
    let new = BTreeMap::from([(file.to_string(), new)]);
    let again = elaborate(root, &Overlay { below: files, new: &new }, &Options::default());
    let starts: Vec<&FreeVariable> =
        again.assembly.iter().flat_map(|a| &a.designs).flat_map(|d| &d.free).collect();
    let meant = |(free, value): &(&FreeVariable, f64)| {
        let found = starts.iter().filter(|s| s.path == free.path && s.origin.file == free.origin.file);
        found.clone().any(|s| close(s.start, *value))
    };
    wanted.iter().all(meant)
}
