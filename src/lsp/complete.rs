//! What could be written at a place: by the words before it on its line, so that half a statement is enough.

use super::names::{Symbol, What};
use super::outline::word;
use super::space::{Place, Space};
use super::vocabulary::FUNCTIONS;
use crate::elaborate::{EXPORTS, std_modules, units};
use crate::syntax::tree::{Kind, Node};
use crate::syntax::{starting_words, statement_form};

/// A proposal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Proposal {
    /// What is written.
    pub label: String,
    /// What it is.
    pub detail: String,
    /// Its documentation.
    pub doc: String,
    /// Kind, as [`super::tokens::LEGEND`] calls it; `module` for imports.
    pub kind: &'static str,
}

fn proposal(label: &str, detail: &str, kind: &'static str) -> Proposal {
    Proposal { label: label.into(), detail: detail.into(), doc: String::new(), kind }
}

/// Proposals at a byte of a file; `beside` are the files that could be imported.
pub fn complete(space: &Space, file: &str, byte: usize, beside: &[String]) -> Vec<Proposal> {
    let Some(text) = space.files.get(file) else { return Vec::new() };
    let before = text.text.get(..byte).unwrap_or("");
    let line = before.rsplit('\n').next().unwrap_or("");
    if line.contains("//") {
        return Vec::new();
    }
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    // What has been written of the word in hand, and what stands before it.
    let head = line.trim_end_matches(is_word);
    let words: Vec<&str> = head.split(|c: char| !is_word(c)).filter(|w| !w.is_empty()).collect();
    let first = words.first().copied().unwrap_or("");
    let last = words.last().copied().unwrap_or("");
    let ends = |sign: char| head.trim_end().ends_with(sign);
    let at = Around { space, file, block: text.names.block_at(byte) };
    if first == "use" || line.trim_start() == "use " {
        return imports(line, beside);
    }
    if head.trim().is_empty() {
        return at.statements(byte);
    }
    if let Some(path) = head.strip_suffix('.') {
        return at.members(path.rsplit(|c: char| !is_word(c) && c != '.').next().unwrap_or(""));
    }
    let digits = head.trim_end().rsplit(|c: char| c == '.' || is_word(c) && !c.is_ascii_digit()).next();
    if head.ends_with(' ') && digits.is_some_and(|d| d.ends_with(|c: char| c.is_ascii_digit()))
        || line.ends_with(|c: char| c.is_ascii_digit())
    {
        return units::UNITS.iter().map(|u| proposal(u.symbol, &u.dimension.to_string(), "type")).collect();
    }
    let open = head.rfind('{').filter(|i| head.get(*i..).is_some_and(|t| !t.contains('}')));
    if let Some((before, inside)) = open.map(|i| head.split_at(i)) {
        let template = before.split_whitespace().last().unwrap_or("");
        // A field's name, not its value.
        if before.split_whitespace().rev().nth(1) == Some("as") && (inside.trim() == "{" || ends(',')) {
            return at.parameters(template);
        }
        if matches!(first, "ground" | "link") {
            return at.locals(&[What::Point]);
        }
    }
    match last {
        "as" => at.tops(&[What::Flexure]),
        "with" => at.tops(&[What::Motor]),
        "on" if first == "print" => at.tops(&[What::Process]),
        "material" if first == "material" => at.tops(&[What::Material]),
        "on" | "into" | "to" if !matches!(first, "drive" | "rod") => at.locals(&[What::Body]),
        "drive" | "rest" => at.locals(&[What::Joint, What::Cable]),
        "target" => at.locals(&[What::Trace]),
        "axis" | "along" | "about" | "gravity" => {
            let mut all: Vec<Proposal> = ["x", "y", "z"].map(|d| proposal(d, "direction", "keyword")).into();
            all.extend(at.locals(&[What::Param, What::Let]));
            all
        }
        "replaces" => {
            ["hinge", "ball", "universal", "slider"].map(|k| proposal(k, "joint", "keyword")).into()
        }
        "place" | "mirror" => Vec::new(),
        _ if ends(':') && statement_form(first).is_some_and(|f| f.starts_with("KIND")) => {
            at.locals(&[What::Body])
        }
        _ if first == "place" && ends('=') => at.tops(&[What::Mechanism]),
        _ if first == "mirror" && ends('=') => at.locals(&[What::Instance]),
        _ if first == "export" => EXPORTS.iter().map(|e| proposal(e, "what is made", "keyword")).collect(),
        _ => at.values(),
    }
}

struct Around<'a> {
    space: &'a Space,
    file: &'a str,
    block: Option<usize>,
}

impl Around<'_> {
    fn of(&self, symbol: &Symbol, place: &Place) -> Proposal {
        let from = if place.0 == self.file { String::new() } else { format!(" from {}", place.0) };
        let kind = match symbol.what {
            What::Mechanism | What::Flexure | What::Material | What::Process | What::Motor => "class",
            What::Field => "property",
            What::Param => "parameter",
            _ => "variable",
        };
        Proposal {
            label: symbol.name.clone(),
            detail: format!("{}{from}", word(symbol.what)),
            doc: symbol.doc.clone(),
            kind,
        }
    }

    /// Names of the block.
    fn locals(&self, wanted: &[What]) -> Vec<Proposal> {
        let Some(block) = self.block else { return Vec::new() };
        self.inside(&(self.file.to_string(), block), wanted)
    }

    fn inside(&self, (file, block): &(String, usize), wanted: &[What]) -> Vec<Proposal> {
        let symbols = self.space.files.get(file).map(|t| t.names.symbols.as_slice()).unwrap_or_default();
        symbols
            .iter()
            .enumerate()
            .filter(|(_, s)| s.block == Some(*block) && (wanted.is_empty() || wanted.contains(&s.what)))
            .map(|(i, s)| self.of(s, &(file.clone(), i)))
            .collect()
    }

    /// Names at the top.
    fn tops(&self, wanted: &[What]) -> Vec<Proposal> {
        let visible = self.space.visible(self.file);
        let found = visible.iter().filter_map(|p| Some((p, self.space.symbol(p)?)));
        found.filter(|(_, s)| wanted.contains(&s.what)).map(|(p, s)| self.of(s, p)).collect()
    }

    /// Parameters of a template.
    fn parameters(&self, template: &str) -> Vec<Proposal> {
        let opened = self.space.top(self.file, template).and_then(|p| self.space.opened(&p));
        opened.map(|o| self.inside(&o, &[What::Param])).unwrap_or_default()
    }

    /// What can follow `NAME.`
    fn members(&self, path: &str) -> Vec<Proposal> {
        let Some(names) = self.space.files.get(self.file).map(|t| &t.names) else { return Vec::new() };
        let mut parts = path.split('.');
        let first = parts.next().unwrap_or("");
        let own = self.block.and_then(|b| names.find(Some(b), first)).map(|i| (self.file.to_string(), i));
        let mut place = own.or_else(|| self.space.top(self.file, first));
        for part in parts {
            let inner = place.and_then(|p| self.space.opened(&p));
            place = inner.and_then(|(file, block)| {
                let i = self.space.files.get(&file)?.names.find(Some(block), part)?;
                Some((file, i))
            });
        }
        place.and_then(|p| self.space.opened(&p)).map(|o| self.inside(&o, &[])).unwrap_or_default()
    }

    /// Words that can begin a line.
    fn statements(&self, byte: usize) -> Vec<Proposal> {
        let block = self.space.files.get(self.file).map_or(Kind::File, |t| innermost(&t.tree, byte));
        let words = starting_words(block);
        words.iter().map(|w| proposal(w, statement_form(w).unwrap_or(""), "keyword")).collect()
    }

    /// What a value can begin with.
    fn values(&self) -> Vec<Proposal> {
        let mut all = self.locals(&[]);
        all.extend(self.tops(&[What::Material, What::Process, What::Motor]));
        all.extend(FUNCTIONS.iter().map(|f| {
            let detail = format!("{}({})", f.name, f.parameters.join(", "));
            Proposal { doc: f.gives.into(), ..proposal(f.name, &detail, "function") }
        }));
        all.push(proposal("free", "free START in LOWER .. UPPER", "keyword"));
        all
    }
}

/// The kind of the block around a place.
fn innermost(node: &Node, byte: usize) -> Kind {
    // Behind its last sign nothing is in a block any more.
    let around = node.children.iter().find(|c| {
        let range = c.range();
        range.start < byte && byte < range.end
    });
    let inner = around.map_or(Kind::File, |c| innermost(c, byte));
    match node.kind {
        _ if inner != Kind::File => inner,
        Kind::Mechanism | Kind::Flexure | Kind::Record | Kind::For | Kind::Case => node.kind,
        _ => Kind::File,
    }
}

/// What can be imported, behind `use`.
fn imports(line: &str, beside: &[String]) -> Vec<Proposal> {
    let written = line.trim_start().strip_prefix("use").unwrap_or("").trim_start();
    if let Some(rest) = written.strip_prefix("std.") {
        let folder = rest.rsplit_once('.').map_or("", |(f, _)| f);
        let mut all: Vec<Proposal> = std_modules()
            .iter()
            .filter_map(|m| {
                let rest = if folder.is_empty() { m } else { m.strip_prefix(folder)?.strip_prefix('.')? };
                let next = rest.split('.').next()?;
                Some(proposal(next, &format!("std.{m}"), "module"))
            })
            .collect();
        all.dedup_by(|a, b| a.label == b.label);
        return all;
    }
    if written.starts_with('"') {
        return beside.iter().map(|f| proposal(f, "file", "module")).collect();
    }
    let mut all = vec![proposal("std", "the standard library", "module")];
    all.extend(beside.iter().map(|f| proposal(&format!("\"{f}\""), "file", "module")));
    all
}
