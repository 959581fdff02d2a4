//! The statements of a design's own files as what they say: their words without spaces and comments, and what each is
//! called.

use crate::diagnostic::SourceMap;
use crate::syntax::tree::{Kind, Node};

/// A word of a statement.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Word {
    /// As written.
    pub text: String,
    /// Whether it is a name (and no keyword, number or sign).
    pub is_name: bool,
    /// Whether a space stands before it where it is shown.
    pub spaced: bool,
    /// Whether it ends one of several things between braces: shown by a comma, whatever the text has there.
    pub ends: bool,
}

/// A statement, a field of a record, a term of `minimize`, or the heading of a declaration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// The declaration it stands in: `mechanism lambda`; empty at the top of the file.
    pub scope: String,
    /// `param`, `joint`, `requirement`, …
    pub kind: &'static str,
    /// What tells it from others of its kind in the same scope.
    pub key: String,
    /// Whether the key is a name that is declared here.
    pub declares: bool,
    /// What it says.
    pub words: Vec<Word>,
    /// How many words at the beginning say nothing but kind and key.
    pub head: usize,
}

impl Entry {
    /// What is said after the name.
    pub fn said(&self) -> String {
        shown(self.words.get(self.head..).unwrap_or_default())
    }
}

/// Words as one line.
pub fn shown(words: &[Word]) -> String {
    let mut out = String::new();
    for word in words {
        if word.spaced && !out.is_empty() {
            out.push(' ');
        }
        out.push_str(&word.text);
        if word.ends {
            out.push(',');
        }
    }
    out
}

/// The statements of all files that belong to the design itself; the root file is the first.
pub fn of(sources: &SourceMap) -> Vec<Entry> {
    let own = sources.files.iter().filter(|f| f.name.ends_with(".mech") && !f.name.starts_with("std/"));
    let mut entries = Vec::new();
    for (i, file) in own.enumerate() {
        let tree = crate::syntax::parse(0, &file.text).tree;
        let reader = Reader { text: &file.text };
        // Names of other files tell their declarations apart; the root may be called as it likes.
        let prefix = if i == 0 { String::new() } else { format!("{}: ", file.name) };
        for item in tree.parts() {
            reader.item(item, &prefix, &mut entries);
        }
    }
    entries
}

struct Reader<'a> {
    text: &'a str,
}

impl Reader<'_> {
    fn item(&self, node: &Node, prefix: &str, into: &mut Vec<Entry>) {
        let kind = match node.kind {
            Kind::Mechanism => "mechanism",
            Kind::Flexure => "flexure",
            Kind::Record => match self.first(node, Kind::Keyword).as_str() {
                "material" => "material",
                "process" => "process",
                _ => "motor",
            },
            Kind::Edition => return self.plain(node, prefix.trim_end(), "edition", "", into),
            Kind::Import => {
                let words = self.words(node);
                let key = shown(words.get(1..).unwrap_or_default());
                let scope = prefix.trim_end().to_string();
                let head = words.len();
                return into.push(Entry { scope, kind: "import", key, declares: false, words, head });
            }
            _ => return self.other(node, prefix.trim_end(), into),
        };
        let name = self.first(node, Kind::Ident);
        let heading: Vec<&Node> =
            node.parts().take_while(|n| !(n.kind == Kind::Punctuation && self.of(n) == "{")).collect();
        let words: Vec<Word> = heading.iter().flat_map(|n| self.words(n)).collect();
        let scope = format!("{prefix}{kind} {name}");
        into.push(Entry {
            scope: prefix.trim_end().to_string(),
            kind,
            key: name,
            declares: true,
            head: words.len().min(2),
            words,
        });
        for statement in node.parts().skip(heading.len()) {
            self.statement(statement, &scope, into);
        }
    }

    fn statement(&self, node: &Node, scope: &str, into: &mut Vec<Entry>) {
        let kind = match node.kind {
            Kind::Punctuation | Kind::NoBrace => return,
            Kind::Param => "param",
            Kind::Let => "let",
            Kind::Point => "point",
            Kind::Body | Kind::OwnBody => "body",
            Kind::Trace => "trace",
            Kind::Output => "output",
            Kind::String => "string",
            Kind::Rod => "rod",
            Kind::Place | Kind::Mirror => "instance",
            Kind::Joint => return self.named(node, scope, "joint", 1, into),
            Kind::Field => "field",
            Kind::Drive => return self.refers(node, scope, "drive", into),
            Kind::Rest => return self.refers(node, scope, "rest", into),
            Kind::Target => return self.refers(node, scope, "target", into),
            Kind::MaterialUse => return self.plain(node, scope, "material", "", into),
            Kind::Print => return self.plain(node, scope, "process", "", into),
            Kind::Links => return self.plain(node, scope, "links", "", into),
            Kind::Model => return self.plain(node, scope, "model", "", into),
            Kind::Cycle => return self.plain(node, scope, "cycle", "", into),
            Kind::Load => {
                let on = node.parts().flat_map(|form| form.all(Kind::Ident)).last();
                let key = on.map_or("gravity".into(), |body| format!("on {}", self.of(body)));
                return self.plain(node, scope, "load", &key, into);
            }
            Kind::Minimize => {
                return node.all(Kind::Term).for_each(|term| self.term(term, scope, into));
            }
            Kind::Require => {
                let query: Vec<Word> = node
                    .parts()
                    .skip(1)
                    .take_while(|n| n.kind != Kind::Punctuation)
                    .flat_map(|n| self.words(n))
                    .collect();
                return self.entry(node, scope, "requirement", shown(&query), 1 + query.len(), into);
            }
            Kind::Export => {
                for what in node.all(Kind::Artefact) {
                    let words = self.words(what);
                    let head = words.len();
                    let key = shown(&words);
                    into.push(Entry {
                        scope: scope.into(),
                        kind: "export",
                        key,
                        declares: false,
                        words,
                        head,
                    });
                }
                return;
            }
            _ => return self.other(node, scope, into),
        };
        self.named(node, scope, kind, 0, into);
    }

    /// A term by what it measures: `track(tip)`; its options and its weight are what it says.
    fn term(&self, node: &Node, scope: &str, into: &mut Vec<Entry>) {
        let Some(call) = node.first(Kind::Call) else { return };
        let of: Vec<String> = call
            .all(Kind::Argument)
            .filter(|a| a.first(Kind::Ident).is_none())
            .map(|a| shown(&self.words(a)))
            .collect();
        let key = format!("{}({})", self.first(call, Kind::Ident), of.join(", "));
        self.entry(node, scope, "objective", key, 0, into);
    }

    /// A statement that declares the name that stands in this place among its names.
    fn named(&self, node: &Node, scope: &str, kind: &'static str, place: usize, into: &mut Vec<Entry>) {
        let Some(name) = node.all(Kind::Ident).nth(place).map(|n| self.of(n)) else { return };
        let words = self.words(node);
        let head = words.iter().position(|w| w.text == name).map_or(0, |at| at + 1);
        // The kind of a joint may change, and ground become link: these words say something.
        let head = if kind == "joint" || kind == "body" || kind == "instance" { 0 } else { head };
        into.push(Entry { scope: scope.into(), kind, key: name, declares: true, words, head });
    }

    /// A statement about a name that is declared elsewhere.
    fn refers(&self, node: &Node, scope: &str, kind: &'static str, into: &mut Vec<Entry>) {
        self.entry(node, scope, kind, self.first(node, Kind::Ident), 2, into);
    }

    fn plain(&self, node: &Node, scope: &str, kind: &'static str, key: &str, into: &mut Vec<Entry>) {
        self.entry(node, scope, kind, key.into(), 1, into);
    }

    fn entry(
        &self,
        node: &Node,
        scope: &str,
        kind: &'static str,
        key: String,
        head: usize,
        into: &mut Vec<Entry>,
    ) {
        let words = self.words(node);
        into.push(Entry { scope: scope.into(), kind, key, declares: false, words, head });
    }

    /// What has no rule of its own, broken lines too: told by what it says.
    fn other(&self, node: &Node, scope: &str, into: &mut Vec<Entry>) {
        let words = self.words(node);
        let (key, head) = (shown(&words), words.len());
        into.push(Entry { scope: scope.into(), kind: "statement", key, declares: false, words, head });
    }

    fn of(&self, node: &Node) -> String {
        self.text.get(node.range()).unwrap_or("").to_string()
    }

    fn first(&self, node: &Node, kind: Kind) -> String {
        node.first(kind).map(|n| self.of(n)).unwrap_or_default()
    }

    /// The words of a node. Between braces a comma says no more than a line's end.
    fn words(&self, node: &Node) -> Vec<Word> {
        let mut words: Vec<Word> = Vec::new();
        let mut open: Vec<char> = Vec::new();
        let (mut spaced, mut ended) = (false, false);
        node.leaves(&mut |leaf| {
            if leaf.kind.is_trivia() {
                spaced = true;
                ended |= leaf.kind == Kind::Newline && open.last() == Some(&'{');
                return;
            }
            let text = self.of(leaf);
            match text.as_str() {
                "" => return,
                "{" => open.push('{'),
                "(" => open.push('('),
                "}" | ")" => {
                    ended = false;
                    open.pop();
                }
                "," if open.last() == Some(&'{') => {
                    (spaced, ended) = (true, true);
                    return;
                }
                _ => {}
            }
            // Shown the usual way, whatever the text's spaces were.
            let closing = matches!(text.as_str(), ")" | "," | ":");
            let after = words.last().map_or("", |w| w.text.as_str());
            let spaced_here = match (after, text.as_str()) {
                (_, _) if closing => false,
                ("(" | "." | "^", _) => false,
                (_, "." | "^") => false,
                (",", _) => true,
                ("{", _) | (_, "{" | "}" | "=" | "+" | "-" | "*" | "/" | ".." | "<" | ">" | "<=" | ">=") => {
                    leaf.kind != Kind::UnitOperator && leaf.kind != Kind::Digits || spaced
                }
                (_, "(") => spaced && leaf.kind == Kind::Punctuation,
                _ => spaced,
            };
            let is_name = leaf.kind == Kind::Ident;
            if let Some(last) = words.last_mut().filter(|w| ended && w.text != "{") {
                last.ends = true;
            }
            words.push(Word { text, is_name, spaced: spaced_here, ends: false });
            (spaced, ended) = (false, false);
        });
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(text: &str) -> Vec<Entry> {
        let mut sources = SourceMap::default();
        sources.add("a.mech", text);
        of(&sources)
    }

    #[test]
    fn statements_are_told_by_kind_and_name() {
        let found = entries(
            "use std.materials.rigur\nmechanism m {\n  param r: length = 2 mm // short\n  \
             hinge knee: a to b at P as leaf { t = 1 mm\n  g = 2 mm }\n  minimize { track(tip, scale = 1 mm) \
             weight 2 }\n  require max(error(tip)) <= 1 mm\n  export stl, arduino(motor)\n  lnik x\n}\n",
        );
        let told: Vec<String> =
            found.iter().map(|e| format!("{}|{}|{}|{}", e.scope, e.kind, e.key, e.said())).collect();
        insta::assert_snapshot!(told.join("\n"));
    }

    #[test]
    fn spaces_comments_and_commas_between_braces_say_nothing() {
        let words = |text: &str| {
            entries(text)
                .into_iter()
                .map(|e| e.words.into_iter().map(|w| w.text).collect::<Vec<_>>())
                .collect::<Vec<_>>()
        };
        let a = "mechanism m {\n hinge k: a to b at (1 mm, -2 mm) as leaf { t = 1 mm, g = 2 mm }\n}\n";
        let b = "mechanism m { // here\n hinge k:  a to b at (1 mm,-2 mm) as leaf {\n t = 1 mm\n g = 2 mm\n}\n}\n";
        assert_eq!(words(a), words(b));
        let c = "mechanism m {\n hinge k: a to b at (1 mm -2 mm) as leaf { t = 1 mm, g = 2 mm }\n}\n";
        assert_ne!(words(a), words(c));
    }
}
