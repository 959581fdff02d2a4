//! What recovery took, as diagnostics: one for each mistake, at its own place.
//!
//! | code | says |
//! | --- | --- |
//! | E0001 | something else was expected here |
//! | E0002 | no statement or declaration starts so |
//! | E0003 | a `{` is never closed |
//! | E0004 | a statement or `}` stands outside of any block |
//! | E0005 | the file is too large |
//! | E0006 | brackets are nested too deep |
//! | E0007 | a number is too large |
//! | E0008 | a clause is given twice |
//! | E0009 | a statement stands in a block of the wrong sort |
//! | E0010 | a character that the language does not have |
//! | E0011 | the edition is given twice |
//! | E0012 | a text is not closed on its line |
//! | E0013 | an expression is too long |
//! | E0014 | there are more errors than are shown |

use super::found::{
    article, comment_start, first_word, found, is_word, list, looks_like_joint, odd, starts, unclosed,
};
use super::grammar::{Failure, Wanted, why};
use super::lower::Lower;
use super::tree::{Kind, Node};
use super::words::{ITEM_WORDS, STATEMENT_WORDS, form, is_joint_kind, nearest};
use crate::diagnostic::{Diagnostic, Edit, Fix, Origin};

/// Broken parts that are looked into; looking costs as much as parsing them once more.
const MAX_ERRORS: usize = 100;

/// State between neighbouring broken parts, so that one mistake is not told twice.
#[derive(Default)]
pub(super) struct Recovery {
    /// Parentheses that the broken part before left open.
    open: usize,
    /// A declaration's head was broken, or something stood outside: what follows outside of any
    /// block is a consequence.
    outside: bool,
    /// The broken part before lacked its `{`: lines without a keyword are its block's.
    headless: bool,
    /// Broken parts so far.
    count: usize,
}

impl Recovery {
    /// A statement or declaration could be read: whatever was open before is over.
    pub(super) fn reset(&mut self) {
        self.open = 0;
        self.headless = false;
        self.outside = false;
    }
}

impl Lower<'_> {
    /// A broken statement of a block.
    pub(super) fn bad_statement(&mut self, node: &Node) {
        if self.continues(node, STATEMENT_WORDS) {
            return;
        }
        let text = self.text(node);
        let word = first_word(text);
        // A joint kind is any word; one that is nearly another keyword is that, misspelt.
        let joint = looks_like_joint(text) && nearest(word, STATEMENT_WORDS).is_none_or(is_joint_kind);
        if !STATEMENT_WORDS.contains(&word) && !joint && !self.odd_at(node.start as usize) {
            return self.unknown(node, word, STATEMENT_WORDS, "statement");
        }
        self.explain(node, Wanted::Statement, word);
    }

    /// A broken term of `minimize`.
    pub(super) fn bad_term(&mut self, node: &Node) {
        if !self.continues(node, STATEMENT_WORDS) {
            self.explain(node, Wanted::Term, "term");
        }
    }

    /// A broken field of a record.
    pub(super) fn bad_field(&mut self, node: &Node) {
        if !self.continues(node, &[]) {
            self.explain(node, Wanted::Field, "field");
        }
    }

    /// A declaration whose head is broken while its block can be read. True if the block holds
    /// statements worth reading.
    pub(super) fn bad_heading(&mut self, node: &Node) -> bool {
        self.recovery.reset();
        let heading = node.first(Kind::BadHeading).unwrap_or(node);
        let word = first_word(self.text(heading));
        if ITEM_WORDS.contains(&word) {
            self.explain(heading, Wanted::Item, word);
            return matches!(word, "mechanism" | "flexure");
        }
        self.unknown(heading, word, ITEM_WORDS, "declaration");
        matches!(nearest(word, ITEM_WORDS), Some("mechanism" | "flexure"))
    }

    /// What stands outside of any block and is no declaration.
    pub(super) fn stray(&mut self, node: &Node) {
        let text = self.text(node);
        let word = first_word(text);
        let is_item = ITEM_WORDS.contains(&word);
        if !is_item && (self.recovery.outside || self.continues(node, ITEM_WORDS)) {
            return;
        }
        self.recovery.outside = true;
        if text == "}" {
            let at = self.origin(node);
            self.report(
                Diagnostic::error("E0004", "this `}` closes nothing", at)
                    .label("no `{` is open here")
                    .help("remove it, or look for a `}` too many above"),
            );
        } else if is_item {
            self.explain(node, Wanted::Item, word);
        } else if STATEMENT_WORDS.contains(&word) {
            let at = self.first_line(node);
            self.report(
                Diagnostic::error("E0004", format!("`{word}` stands outside of any block"), at)
                    .label("no `mechanism` or `flexure` is open here")
                    .help("statements stand between the `{` and `}` of a `mechanism` or `flexure`"),
            );
        } else if self.odd_at(node.start as usize) {
            self.explain(node, Wanted::Item, word);
        } else {
            self.unknown(node, word, ITEM_WORDS, "declaration");
        }
    }

    /// A block whose `}` is missing.
    pub(super) fn closed(&mut self, block: &Node) {
        let Some(end) = block.first(Kind::NoBrace) else { return };
        // A broken statement that opened a block of its own has taken this block's `}`.
        if block.all(Kind::BadStatement).any(|n| self.text(n).contains('{')) {
            return;
        }
        let open = block.all(Kind::Punctuation).find(|n| self.text(n) == "{").unwrap_or(block);
        let open = self.origin(open);
        let noticed = self.after_last_token(end.start as usize);
        self.report(
            Diagnostic::error("E0003", "this `{` is never closed", open)
                .also(self.at(noticed, noticed), "a `}` is missing here at the latest")
                .help("close the block with `}` on a line of its own"),
        );
    }

    /// Sorts what was found and keeps the first [`MAX_ERRORS`].
    pub(super) fn finish(&mut self) {
        self.diagnostics.sort_by_key(|d| d.labels.first().map_or(0, |l| l.at.start));
        let untold = self.recovery.count.saturating_sub(MAX_ERRORS);
        let more = untold + self.diagnostics.len().saturating_sub(MAX_ERRORS);
        self.diagnostics.truncate(MAX_ERRORS);
        if more > 0 {
            let end = self.source.len();
            let message = format!("{more} more errors are not shown");
            self.report(Diagnostic::error("E0014", message, self.at(end, end)).help("mend the first ones"));
        }
    }

    /// Counts a broken part; false if enough have been told.
    fn counted(&mut self) -> bool {
        self.recovery.count += 1;
        self.recovery.count <= MAX_ERRORS
    }

    /// Whether a broken part only continues what the one before left open.
    fn continues(&mut self, node: &Node, keywords: &[&str]) -> bool {
        let text = self.text(node);
        let before = self.recovery.open;
        let consequence = before > 0 || self.recovery.headless;
        let continues = consequence && !keywords.contains(&first_word(text));
        self.recovery.headless &= continues;
        self.recovery.open = if continues { before } else { 0 };
        node.leaves(&mut |leaf| {
            if leaf.kind == Kind::Junk {
                for c in self.source.get(leaf.range()).unwrap_or("").chars() {
                    match c {
                        '(' => self.recovery.open += 1,
                        ')' => self.recovery.open = self.recovery.open.saturating_sub(1),
                        _ => {}
                    }
                }
            }
        });
        continues
    }

    /// E0002.
    fn unknown(&mut self, node: &Node, word: &str, known: &[&str], what: &str) {
        if !self.counted() {
            return;
        }
        let start = node.start as usize;
        if word.is_empty() {
            let (length, found) = found(self.source, start);
            let message = format!("{} {what} starts with a keyword, found {found}", article(what));
            let at = self.at(start, start + length);
            let help = starts(what, known);
            self.report(Diagnostic::error("E0002", message, at).label("no keyword").help(help));
            return;
        }
        let at = self.at(start, start + word.len());
        let diagnostic =
            Diagnostic::error("E0002", format!("no {what} starts with `{word}`"), at).label("not a keyword");
        self.report(match nearest(word, known) {
            Some(near) => diagnostic
                .help(format!("did you mean `{near}`?"))
                .fix(Fix::risky(format!("write `{near}`"), vec![Edit::replace(at, near)])),
            None => diagnostic.help(starts(what, known)),
        });
    }

    /// E0001, E0010 or E0012: where a part stopped making sense, and what would have.
    fn explain(&mut self, node: &Node, wanted: Wanted, word: &str) {
        if !self.counted() {
            return;
        }
        let start = node.start as usize;
        let Some(Failure { at, expected }) = why(self.source, start, wanted) else {
            let at = self.first_line(node);
            self.report(Diagnostic::error("E0001", "this could not be read", at));
            return;
        };
        let at = self.settle(start, at);
        let (length, found) = found(self.source, at);
        let place = self.at(at, at + length);
        let rest = self.source.get(at..).unwrap_or("");
        if rest.starts_with('"') && unclosed(rest) {
            let line = rest.lines().next().map_or(0, |l| l.trim_end().len());
            self.report(
                Diagnostic::error("E0012", "this text is not closed", self.at(at, at + line))
                    .label("no `\"` follows on this line")
                    .help("close it with `\"` on the same line"),
            );
            return;
        }
        if let Some((message, help)) = odd(rest) {
            // A letter in a name: the whole word is meant.
            let word = self.source.get(..at).map_or(at, |t| t.trim_end_matches(is_word).len());
            let place = if rest.starts_with(is_word) { self.at(word, at + length) } else { place };
            self.report(Diagnostic::error("E0010", message, place).label("not understood").help(help));
            return;
        }
        if length == 0 && expected.iter().any(|e| e == "`{`") {
            // The block's `}` will close the block around, and what follows will stand outside.
            self.recovery.headless = true;
            self.recovery.outside = true;
        }
        let expected = list(&expected);
        let mut diagnostic = Diagnostic::error("E0001", format!("expected {expected}, found {found}"), place)
            .label(format!("expected {expected}"));
        if let Some(help) = self.advice(at, word) {
            diagnostic = diagnostic.help(help);
        }
        self.report(diagnostic);
    }

    /// What to do about an error at `at` in a statement that starts with `word`.
    fn advice(&self, at: usize, word: &str) -> Option<String> {
        let rest = self.source.get(at..).unwrap_or("");
        let before = self.source.get(..at).unwrap_or("");
        let after_value = before.trim_end_matches([' ', '\t']);
        if rest.trim_start().starts_with('(')
            && after_value.ends_with(|c: char| c.is_ascii_alphanumeric() || c == ')')
        {
            return Some("write `*` between factors; a call has no space before its `(`".into());
        }
        if rest.starts_with("==") || rest.starts_with("=") && word == "require" {
            return Some("compare with `<=`, `<`, `>=` or `>`".into());
        }
        form(word).map(|form| format!("write `{form}`"))
    }

    /// Moves a failure back to the end of the line whose continuation was looked for in vain on
    /// the lines after it.
    fn settle(&self, start: usize, at: usize) -> usize {
        let end = self.after_last_token(at);
        if end <= start {
            return at;
        }
        let crossed = self.source.get(end..at).is_some_and(|t| t.contains(['\n', '\r']));
        if !crossed {
            return at;
        }
        // After these the next line is a continuation: the mistake is there.
        let open =
            self.source.get(..end).is_some_and(|t| t.ends_with([',', '(', '{', '+', '-', '*', '/', '^']));
        let word_follows = self.source.get(at..).is_some_and(|t| !t.is_empty() && !t.starts_with('}'));
        if open && word_follows && !STATEMENT_WORDS.contains(&first_word(self.source.get(at..).unwrap_or("")))
        {
            at
        } else {
            end
        }
    }

    /// End of the last byte before `at` that is no trivia.
    fn after_last_token(&self, at: usize) -> usize {
        let mut end = at;
        loop {
            let before = self.source.get(..end).unwrap_or("");
            let trimmed = before.trim_end_matches([' ', '\t', '\n', '\r']).len();
            let line = self.source.get(..trimmed).and_then(|t| t.rfind(['\n', '\r'])).map_or(0, |i| i + 1);
            let comment = self.source.get(line..trimmed).and_then(comment_start);
            match comment {
                Some(start) => end = line + start,
                None => return trimmed,
            }
        }
    }

    /// The first line of a node.
    fn first_line(&self, node: &Node) -> Origin {
        let length = self.text(node).lines().next().map_or(0, |l| l.trim_end().len());
        self.at(node.start as usize, node.start as usize + length)
    }

    fn odd_at(&self, at: usize) -> bool {
        odd(self.source.get(at..).unwrap_or("")).is_some()
    }
}
