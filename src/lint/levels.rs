//! Which findings are told, and how loudly. From the weakest to the strongest: the rule's own severity, `flexura.toml`,
//! the command line, an `allow` in the text; what a baseline knows is not told at all. Errors are errors.

use super::baseline::Baseline;
use super::{Stage, find};
use crate::diagnostic::{Diagnostic, Edit, Fix, Origin, Severity, SourceMap};
use crate::elaborate::OwnFile;
use crate::syntax::ast::{Allow, Item, StatementKind};
use std::str::FromStr;

/// How a finding is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Not at all.
    Allow,
    /// As a warning.
    Warn,
    /// As an error.
    Deny,
}

impl Level {
    /// The level of this name.
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "allow" => Some(Self::Allow),
            "warn" => Some(Self::Warn),
            "deny" => Some(Self::Deny),
            _ => None,
        }
    }
}

/// Which findings a level is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Selector {
    /// One code.
    Code(String),
    /// Everything that is a warning by itself.
    Warnings,
    /// Every warning and every advice.
    All,
}

impl FromStr for Selector {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "all" => return Ok(Self::All),
            "warnings" => return Ok(Self::Warnings),
            _ => {}
        }
        if let Some(entry) = find(word) {
            return Ok(Self::Code(entry.rule.code.into()));
        }
        match super::explain::summary(word) {
            Some(_) if !word.starts_with('E') => Ok(Self::Code(word.into())),
            Some(_) => Err(format!("`{word}` is an error: what it finds cannot be built")),
            None => Err(unknown(word)),
        }
    }
}

/// What to say of a code that does not exist.
fn unknown(word: &str) -> String {
    let codes = super::explain::codes().map(|(code, _)| code).filter(|c| !c.starts_with('E'));
    let names = super::RULES.iter().map(|e| e.rule.name);
    let near = codes.chain(names).map(|c| (strsim::damerau_levenshtein(c, word), c)).min();
    match near.filter(|(distance, c)| 3 * distance <= c.len()) {
        Some((_, c)) => format!("there is no finding `{word}`; did you mean `{c}`?"),
        None => format!("there is no finding `{word}`; `flexura explain --list` shows all"),
    }
}

/// What is asked for from outside of the text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Levels {
    /// Of the command line.
    pub flags: Vec<(Selector, Level)>,
    /// Of the configuration file.
    pub config: Vec<(Selector, Level)>,
    /// What is known and not told again.
    pub baseline: Option<Baseline>,
}

impl Levels {
    /// The level of a finding without regard to the text; none: its own severity.
    fn of(&self, code: &str, severity: Severity) -> Option<Level> {
        choose(&self.flags, code, severity).or_else(|| choose(&self.config, code, severity))
    }

    /// Gives every finding its level, and takes out those that are allowed or known. `reached` is how far the design
    /// has come: an `allow` of something that was not looked for is not said to be needless.
    pub fn apply(&self, found: &mut Vec<Diagnostic>, sources: &SourceMap, files: &[OwnFile], reached: Stage) {
        let allows = collect(sources, files);
        let mut silenced = vec![false; allows.len()];
        let mut kept = Vec::with_capacity(found.len());
        let mut known = self.baseline.as_ref().map(Baseline::remaining);
        for d in found.drain(..) {
            // What is denied is known as well as what is told.
            let own = d.is_error();
            if let Some(d) = self.leveled(d, &allows, &mut silenced)
                && (own || !known.as_mut().is_some_and(|k| k.takes(&d, sources, files)))
            {
                kept.push(d);
            }
        }
        for (allow, _) in allows.iter().zip(&silenced).filter(|(a, s)| !**s && a.judged(reached)) {
            kept.extend(self.leveled(allow.needless(sources), &allows, &mut vec![false; allows.len()]));
        }
        *found = kept;
    }

    fn leveled(&self, mut d: Diagnostic, allows: &[Allowed], silenced: &mut [bool]) -> Option<Diagnostic> {
        if d.is_error() {
            return Some(d);
        }
        let at = d.labels.first().map(|l| l.at);
        let mut allowed = false;
        for (allow, silenced) in allows.iter().zip(silenced) {
            if allow.code == d.code && at.is_some_and(|at| allow.covers(at)) {
                (*silenced, allowed) = (true, true);
            }
        }
        if allowed {
            return None;
        }
        match self.of(&d.code, d.severity) {
            Some(Level::Allow) => return None,
            Some(Level::Warn) => d.severity = Severity::Warning,
            Some(Level::Deny) => d.severity = Severity::Error,
            None => {}
        }
        Some(d)
    }
}

/// The level for a code: one for the code itself goes before one for many; of several the strictest.
fn choose(list: &[(Selector, Level)], code: &str, severity: Severity) -> Option<Level> {
    let strictest = |own: &dyn Fn(&Selector) -> bool| {
        let levels = list.iter().filter(|(s, _)| own(s)).map(|(_, l)| *l);
        levels.max_by_key(|l| *l as u8)
    };
    strictest(&|s| matches!(s, Selector::Code(c) if c == code))
        .or_else(|| strictest(&|s| *s == Selector::Warnings && severity == Severity::Warning))
        .or_else(|| strictest(&|s| *s == Selector::All))
}

/// An `allow` with what it covers.
struct Allowed {
    code: String,
    at: Origin,
    covered: Origin,
}

impl Allowed {
    fn covers(&self, at: Origin) -> bool {
        let Origin { file, start, end } = self.covered;
        at.file == file && start <= at.start && at.end <= end
    }

    /// Whether what it allows has been looked for.
    fn judged(&self, reached: Stage) -> bool {
        match find(&self.code) {
            Some(entry) => entry.rule.stage() <= reached,
            // Codes up to 05 are those of text and motion; the others need a whole build.
            None => reached == Stage::Parts || self.code.get(1..3).is_some_and(|n| n < "06"),
        }
    }

    fn needless(&self, sources: &SourceMap) -> Diagnostic {
        let text = sources.files.get(self.at.file as usize).map_or("", |f| f.text.as_str());
        let rule = super::rules::UNUSED_ALLOW;
        rule.finds(format!("this `allow {}` silences nothing", self.code), self.at)
            .help("remove it; what it was for is gone, or stands elsewhere")
            .fix(Fix::safe("remove it", vec![Edit::remove(text, self.at)]))
    }
}

/// Every `allow` of the design's own files. One outside of blocks covers its file, one in a block the block; one
/// directly above a statement or block, without an empty line between, covers that only.
fn collect(sources: &SourceMap, files: &[OwnFile]) -> Vec<Allowed> {
    let mut found = Vec::new();
    for file in files {
        let text = sources.files.get(file.id as usize).map_or("", |f| f.text.as_str());
        let whole = Origin { file: file.id, start: 0, end: u32::MAX };
        let items: Vec<Origin> = file.ast.items.iter().map(place).collect();
        let all: Vec<&Allow> = file.ast.allows.iter().collect();
        found.extend(all.iter().map(|a| allowed(text, a, &all, &items, whole)));
        for item in &file.ast.items {
            let (statements, at) = match item {
                Item::Mechanism(m) => (&m.statements, m.at),
                Item::Flexure(f) => (&f.statements, f.at),
                Item::Record(_) => continue,
            };
            let mut all = Vec::new();
            let mut others = Vec::new();
            for s in statements {
                match &s.kind {
                    StatementKind::Allow(a) => all.push(a),
                    _ => others.push(s.at),
                }
            }
            found.extend(all.iter().map(|a| allowed(text, a, &all, &others, at)));
        }
    }
    found
}

fn place(item: &Item) -> Origin {
    match item {
        Item::Mechanism(m) => m.at,
        Item::Flexure(f) => f.at,
        Item::Record(r) => r.at,
    }
}

fn allowed(text: &str, allow: &Allow, all: &[&Allow], others: &[Origin], around: Origin) -> Allowed {
    let mut end = allow.at.end;
    let mut covered = around;
    loop {
        let next = others.iter().find(|o| o.start >= end && joined(text, end, o.start));
        if let Some(next) = next {
            covered = *next;
            break;
        }
        // Several below each other share what follows.
        match all.iter().find(|a| a.at.start >= end && joined(text, end, a.at.start)) {
            Some(a) => end = a.at.end,
            None => break,
        }
    }
    Allowed { code: allow.code.node.clone(), at: allow.at, covered }
}

/// Whether nothing but comments and one line end a line stand between.
fn joined(text: &str, from: u32, to: u32) -> bool {
    let between = text.get(from as usize..to as usize).unwrap_or("x");
    let lines: Vec<&str> = between.split('\n').map(str::trim).collect();
    let inner = lines.get(1..lines.len().saturating_sub(1)).unwrap_or(&[]);
    let first = lines.first().is_some_and(|l| l.is_empty() || l.starts_with("//"));
    first
        && lines.len() > 1
        && lines.last().is_some_and(|l| l.is_empty())
        && inner.iter().all(|l| l.starts_with("//"))
}

/// Findings about the `allow` statements themselves: codes that do not exist or cannot be allowed, and missing reasons.
pub fn judge(files: &[OwnFile]) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let mut one = |a: &Allow| {
        let code = &a.code.node;
        if super::explain::summary(code).is_none() {
            found.push(
                Diagnostic::error("E0118", unknown(code), a.code.at)
                    .help("write the code of a finding, `allow W1001 \"why it is accepted\"`"),
            );
        } else if code.starts_with('E') {
            let message = format!("`{code}` is an error and cannot be allowed");
            found.push(
                Diagnostic::error("E0118", message, a.code.at)
                    .help("`allow` is for warnings and advice: what an error says cannot be built"),
            );
        }
        if a.reason.node.trim().is_empty() {
            found.push(
                Diagnostic::error("E0119", "this `allow` gives no reason", a.reason.at)
                    .help("say why the finding is accepted: whoever reads the design next has to know"),
            );
        }
    };
    for file in files {
        file.ast.allows.iter().for_each(&mut one);
        for item in &file.ast.items {
            let statements = match item {
                Item::Mechanism(m) => &m.statements,
                Item::Flexure(f) => &f.statements,
                Item::Record(_) => continue,
            };
            for s in statements {
                if let StatementKind::Allow(a) = &s.kind {
                    one(a);
                }
            }
        }
    }
    found
}
