//! Which names came, went or were changed, and which lines say something else.

use super::entries::{Entry, Word};
use super::{Line, Name, NameChange};
use std::collections::{BTreeMap, BTreeSet};

/// Two declarations that agree this much, in themselves and in their uses, are taken for one with another name.
const ALIKE: f64 = 0.6;
/// Of more pairs than this none is looked at: so much has changed that nothing is called otherwise any more. (A leg of
/// eleven links rewritten from nothing has about 600.)
const MOST_PAIRS: usize = 4000;

/// What [`compare`] gives.
pub struct Found {
    /// Names that came, went or were changed.
    pub names: Vec<Name>,
    /// Lines that say something else.
    pub lines: Vec<Line>,
    /// Old name to new name.
    pub renames: BTreeMap<String, String>,
}

type Place = (String, &'static str, String);

fn place(e: &Entry) -> Place {
    (e.scope.clone(), e.kind, e.key.clone())
}

/// Compares the statements of two versions.
pub fn compare(mut old: Vec<Entry>, new: &[Entry]) -> Found {
    let mut found = Found { names: Vec::new(), lines: Vec::new(), renames: BTreeMap::new() };
    while let Some((from, to)) = likeliest(&old, new) {
        found.names.push(Name {
            change: NameChange::Renamed,
            kind: from.kind.into(),
            scope: from.scope.clone(),
            name: from.key.clone(),
            to: Some(to.key.clone()),
        });
        found.renames.insert(from.key.clone(), to.key.clone());
        rename(&mut old, &from, &to.key);
    }
    let (before, after) = (by_place(&old), by_place(new));
    let places: BTreeSet<&Place> = before.keys().chain(after.keys()).collect();
    for at in places {
        let empty = Vec::new();
        let (a, b) = (before.get(at).unwrap_or(&empty), after.get(at).unwrap_or(&empty));
        // What both versions say is left out; the rest is paired in its order.
        let left = |these: &[&Entry], those: &[&Entry]| -> Vec<Entry> {
            let mut those: Vec<&Entry> = those.to_vec();
            let mut rest = Vec::new();
            for e in these {
                match those.iter().position(|o| says(o) == says(e)) {
                    Some(i) => drop(those.remove(i)),
                    None => rest.push((*e).clone()),
                }
            }
            rest
        };
        let (a, b) = (left(a, b), left(b, a));
        let both = a.len().min(b.len());
        for (a, b) in a.iter().zip(&b) {
            let what = format!("{} {}", at.1, at.2).trim_end().to_string();
            found.lines.push(Line { what, scope: at.0.clone(), before: a.said(), after: b.said() });
        }
        let mut alone = |entries: &[Entry], change| {
            for e in entries.iter().skip(both) {
                let name = if e.key.is_empty() { e.said() } else { e.key.clone() };
                let (kind, scope) = (e.kind.into(), e.scope.clone());
                found.names.push(Name { change, kind, scope, name, to: None });
            }
        };
        alone(&a, NameChange::Removed);
        alone(&b, NameChange::Added);
    }
    found
}

fn says(e: &Entry) -> Vec<&str> {
    e.words.iter().map(|w| w.text.as_str()).collect()
}

fn by_place(entries: &[Entry]) -> BTreeMap<Place, Vec<&Entry>> {
    let mut out: BTreeMap<Place, Vec<&Entry>> = BTreeMap::new();
    for e in entries {
        out.entry(place(e)).or_default().push(e);
    }
    out
}

/// The pair of a declaration that went and one that came that agrees most, if it agrees enough.
fn likeliest(old: &[Entry], new: &[Entry]) -> Option<(Entry, Entry)> {
    let places = |entries: &[Entry]| entries.iter().map(place).collect::<BTreeSet<_>>();
    let (had, has) = (places(old), places(new));
    let gone: Vec<&Entry> = old.iter().filter(|e| e.declares && !has.contains(&place(e))).collect();
    let come: Vec<&Entry> = new.iter().filter(|e| e.declares && !had.contains(&place(e))).collect();
    if gone.len() * come.len() > MOST_PAIRS {
        return None;
    }
    let mut best: Option<(f64, &Entry, &Entry)> = None;
    for from in gone {
        for to in come.iter().filter(|e| e.kind == from.kind && e.scope == from.scope) {
            let score = agreement(old, new, from, to);
            if score >= ALIKE && best.is_none_or(|(most, ..)| score > most) {
                best = Some((score, from, to));
            }
        }
    }
    best.map(|(_, from, to)| (from.clone(), to.clone()))
}

/// How much two declarations agree, 0 to 1: the mean of how alike they are themselves and how alike their uses are.
fn agreement(old: &[Entry], new: &[Entry], from: &Entry, to: &Entry) -> f64 {
    let own = alike(from, to, &from.key, &to.key);
    let uses = |entries: &[Entry], of: &Entry| -> Vec<Entry> {
        let mentions =
            |e: &&Entry| place(e) != place(of) && e.words.iter().any(|w| w.is_name && w.text == of.key);
        entries.iter().filter(mentions).cloned().collect()
    };
    let (old_uses, new_uses) = (uses(old, from), uses(new, to));
    if old_uses.is_empty() && new_uses.is_empty() {
        return own;
    }
    let best = |e: &Entry| {
        let same_kind = new_uses.iter().filter(|n| n.kind == e.kind);
        same_kind.map(|n| alike(e, n, &from.key, &to.key)).fold(0.0, f64::max)
    };
    let most = old_uses.len().max(new_uses.len()) as f64;
    0.5 * (own + old_uses.iter().map(best).sum::<f64>() / most)
}

/// The share of words that two statements have in common when the one name is read as the other.
fn alike(a: &Entry, b: &Entry, from: &str, to: &str) -> f64 {
    let mut rest: Vec<&str> = says(b);
    let all = a.words.len().max(b.words.len());
    let mut common = 0;
    for word in &a.words {
        let text = if word.is_name && word.text == from { to } else { word.text.as_str() };
        if let Some(i) = rest.iter().position(|w| *w == text) {
            rest.remove(i);
            common += 1;
        }
    }
    common as f64 / all.max(1) as f64
}

/// Calls a declaration, and everything that mentions it where it is known, by another name.
fn rename(entries: &mut [Entry], from: &Entry, to: &str) {
    let top = matches!(from.kind, "mechanism" | "flexure" | "material" | "process" | "motor");
    let scope = if top { String::new() } else { from.scope.clone() };
    let (old_scope, new_scope) = (format!("{} {}", from.kind, from.key), format!("{} {to}", from.kind));
    for e in entries.iter_mut() {
        if top && e.scope.ends_with(&old_scope) {
            e.scope = format!("{}{new_scope}", e.scope.trim_end_matches(&old_scope));
        }
        if !(scope.is_empty() || e.scope == scope) {
            continue;
        }
        for word in e.words.iter_mut().filter(|w: &&mut Word| w.is_name && w.text == from.key) {
            word.text = to.into();
        }
        // Keys are made of the same words.
        e.key = renamed(&e.key, &from.key, to);
    }
}

/// A text with a whole word replaced.
pub fn renamed(text: &str, from: &str, to: &str) -> String {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = String::with_capacity(text.len());
    let mut word = String::new();
    for c in text.chars().chain(['\0']) {
        if is_word(c) {
            word.push(c);
            continue;
        }
        out.push_str(if word == from { to } else { &word });
        word.clear();
        if c != '\0' {
            out.push(c);
        }
    }
    out
}
