//! No text makes the front end panic, lose a byte, stay silent about what it could not read, or
//! take more than linear time.

use crate::{CHEBYSHEV, CROSSED_LEAVES};
use flexura::diagnostic::{SourceMap, json, terminal};
use flexura::syntax::limits::{MAX_BYTES, MAX_NESTING};
use flexura::syntax::tree::{Kind, Node};
use flexura::syntax::{Parse, parse};
use proptest::prelude::*;
use std::time::{Duration, Instant};

/// Parses any text and checks what must hold for every text.
fn survives(text: &str) -> Parse {
    let parse = parse(0, text);
    assert_eq!(parse.tree.print(text), text, "a byte was lost");
    covers(&parse.tree);
    assert_eq!((parse.tree.start, parse.tree.end as usize), (0, text.len()));
    for diagnostic in &parse.diagnostics {
        assert!(!diagnostic.labels.is_empty() && !diagnostic.message.is_empty());
        for label in &diagnostic.labels {
            assert!(text.get(label.at.start as usize..label.at.end as usize).is_some(), "{diagnostic:?}");
        }
    }
    assert!(!recovered(&parse.tree) || !parse.diagnostics.is_empty(), "silent about {text:?}");
    let mut sources = SourceMap::default();
    sources.add("a.mech", text);
    let shown = terminal::render(&parse.diagnostics, &sources, terminal::Style::default());
    assert_eq!(shown.is_empty(), parse.diagnostics.is_empty());
    json::render(&parse.diagnostics, &sources).unwrap();
    parse
}

/// The children of every inner node cover its bytes without gap or overlap.
fn covers(node: &Node) {
    if node.children.is_empty() {
        return;
    }
    let mut at = node.start;
    for child in &node.children {
        assert_eq!(child.start, at, "{:?}", node.kind);
        at = child.end;
        covers(child);
    }
    assert_eq!(at, node.end, "{:?}", node.kind);
}

/// Whether recovery took a part of the text.
fn recovered(node: &Node) -> bool {
    use Kind::{BadField, BadHeading, BadStatement, BadTerm, NoBrace, Stray};
    matches!(node.kind, BadStatement | BadTerm | BadField | BadHeading | Stray | NoBrace)
        || node.children.iter().any(recovered)
}

#[test]
fn every_prefix_of_the_samples() {
    for sample in [CHEBYSHEV, CROSSED_LEAVES] {
        for (end, _) in sample.char_indices() {
            survives(&sample[..end]);
        }
    }
}

#[test]
fn every_deletion_of_one_character() {
    for sample in [CHEBYSHEV, CROSSED_LEAVES] {
        for (at, c) in sample.char_indices() {
            survives(&format!("{}{}", &sample[..at], &sample[at + c.len_utf8()..]));
        }
    }
}

#[test]
fn every_insertion_of_a_bracket_quote_or_line_end() {
    for sample in [CHEBYSHEV, CROSSED_LEAVES] {
        for (at, _) in sample.char_indices().step_by(7) {
            for c in ["{", "}", "(", ")", "\"", "\n", "\0", "/", "\u{FEFF}", "ü", "."] {
                survives(&format!("{}{c}{}", &sample[..at], &sample[at..]));
            }
        }
    }
}

#[test]
fn one_deletion_gives_few_diagnostics() {
    // A mistake of one character must not set off an avalanche.
    for sample in [CHEBYSHEV, CROSSED_LEAVES] {
        for (at, c) in sample.char_indices() {
            let text = format!("{}{}", &sample[..at], &sample[at + c.len_utf8()..]);
            let count = parse(0, &text).diagnostics.len();
            assert!(count <= 3, "{count} diagnostics without byte {at} ({c:?})");
        }
    }
}

#[test]
fn nesting_is_limited_before_parsing_even_on_a_small_stack() {
    let run = || {
        for (open, close) in [("(", ")"), ("f(-", ")"), ("f(a = free ", " in 1 .. 2)")] {
            let nested =
                |n: usize| format!("mechanism m {{\nlet x = {}1{}\n}}\n", open.repeat(n), close.repeat(n));
            assert_eq!(parse(0, &nested(30)).diagnostics, [], "{open}");
            survives(&nested(MAX_NESTING - 2));
            let deep = survives(&nested(20_000));
            assert_eq!(deep.diagnostics.len(), 1);
            assert_eq!(deep.diagnostics[0].code, "E0006");
        }
        for text in ["{\n", "(", "x {\n", "load {\n", "mechanism m {\n", "load ("] {
            survives(&text.repeat(20_000));
            survives(&text.repeat(MAX_NESTING));
        }
        // Quotes and comments must not hide brackets from the limit that the grammar sees.
        for text in ["mechanism \"{ let x = ", "x {\"} \"", "x { // \"", "use \" //"] {
            survives(&format!("{text}{}", "(".repeat(50_000)));
            survives(&format!("mechanism m {{\n{text}{}", "(".repeat(50_000)));
            survives(&format!("{}{}", text.repeat(1000), "{\n".repeat(50_000)));
        }
    };
    // A test thread has 2 MiB; a main thread on some systems has 1 MiB.
    let thread = std::thread::Builder::new().stack_size(1 << 20).spawn(run).unwrap();
    thread.join().unwrap();
}

#[test]
fn long_chains_are_refused_instead_of_exhausting_the_stack_later() {
    let chain = |n: usize| format!("mechanism m {{\nlet x = 1{}\n}}\n", " + 1".repeat(n));
    assert_eq!(survives(&chain(100)).diagnostics, []);
    let long = survives(&chain(100_000));
    assert_eq!(long.diagnostics.len(), 1);
    assert_eq!(long.diagnostics[0].code, "E0013");
}

#[test]
fn files_are_limited_in_size_and_errors_in_number() {
    let large = survives(&"a".repeat(MAX_BYTES + 1));
    assert_eq!(large.diagnostics.len(), 1);
    assert_eq!(large.diagnostics[0].code, "E0005");
    let many = survives(&format!("mechanism m {{\n{}}}\n", "param r 3\n".repeat(1000)));
    assert_eq!(many.diagnostics.len(), 101);
    assert_eq!(many.diagnostics[100].code, "E0014");
    assert_eq!(many.diagnostics[100].message, "900 more errors are not shown");
}

#[test]
fn time_is_linear() {
    // Each was measured below 0.5 s for 200 kB with one busy core; quadratic time would take
    // minutes. Exponential time shows in the short ones of the other tests.
    const LIMIT: Duration = Duration::from_secs(20);
    let long = |text: &str| text.repeat(200_000 / text.len());
    let inside = |text: &str| format!("mechanism m {{\n{text}\n}}\n");
    for text in [
        inside(&long("param r: length = 20 mm\n")),
        inside(&long("parm r = 20 mm\n")),
        inside(&long("param r 20 mm\n")),
        inside(&long("let x = (1\n")),
        inside(&long("x {a} ")),
        inside(&long("solid \" ")),
        inside(&long("load () ")),
        inside(&format!("let x = free {}", long("1 in "))),
        inside(&format!("let x = 1 {}", long("/ "))),
        inside(&format!("let x = 1\n{}", long("// note\n"))),
        inside(&format!("let x = ({} @", long("1,\n"))),
        inside(&format!("let x = {}1\n{}", "f(".repeat(100), long("// note\n"))),
        inside(&format!("hinge a: b to c at d{}", long(" layer 1"))),
        inside(&format!("minimize {{\n{}", long("x y\n"))),
        inside(&format!("{}{}", "x {\n".repeat(100), long("y\n"))),
        long("a "),
        long("}\n"),
        long("\0"),
        long("\""),
        long("edition 1\n"),
        long("mechanism a {\n}\n"),
        long("foo bar {\nx\n}\n"),
    ] {
        let start = Instant::now();
        parse(0, &text);
        let taken = start.elapsed();
        assert!(taken < LIMIT, "{taken:?} for {:?}…", text.chars().take(60).collect::<String>());
    }
}

/// Words and signs of the language, so that random text gets past the first character.
fn token() -> impl Strategy<Value = String> {
    let words = [
        "edition 1",
        "use",
        "mechanism",
        "flexure",
        "material",
        "param",
        "let",
        "point",
        "link",
        "hinge",
        "cycle",
        "drive",
        "minimize",
        "rod",
        "load",
        "require",
        "export",
        "to",
        "at",
        "as",
        "in",
        "free",
        "from",
        "steps",
        "weight",
        "m",
        "x",
        "1",
        "2.5 mm",
        "20 %",
        "N*mm",
        "..",
        "=",
        "<=",
        ":",
        ",",
        ".",
        "+",
        "-",
        "*",
        "/",
        "^",
        "(",
        ")",
        "{",
        "}",
        "\n",
        "\r\n",
        " ",
        "\t",
        "//",
        "///",
        "\"",
        "ü",
        "\0",
        "replaces hinge {\n",
        "mechanism m {\n",
        "}\n",
    ];
    proptest::sample::select(words.to_vec()).prop_map(str::to_owned)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn any_text(text in any::<String>()) {
        survives(&text);
    }

    #[test]
    fn any_words(words in proptest::collection::vec(token(), 0..80)) {
        survives(&words.join(" "));
        survives(&format!("mechanism m {{\n{}", words.concat()));
    }

    #[test]
    fn any_damage(at in 0..CHEBYSHEV.len(), length in 0..40_usize, text in ".{0,8}") {
        let end = (at + length).min(CHEBYSHEV.len());
        if let (Some(before), Some(after)) = (CHEBYSHEV.get(..at), CHEBYSHEV.get(end..)) {
            survives(&format!("{before}{text}{after}"));
        }
    }
}
