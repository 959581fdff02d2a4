//! Pages as plain text for a terminal. What is to stand out is told by a function of the caller, who knows the terminal.

use super::{Entry, Page, Parameter};

/// How a piece of text is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// A heading, or a name.
    Strong,
    /// Less important.
    Dim,
}

/// Wraps and paints.
pub struct Paper<'p> {
    /// Columns.
    pub width: usize,
    /// Text as it is to be painted.
    pub paint: &'p dyn Fn(Tone, &str) -> String,
}

impl Paper<'_> {
    /// The list of pages, by group.
    pub fn list(&self, pages: &[Page]) -> String {
        let mut out = String::new();
        let longest = pages.iter().map(|p| p.path.len()).max().unwrap_or(0);
        let mut group = None;
        for page in pages {
            if group != Some(page.group()) {
                let gap = if group.is_some() { "\n" } else { "" };
                out.push_str(&format!("{gap}{}\n", (self.paint)(Tone::Strong, page.group())));
                group = Some(page.group());
            }
            let pad = " ".repeat(longest - page.path.len());
            let head = format!("  {}{pad}  ", page.path);
            self.hang(&mut out, &head, &page.summary());
        }
        out.push_str("\nflexura doc PAGE shows one of them, flexura doc FILE a file of your own.\n");
        out
    }

    /// One page.
    pub fn page(&self, page: &Page) -> String {
        let mut out = format!("{}\n\n", (self.paint)(Tone::Strong, &page.path));
        self.prose(&mut out, &page.about);
        for entry in &page.items {
            self.entry(&mut out, entry);
        }
        while out.ends_with("\n\n") {
            out.pop();
        }
        out
    }

    fn entry(&self, out: &mut String, e: &Entry) {
        let replaces = e.replaces.as_ref().map(|k| format!(" replaces {k}")).unwrap_or_default();
        out.push_str(&format!(
            "{}\n\n",
            (self.paint)(Tone::Strong, &format!("{} {}{replaces}", e.kind, e.name))
        ));
        self.prose(out, &e.about);
        self.parameters(out, "parameters", &e.parameters);
        self.parameters(out, "free besides", &e.free);
        if !e.facts.is_empty() {
            out.push_str(&format!("{}\n", (self.paint)(Tone::Dim, states(&e.kind))));
            let longest = e.facts.iter().map(|f| f.label.chars().count()).max().unwrap_or(0);
            for f in &e.facts {
                let head = format!("  {:longest$}  ", f.label);
                self.hang(out, &head, &f.value);
                self.indented(out, longest + 4, &f.about);
            }
            out.push('\n');
        }
        out.push_str(&format!("{}\n", (self.paint)(Tone::Dim, "use")));
        for line in e.example.lines() {
            out.push_str(&format!("  {line}\n"));
        }
        out.push('\n');
    }

    fn parameters(&self, out: &mut String, title: &str, all: &[Parameter]) {
        if all.is_empty() {
            return;
        }
        out.push_str(&format!("{}\n", (self.paint)(Tone::Dim, title)));
        for p in all {
            let kind = p.kind.as_ref().map(|k| format!(": {k}")).unwrap_or_default();
            // Where the default has a unit, it need not be told again.
            let written = |u: &&String| *u != "1" && !p.default.contains(u.as_str());
            let unit = p.unit.as_ref().filter(written).map(|u| format!(", in {u}")).unwrap_or_default();
            let bounds = p.bounds.as_ref().map(|(a, b)| format!(", free in {a} .. {b}")).unwrap_or_default();
            let head = format!("  {}", (self.paint)(Tone::Strong, &p.name));
            out.push_str(&format!(
                "{head}{kind} = {}{bounds}{}\n",
                p.default,
                (self.paint)(Tone::Dim, &unit)
            ));
            self.indented(out, 6, &p.about);
        }
        out.push('\n');
    }

    /// Paragraphs.
    fn prose(&self, out: &mut String, text: &str) {
        for paragraph in text.split("\n\n").filter(|p| !p.trim().is_empty()) {
            self.hang(out, "", paragraph);
            out.push('\n');
        }
    }

    fn indented(&self, out: &mut String, columns: usize, text: &str) {
        if !text.is_empty() {
            self.hang(out, &" ".repeat(columns), text);
        }
    }

    /// Text after `head`, wrapped; further lines stand below its beginning.
    fn hang(&self, out: &mut String, head: &str, text: &str) {
        let indent = head.chars().count();
        out.push_str(head);
        let mut column = indent;
        for word in text.split_whitespace() {
            let long = word.chars().count();
            if column > indent && column + 1 + long > self.width {
                out.push('\n');
                out.push_str(&" ".repeat(indent));
                column = indent;
            } else if column > indent {
                out.push(' ');
                column += 1;
            }
            out.push_str(word);
            column += long;
        }
        out.push('\n');
    }
}

/// Heading of the facts of a kind of declaration.
pub fn states(kind: &str) -> &'static str {
    match kind {
        "mechanism" => "made of",
        "flexure" => "made of",
        _ => "states",
    }
}
