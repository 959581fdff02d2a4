//! A record of what somebody does at an editor: typing with slips, deleting, pasting, moving lines, taking back. The same
//! seed gives the same record.

/// A replacement: line and UTF-16 column of its beginning and end, and the new text.
#[derive(Clone, Debug)]
pub struct Key {
    pub range: [u32; 4],
    pub text: String,
}

/// What can be taken back: a byte, what stood there, what stands there now.
type Done = (usize, String, String);

/// The hand at the keyboard, and the text as the editor has it.
pub struct Hand {
    pub text: String,
    seed: u64,
    keys: Vec<Key>,
    done: Vec<Done>,
    /// Names of the lines that were added and still stand.
    added: Vec<String>,
    count: usize,
}

/// Lines that are added at a time at most; older ones are deleted again.
const MOST_ADDED: usize = 8;

impl Hand {
    pub fn new(text: &str, seed: u64) -> Self {
        Self { text: text.into(), seed, keys: Vec::new(), done: Vec::new(), added: Vec::new(), count: 0 }
    }

    /// The next replacements, one a keystroke: one thing that is done, from its first to its last.
    pub fn next(&mut self) -> Vec<Key> {
        self.done.clear();
        match self.random(10) {
            0..=2 => self.new_statement(),
            3 | 4 => self.other_digit(),
            5 => self.half_a_thought(),
            6 => self.comment(),
            7 => self.paste(),
            8 => self.move_line(),
            _ => self.delete_words(),
        }
        std::mem::take(&mut self.keys)
    }

    fn random(&mut self, n: usize) -> usize {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 33) as usize % n.max(1)
    }

    fn place(&self, byte: usize) -> [u32; 2] {
        let before = &self.text[..byte];
        let line = before.matches('\n').count() as u32;
        [line, before.rsplit('\n').next().map_or(0, |l| l.encode_utf16().count()) as u32]
    }

    /// One keystroke.
    fn press(&mut self, at: usize, length: usize, new: &str) {
        let ([l1, c1], [l2, c2]) = (self.place(at), self.place(at + length));
        self.keys.push(Key { range: [l1, c1, l2, c2], text: new.into() });
        let old = self.text[at..at + length].to_string();
        self.text.replace_range(at..at + length, new);
        self.done.push((at, old, new.into()));
    }

    fn undo(&mut self) {
        for (at, old, new) in std::mem::take(&mut self.done).into_iter().rev() {
            self.press(at, new.len(), &old);
        }
        self.done.clear();
    }

    /// Types, at times a wrong letter first; returns where it ends.
    fn type_text(&mut self, mut at: usize, text: &str) -> usize {
        for c in text.chars() {
            if self.random(12) == 0 {
                self.press(at, 0, "q");
                self.press(at, 1, "");
            }
            self.press(at, 0, &c.to_string());
            at += c.len_utf8();
        }
        at
    }

    /// First bytes of lines within mechanisms.
    fn lines(&self) -> Vec<usize> {
        let starts = std::iter::once(0).chain(self.text.match_indices('\n').map(|(i, _)| i + 1));
        starts
            .filter(|i| self.text[*i..].starts_with("    ") && !self.text[*i..].starts_with("     "))
            .collect()
    }

    fn line(&mut self) -> usize {
        let lines = self.lines();
        lines[self.random(lines.len())]
    }

    fn end_of(&self, start: usize) -> usize {
        self.text[start..].find('\n').map_or(self.text.len(), |n| start + n)
    }

    /// A point that was not there, between two points; the oldest such line goes.
    fn new_statement(&mut self) {
        let points: Vec<usize> =
            self.lines().into_iter().filter(|i| self.text[*i..].starts_with("    point ")).collect();
        let at = points[self.random(points.len())];
        self.count += 1;
        let name = format!("typed{}", self.count);
        let (x, y) = (self.random(90), self.random(90));
        self.type_text(at, &format!("    point {name} = ({x} mm, {y} mm)\n"));
        self.added.push(name);
        if self.added.len() > MOST_ADDED {
            let name = self.added.remove(0);
            if let Some(i) = self.text.find(&format!("    point {name} = ")) {
                let end = self.end_of(i);
                self.press(i, end + 1 - i, "");
            }
        }
    }

    /// Another last digit in a number: a value is tried, and taken back.
    fn other_digit(&mut self) {
        let start = self.line();
        let end = self.end_of(start);
        let Some(i) = self.text[start..end].find(|c: char| c.is_ascii_digit()).map(|n| start + n) else {
            return;
        };
        let digit = (b'1' + self.random(9) as u8) as char;
        self.press(i, 1, "");
        self.press(i, 0, &digit.to_string());
        self.undo();
    }

    /// Begins a statement behind a line, and deletes it letter by letter.
    fn half_a_thought(&mut self) {
        let start = self.line();
        let from = self.end_of(start);
        let thoughts = [
            "\n    hinge x: base to ",
            "\n    minimize {",
            " * (",
            "\n    require max(error(",
            " }",
            "\n    let ü",
        ];
        let thought = thoughts[self.random(thoughts.len())];
        let mut at = self.type_text(from, thought);
        while at > from {
            let last = self.text[..at].chars().next_back().map_or(1, char::len_utf8);
            at -= last;
            self.press(at, last, "");
        }
    }

    fn comment(&mut self) {
        let start = self.line();
        let from = self.end_of(start);
        let at = self.type_text(from, "  // 30 µm, 𝛼 = 2");
        // Selected and cut.
        self.press(from, at - from, "");
    }

    /// Some lines from elsewhere, which are in the way and taken back.
    fn paste(&mut self) {
        let (from, to) = (self.line(), self.line());
        let mut end = from;
        for _ in 0..=self.random(6) {
            end = (self.end_of(end) + 1).min(self.text.len());
        }
        let copied = self.text[from..end].to_string();
        self.press(to, 0, &copied);
        self.undo();
    }

    /// A line goes below the next one, and mostly back.
    fn move_line(&mut self) {
        let start = self.line();
        let (end, next) =
            (self.end_of(start) + 1, self.end_of((self.end_of(start) + 1).min(self.text.len())) + 1);
        if next > self.text.len() || end >= next {
            return;
        }
        let swapped = format!("{}{}", &self.text[end..next], &self.text[start..end]);
        self.press(start, next - start, &swapped);
        self.undo();
    }

    /// From the end of a line backwards, and all of it back at once.
    fn delete_words(&mut self) {
        let start = self.line();
        let mut at = self.end_of(start);
        for _ in 0..=self.random(20) {
            let last = self.text[start..at].chars().next_back().map_or(0, char::len_utf8);
            if last > 0 {
                at -= last;
                self.press(at, last, "");
            }
        }
        self.undo();
    }
}
