//! The formatter: what is shipped has its look, a second time changes nothing, and no text loses a token or a comment.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::skipped;
use flexura::syntax::ast::StatementKind;
use flexura::syntax::format::format;
use flexura::syntax::tree::{Kind, Node};
use flexura::syntax::{ast, parse};
use proptest::prelude::*;
use std::path::{Path, PathBuf};

/// Every `.mech` file below a folder of the project, by its path.
fn files(folder: &str) -> Vec<(String, String)> {
    fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(&path, found);
            } else if path.extension().is_some_and(|e| e == "mech") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut found);
    found.sort();
    assert!(!found.is_empty(), "{folder}");
    found.iter().map(|p| (p.display().to_string(), std::fs::read_to_string(p).unwrap())).collect()
}

fn examples() -> Vec<(String, String)> {
    let mut all = files("examples");
    all.extend(files("stdlib"));
    all
}

/// Tokens and comments in order, without the look of white space.
fn said(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    parse(0, text).tree.leaves(&mut |leaf| {
        if !matches!(leaf.kind, Kind::Space | Kind::Newline | Kind::File) {
            all.push(text[leaf.range()].trim_end_matches([' ', '\t', '\n', '\r']).to_string());
        }
    });
    all
}

/// What must hold for every text: it can be formatted, says the same, and a second time changes nothing.
fn holds(text: &str) -> String {
    let once = format(0, text).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
    assert_eq!(said(&once.text), said(text));
    let twice = format(0, &once.text).unwrap_or_else(|e| panic!("{e:?}\n{}", once.text));
    assert_eq!(twice.text, once.text, "from\n{text}");
    assert_eq!(twice.left, once.left);
    once.text
}

#[test]
fn what_is_shipped_has_the_look() {
    for (name, text) in examples() {
        let new = holds(&text);
        assert!(new == text, "{name} is not formatted: `flexura fmt` does it");
    }
}

#[test]
fn the_tests_own_designs_hold_too() {
    for (_, text) in files("tests") {
        holds(&text);
    }
}

/// White space that a person leaves behind comes out as the shipped look.
#[test]
fn any_white_space_comes_out_the_same() {
    for (name, text) in examples() {
        let mangled: String = text
            .lines()
            .map(|line| {
                let line = line.trim();
                // Within a comment, every space is the author's.
                let (code, comment) = line.split_at(line.find("//").unwrap_or(line.len()));
                if code.contains('"') {
                    // So it is in a text.
                    return format!("\t{line}   \r\n\r\n\r\n");
                }
                let words: Vec<&str> = code.split_whitespace().collect();
                format!("\t{}   {comment}  \r\n\r\n\r\n", words.join("\t "))
            })
            .collect();
        let (new, wanted) = (format(0, &mangled).unwrap().text, text);
        // Blank lines between statements part tables: what remains is compared word by word.
        assert_eq!(said(&new), said(&wanted), "{name}");
        assert!(new.lines().all(|l| l.trim_end() == l), "{name}: white space at the end of a line");
        assert!(!new.contains("\r\n\r\n\r\n") && new.contains("\r\n"), "{name}: at most one blank line");
        let one = |t: &str| t.lines().filter(|l| !l.is_empty()).map(squeezed).collect::<Vec<_>>();
        assert_eq!(one(&new), one(&wanted), "{name}");
    }
}

/// A line with one space in place of several, also at its start where it is a table's second line.
fn squeezed(line: &str) -> String {
    let depth = line.len() - line.trim_start().len();
    // The depth of `along` follows the table above it.
    let depth = if line.trim_start().starts_with("along") { 0 } else { depth };
    format!("{}{}", " ".repeat(depth), line.split_whitespace().collect::<Vec<_>>().join(" "))
}

#[test]
fn broken_statements_stay_as_they_are_and_the_rest_gets_the_look() {
    let text = "mechanism  m{\n  point A=(0 mm,0 mm)\n   parm   r =  3mm // typo\n  point  Long = A+polar( 3mm , 4deg )\n\
                minimize{\n   track( tip )\n     trakc tip  \n}\n}\n}\n";
    let out = format(0, text).unwrap();
    assert_eq!(
        out.text,
        "mechanism m {\n    point A = (0 mm, 0 mm)\n   parm   r =  3mm // typo\n    point Long = A + polar(3 mm, 4 deg)\n    \
         minimize {\n        track(tip)\n     trakc tip\n    }\n}\n}\n"
    );
    assert_eq!(out.left, 3);
}

#[test]
fn an_unclosed_block_is_not_touched() {
    let text = "mechanism a {\n  let   x=1\n\nmechanism b{\n  let   x=1\n}\n";
    let out = holds(text);
    assert_eq!(out, "mechanism a {\n  let   x=1\n\nmechanism b {\n    let x = 1\n}\n");
}

#[test]
fn signs_units_and_brackets() {
    for (raw, wanted) in [
        ("let a=2.5mm", "let a = 2.5 mm"),
        ("let a=90°", "let a = 90°"),
        ("let a=20%", "let a = 20 %"),
        ("let a=1.2 g/cm^3", "let a = 1.2 g/cm^3"),
        ("let a=8N*mm*b", "let a = 8 N*mm*b"),
        ("let a=- b^2*( c-1 )", "let a = -b^2 * (c - 1)"),
        ("let a=b ^ -2", "let a = b^-2"),
        ("param a :length=free 1mm in 0.5mm..2mm", "param a: length = free 1 mm in 0.5 mm .. 2 mm"),
        ("link a{A,B,}layer -1", "link a { A, B, }  layer -1"),
        ("hinge h :a to b , c at P pin 3mm layer 1", "hinge h: a to b, c at P  pin 3 mm  layer 1"),
        ("drive j by keys linear{0%:0deg,100%:1deg}", "drive j by keys linear { 0 %: 0 deg, 100 %: 1 deg }"),
        ("require max(error( t ))<=1mm", "require max(error(t)) <= 1 mm"),
        ("output o=angle( b about z )", "output o = angle(b about z)"),
        ("export stl,arduino( m )", "export stl, arduino(m)"),
    ] {
        let out = holds(&format!("mechanism m {{\n{raw}\n}}\n"));
        assert_eq!(out, format!("mechanism m {{\n    {wanted}\n}}\n"), "{raw}");
    }
}

#[test]
fn line_breaks_are_the_authors() {
    let text = "mechanism m {\nlet a = 1\n+ 2\nlet b = max(\n1,\n// why\n2)\nhinge h: a to b at P as leaf {\nsize = 1 mm\n\
                thickness = 2 mm }\nhinge long: a to b at P\n}\n";
    assert_eq!(
        holds(text),
        "mechanism m {\n    let a = 1\n        + 2\n    let b = max(\n        1,\n        // why\n        2)\n    \
         hinge h: a to b at P  as leaf {\n        size      = 1 mm\n        thickness = 2 mm }\n    hinge long: a to b at P\n}\n"
    );
}

#[test]
fn a_byte_order_mark_stays_and_an_empty_file_is_empty() {
    assert_eq!(holds("\u{FEFF}edition   1"), "\u{FEFF}edition 1\n");
    assert_eq!(holds(""), "");
    assert_eq!(holds("\n \n"), "");
    assert_eq!(holds("// only\n\n\n\n// this"), "// only\n\n// this\n");
}

#[test]
fn what_is_too_large_is_refused() {
    let large = "a".repeat(flexura::syntax::limits::MAX_BYTES + 1);
    assert_eq!(format(0, &large).unwrap_err().code, "E0005");
    let deep = format!("mechanism m {{\nlet x = {}1", "(".repeat(1000));
    assert_eq!(format(0, &deep).unwrap_err().code, "E0006");
}

/// Statements, terms and fields of a file that were understood.
fn understood(text: &str) -> usize {
    let parse = parse(0, text);
    let whole = |s: &&ast::Statement| !matches!(s.kind, StatementKind::Broken { .. });
    let of = |s: &[ast::Statement]| s.iter().filter(whole).count();
    parse
        .file
        .items
        .iter()
        .map(|item| match item {
            ast::Item::Mechanism(m) => 1 + of(&m.statements),
            ast::Item::Flexure(f) => 1 + of(&f.statements),
            ast::Item::Record(r) => 1 + r.fields.len(),
        })
        .sum()
}

fn valid(text: &str) -> bool {
    parse(0, text).diagnostics.is_empty()
}

fn is_broken(node: &Node) -> bool {
    use Kind::{BadField, BadHeading, BadStatement, BadTerm, NoBrace, Stray};
    matches!(node.kind, BadStatement | BadTerm | BadField | BadHeading | Stray | NoBrace)
        || node.children.iter().any(is_broken)
}

/// Every `step`th place of an example: without the character there the rest is still understood, and what is still
/// valid has one look.
fn deletions(designs: Vec<(String, String)>, step: usize) {
    for (name, text) in designs {
        let all = understood(&text);
        for (at, c) in text.char_indices().step_by(step) {
            let less = format!("{}{}", &text[..at], &text[at + c.len_utf8()..]);
            // A line that begins or ends a block holds more than itself; nothing else may take more than its own
            // line and the one that runs into it.
            let line = text[..at].rfind('\n').map_or(0, |n| n + 1);
            let end = at + c.len_utf8();
            let line = &text[line..text[end..].find('\n').map_or(text.len(), |n| end + n)];
            let bracket = line.contains(['{', '}']) || line.starts_with('}');
            let lost = all.saturating_sub(understood(&less));
            assert!(bracket || lost <= 2, "{name}: {lost} statements lost without byte {at} in {line:?}");
            if valid(&less) {
                holds(&less);
            } else if at % 5 == 0 {
                // Broken ones too, but these take three times as long.
                assert!(is_broken(&parse(0, &less).tree) || !parse(0, &less).diagnostics.is_empty());
                holds(&less);
            }
        }
    }
}

/// Every `step`th prefix: what stood on whole lines before its last one is understood.
fn prefixes(designs: Vec<(String, String)>, step: usize) {
    for (name, text) in designs {
        for (end, _) in text.char_indices().step_by(step) {
            let prefix = &text[..end];
            let lines = prefix[..prefix.rfind('\n').unwrap_or(0)].lines();
            // What begins at the left of a block that is open or closed, and goes on.
            let statements = lines.filter(|l| l.starts_with("    ") && !l.starts_with("     ")).filter(|l| {
                l.trim().starts_with(|c: char| c.is_ascii_alphabetic())
                    && !l.ends_with('{')
                    && !l.contains(" = free")
            });
            let wanted = statements.count();
            let got = understood(prefix);
            assert!(got + 3 >= wanted, "{name}: {got} of {wanted} in the first {end} bytes");
            holds(prefix);
        }
    }
}

#[test]
fn deletions_of_one_character() {
    deletions(examples(), 23);
}

#[test]
fn prefixes_of_the_examples() {
    prefixes(examples(), 101);
}

#[test]
fn every_deletion_of_one_character() {
    if !skipped() {
        deletions(files("examples"), 1);
    }
}

#[test]
fn every_prefix() {
    if !skipped() {
        prefixes(files("examples"), 1);
    }
}

/// Words, signs and trivia at random, in the shape of statements often enough to get deep into the formatter.
fn piece() -> impl Strategy<Value = String> {
    let pieces = [
        "mechanism m {\n",
        "flexure f replaces hinge {\n",
        "material p {\n",
        "minimize {\n",
        "rod r {\n",
        "}\n",
        "}",
        "param a: length = ",
        "let   b=",
        "point  C = ",
        "link k { A,B }",
        "ground g{ } layer 1",
        "hinge h: a to b at P",
        " axis x and y ",
        " as leaf {size=1 mm,gap = 2mm}",
        " into a toward Q",
        "from a at cyl(1 mm,2 deg) ",
        "along cyl(1 mm)",
        "drive j from 0 deg to 1 turn with m",
        "track(tip) weight 2",
        "E = 2 MPa",
        "require max(a)<=2 mm",
        "free 1 in 0..2",
        "meet(circle(A,1 mm),b,left)",
        "2.5 mm",
        "90°",
        "-",
        "+",
        "^2",
        "(",
        ")",
        ",",
        ":",
        "..",
        "\"text",
        "\n",
        "\n\n\n",
        "\r\n",
        "  ",
        "\t",
        "// note \n",
        "/// doc\n",
        "//! top\n",
        "ü",
        "\u{FEFF}",
        "solid { x }",
        "for i in 1 {\n y\n}\n",
    ];
    proptest::sample::select(pieces.to_vec()).prop_map(str::to_owned)
}

fn many(cases: u32) -> ProptestConfig {
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(cases) }
}

fn any_pieces(cases: u32) {
    let mut runner = proptest::test_runner::TestRunner::new(many(cases));
    let pieces = proptest::collection::vec(piece(), 0..40);
    runner
        .run(&pieces, |pieces| {
            holds(&pieces.concat());
            holds(&format!("mechanism m {{\n{}\n}}\n", pieces.join("\n")));
            Ok(())
        })
        .unwrap();
}

/// What was found at random once.
#[test]
fn what_is_left_at_the_end_keeps_the_end_of_its_line() {
    for text in ["track(tip) weight 2let b=material p {\n\t", "x {\n  ", "x {\r\n\t", "x {  ", "x {"] {
        holds(text);
    }
}

#[test]
fn a_power_of_a_length_is_no_area() {
    let area = holds("mechanism m {\nrequire a <= 2 mm^2\n}\n");
    assert!(area.contains("2 mm^2"), "{area}");
    let power = holds("mechanism m {\nrequire a <= 2 mm ^ 2\n}\n");
    assert!(power.contains("2 mm ^2"), "{power}");
}

#[test]
fn pieces_at_random() {
    any_pieces(500);
}

#[test]
fn many_pieces_at_random() {
    if !skipped() {
        any_pieces(50_000);
    }
}

/// Numbers that look random, the same in every run (xorshift, Marsaglia 2003).
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n.max(1) as u64) as usize
    }

    /// A place between two characters.
    fn cut(&mut self, text: &str) -> usize {
        let at = self.below(text.len() + 1);
        (0..=at).rev().find(|i| text.is_char_boundary(*i)).unwrap_or(0)
    }
}

/// Shipped files, changed as a fuzzer changes them: pieces taken out, doubled, moved, brought from other files, and signs in between.
fn mutated(rounds: usize) {
    const SIGNS: [&str; 12] = ["{", "}", "(", ")", "\"", "//", "\n", "\r", "..", " free ", "µ", "\u{0}"];
    let texts: Vec<String> = examples().into_iter().map(|f| f.1).collect();
    let mut dice = Dice(0x6d65_6368);
    for _ in 0..rounds {
        let mut text = texts[dice.below(texts.len())].clone();
        for _ in 0..=dice.below(4) {
            let other = &texts[dice.below(texts.len())];
            let (a, b) = (dice.cut(other), dice.cut(other));
            let brought = other[a.min(b)..a.max(b).min(other.len())].to_string();
            let (a, b) = (dice.cut(&text), dice.cut(&text));
            let (a, b) = (a.min(b), a.max(b));
            match dice.below(5) {
                0 => drop(text.drain(a..b)),
                1 => {
                    let twice = text[a..b].to_string();
                    text.insert_str(a, &twice);
                }
                2 => text.insert_str(a, SIGNS[dice.below(SIGNS.len())]),
                3 => text.replace_range(a..b, &brought),
                _ => text.truncate(b),
            }
        }
        assert_eq!(parse(0, &text).tree.print(&text), text);
        holds(&text);
    }
}

#[test]
fn shipped_files_changed_at_random() {
    mutated(100);
}

#[test]
fn shipped_files_changed_very_often() {
    if !skipped() {
        mutated(20_000);
    }
}

proptest! {
    #![proptest_config(many(300))]

    #[test]
    fn any_text(text in any::<String>()) {
        holds(&text);
    }
}
