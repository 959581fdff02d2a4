//! What is read: samples, a small file's tree and AST, the later language, text in odd encodings.

use crate::{CHEBYSHEV, CROSSED_LEAVES};
use flexura::syntax::ast::{BinaryOp, ExprKind, Item, Load, Profile, StatementKind};
use flexura::syntax::{Parse, parse};

/// Parses text that must be right.
fn read(text: &str) -> Parse {
    let parse = parse(0, text);
    assert_eq!(parse.tree.print(text), text);
    assert_eq!(parse.diagnostics, []);
    parse
}

/// The statements of `mechanism m { … }` around `body`.
fn statements(body: &str) -> Vec<StatementKind> {
    let text = format!("mechanism m {{\n{body}\n}}\n");
    match read(&text).file.items.into_iter().next() {
        Some(Item::Mechanism(m)) => m.statements.into_iter().map(|s| s.kind).collect(),
        other => panic!("{other:?}"),
    }
}

/// The value of `let x = TEXT`, as a string with explicit grouping.
fn value(text: &str) -> String {
    match statements(&format!("let x = {text}")).as_slice() {
        [StatementKind::Let { value, .. }] => grouped(&value.kind),
        other => panic!("{other:?}"),
    }
}

fn grouped(kind: &ExprKind) -> String {
    let list = |items: Vec<String>| items.join(", ");
    match kind {
        ExprKind::Number { value, unit } => {
            let unit: String = unit.iter().map(|f| format!(" {}^{}", f.symbol.node, f.exponent)).collect();
            format!("{value}{unit}")
        }
        ExprKind::Name(path) => path.iter().map(|i| i.node.as_str()).collect::<Vec<_>>().join("."),
        ExprKind::Text(text) => format!("{text:?}"),
        ExprKind::Tuple(items) => format!("<{}>", list(items.iter().map(|e| grouped(&e.kind)).collect())),
        ExprKind::Negate(a) => format!("(-{})", grouped(&a.kind)),
        ExprKind::Binary(op, a, b) => {
            let op = match op {
                BinaryOp::Add => '+',
                BinaryOp::Subtract => '-',
                BinaryOp::Multiply => '*',
                BinaryOp::Divide => '/',
                BinaryOp::Power => '^',
            };
            format!("({} {op} {})", grouped(&a.kind), grouped(&b.kind))
        }
        ExprKind::Call { function, arguments } => {
            let argument = |a: &flexura::syntax::ast::Argument| match &a.name {
                Some(name) => format!("{} = {}", name.node, grouped(&a.value.kind)),
                None => grouped(&a.value.kind),
            };
            format!("{}({})", function.node, list(arguments.iter().map(argument).collect()))
        }
        ExprKind::Free { start, lower, upper } => {
            format!("free {} in {} .. {}", grouped(&start.kind), grouped(&lower.kind), grouped(&upper.kind))
        }
        ExprKind::About { body, axis } => format!("({} about {})", body.node, grouped(&axis.kind)),
        ExprKind::Broken => "broken".into(),
    }
}

#[test]
fn samples_are_read_without_a_diagnostic() {
    let chebyshev = read(CHEBYSHEV).file;
    assert_eq!((chebyshev.uses.len(), chebyshev.items.len()), (4, 1));
    let Some(Item::Mechanism(mechanism)) = chebyshev.items.first() else { panic!("no mechanism") };
    assert_eq!(mechanism.statements.len(), 27);
    let crossed = read(CROSSED_LEAVES).file;
    let Some(Item::Flexure(flexure)) = crossed.items.first() else { panic!("no flexure") };
    assert_eq!((flexure.name.node.as_str(), flexure.statements.len()), ("crossed_leaves", 8));
    let later = |s: &&flexura::syntax::ast::Statement| matches!(s.kind, StatementKind::Later { .. });
    assert_eq!(mechanism.statements.iter().chain(&flexure.statements).filter(later).count(), 0);
}

#[test]
fn operators_group_as_in_mathematics() {
    for (text, expected) in [
        ("1 + 2 * 3 - 4", "((1 + (2 * 3)) - 4)"),
        ("a / b * c", "((a / b) * c)"),
        ("-a ^ 2", "(-(a ^ 2))"),
        ("a ^ -2 * b", "((a ^ -2) * b)"),
        ("a - -b", "(a - (-b))"),
        ("(a + b) * c", "((a + b) * c)"),
        ("(a, b + 1, -c)", "<a, (b + 1), (-c)>"),
        ("f(g(), x = 1 + 2,)", "f(g(), x = (1 + 2))"),
        ("rigur.strength / 1.5", "(rigur.strength / 1.5)"),
        ("\"a \\ b\"", "\"a \\\\ b\""),
        ("a +\n  b", "(a + b)"),
        ("a // left\n  + b", "(a + b)"),
        ("f(a,\n\n  // note\n  b)", "f(a, b)"),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
}

#[test]
fn a_unit_is_written_without_spaces_and_ends_where_a_clause_begins() {
    for (text, expected) in [
        ("2.5 mm", "2.5 mm^1"),
        ("2.5mm", "2.5 mm^1"),
        ("1e-3 m", "0.001 m^1"),
        ("8 N*mm", "8 N^1 mm^1"),
        ("1.2 g/cm^3", "1.2 g^1 cm^-3"),
        ("9.81 m/s^2", "9.81 m^1 s^-2"),
        ("3 mm^-2", "3 mm^-2"),
        ("20 %", "20 %^1"),
        ("2 mm * r", "(2 mm^1 * r)"),
        ("8 N*mm * t", "(8 N^1 mm^1 * t)"),
        ("2 mm/2", "(2 mm^1 / 2)"),
        ("1 in", "1 in^1"),
        ("1 in / 2", "(1 in^1 / 2)"),
        ("free 1 in 0 .. 2", "free 1 in 0 .. 2"),
        ("free 1 in a .. b", "free 1 in a .. b"),
        ("free 0 in -1 .. 1", "free 0 in (-1) .. 1"),
        ("free 1 in in 0.5 in .. 2 in", "free 1 in^1 in 0.5 in^1 .. 2 in^1"),
        ("free 35 deg in -150 deg .. 150 deg", "free 35 deg^1 in (-150 deg^1) .. 150 deg^1"),
        ("free a in 0.5 * a..2 * a", "free a in (0.5 * a) .. (2 * a)"),
    ] {
        assert_eq!(value(text), expected, "{text}");
    }
    let joint = statements(
        "hinge a: b to c, d at A layer -1 pin 3 in into b toward A as t { w = 1, h = 2 mm\n z = 3 }",
    );
    let [StatementKind::Joint(joint)] = joint.as_slice() else { panic!("{joint:?}") };
    assert_eq!(joint.bodies.len(), 3);
    assert_eq!(joint.pin.as_ref().map(|p| grouped(&p.kind)).as_deref(), Some("3 in^1"));
    assert_eq!(joint.layer.as_ref().map(|p| grouped(&p.kind)).as_deref(), Some("(-1)"));
    assert_eq!(joint.template.as_ref().map(|t| t.overrides.len()), Some(3));
}

#[test]
fn keywords_are_names_where_no_statement_starts() {
    let text = "let let = point + rod * 2\npoint at = (layer, to)\nhinge hinge: link to ground at at";
    assert_eq!(statements(text).len(), 3);
}

#[test]
fn loads_have_three_forms() {
    let kinds = statements(
        "load 4 N * t along (0, 0, 1) on knuckle at W
        load moment 8 N*mm about -z on knuckle
        load gravity (0, -1, 0)
        cycle in 20 steps over 1 s",
    );
    let words: Vec<String> = kinds
        .iter()
        .map(|s| match s {
            StatementKind::Load(load) => match &**load {
                Load::Force { body, .. } => format!("force on {}", body.node),
                Load::Moment { body, .. } => format!("moment on {}", body.node),
                Load::Gravity { .. } => "gravity".into(),
            },
            StatementKind::Cycle { over, .. } => format!("cycle {}", over.is_some()),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(words, ["force on knuckle", "moment on knuckle", "gravity", "cycle true"]);
}

#[test]
fn statements_of_the_whole_language_are_known_by_their_keyword() {
    let body = "place right = half at (0 mm,\n  0 mm) turned 90 deg about y
        mirror left = right across yz sharing a, b
        mount xl320 on a at S
        string cable: a at C1 to palm via C2
        variant ring {
            x = 1
            knee.thickness = 2 mm, y = 3
        }
        assert x < 2 \"message { not closed\"
        case heavy {
            load 1 N along x on a at S
        }
        for i in 0 .. 4 {
            place finger[i] = one at (i * 20 mm, 0 mm)
            mirror left[ i + 1 ] = finger[i] across yz
        }
        drive servo by keys linear {
            0 %: 0 deg, 25 %: 35 deg
        } with xl320 continuous
        drive cable from 0 mm to 5 mm with xl320 drum 8 mm
        load 4 N along (0, 0, 1) on knuckle at W // weight";
    let kinds = statements(body);
    let words: Vec<String> = kinds
        .iter()
        .map(|s| match s {
            StatementKind::Later { keyword } => keyword.node.clone(),
            StatementKind::Place(place) => {
                assert!(place.turned.is_some() && place.scale.is_none() && place.merging.is_empty());
                format!("place {} {}", place.name.node, place.mechanism.node)
            }
            StatementKind::Mirror(mirror) => {
                let shared: Vec<&str> = mirror.sharing.iter().map(|s| s.node.as_str()).collect();
                format!("mirror {} {} {} {shared:?}", mirror.name.node, mirror.of.node, mirror.plane.node)
            }
            StatementKind::Drive {
                profile: Profile::Keys { smooth: false, keys, .. },
                motor,
                continuous,
                ..
            } => {
                format!("{} keys {:?} {continuous}", keys.len(), motor.as_ref().map(|m| m.node.as_str()))
            }
            StatementKind::Load(_) => "load".into(),
            StatementKind::Mount(m) => format!("mount {} on {}", m.motor.node, m.body.node),
            StatementKind::Variant(variant) => {
                let set: Vec<&str> = variant.settings.iter().map(|(path, _)| path.node.as_str()).collect();
                format!("variant {} {set:?}", variant.name.node)
            }
            StatementKind::Case(case) => format!("case {} {}", case.name.node, case.statements.len()),
            StatementKind::Assert(assert) => format!("assert {}", assert.message.node),
            StatementKind::For(text) => {
                let names = text.statements.iter().map(|s| match &s.kind {
                    StatementKind::Place(place) => place.name.node.as_str(),
                    StatementKind::Mirror(mirror) => mirror.name.node.as_str(),
                    other => panic!("{other:?}"),
                });
                format!("for {} {:?}", text.variable.node, names.collect::<Vec<_>>())
            }
            StatementKind::String(cable) => format!("string via {}", cable.via.len()),
            StatementKind::Drive { drum: Some(_), continuous, .. } => format!("drum {continuous}"),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(
        words,
        [
            "place right half",
            "mirror left right yz [\"a\", \"b\"]",
            "mount xl320 on a",
            "string via 1",
            "variant ring [\"x\", \"knee.thickness\", \"y\"]",
            "assert message { not closed",
            "case heavy 1",
            "for i [\"finger[i]\", \"left[i+1]\"]",
            "2 keys Some(\"xl320\") true",
            "drum false",
            "load"
        ]
    );
}

#[test]
fn drives_have_three_forms_and_universal_joints_two_axes() {
    let kinds = statements(
        "drive a from 0 deg to 90 deg
        drive b by 20 deg * sin(360 deg * t) + keys with xl320
        drive c by keys smooth { 0 %: 0 mm
            50 %: 2 * r // half
            100 %: 0 mm, }
        universal hook: base to rod at P axis y and (0, 0, 1) layer 2",
    );
    let forms: Vec<String> = kinds
        .iter()
        .map(|s| match s {
            StatementKind::Drive { profile: Profile::Range(..), .. } => "range".into(),
            StatementKind::Drive { profile: Profile::By(e), motor, .. } => {
                format!("by {} {}", matches!(e.kind, ExprKind::Binary(..)), motor.is_some())
            }
            StatementKind::Drive { profile: Profile::Keys { smooth, keys, .. }, .. } => {
                format!("keys {smooth} {}", keys.len())
            }
            StatementKind::Joint(j) => format!(
                "{} {} {}",
                j.axis.is_some(),
                matches!(j.second_axis.as_ref().map(|e| &e.kind), Some(ExprKind::Tuple(_))),
                j.layer.is_some()
            ),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(forms, ["range", "by true true", "keys true 3", "true true true"]);
}

#[test]
fn documentation_goes_to_what_it_precedes() {
    let text = "//! File.\n/// One.\n///\n///  Two.\nmechanism m {\n/// Param.\nparam a = 1 /// not doc\nlet b = 2\n}\n\
                /// Steel.\nmaterial steel { E = 1 GPa }\n";
    let file = read(text).file;
    let [Item::Mechanism(m), Item::Record(steel)] = file.items.as_slice() else { panic!("{file:?}") };
    assert_eq!((m.doc.as_str(), steel.doc.as_str()), ("One.\n\n Two.", "Steel."));
    let docs: Vec<&str> = m.statements.iter().map(|s| s.doc.as_str()).collect();
    assert_eq!(docs, ["Param.", ""]);
}

#[test]
fn line_ends_tabs_byte_order_mark_and_missing_final_newline_are_fine() {
    let plain = read(CHEBYSHEV).file;
    let shape = |file: &flexura::syntax::ast::File| match file.items.first() {
        Some(Item::Mechanism(m)) => m.statements.len(),
        _ => 0,
    };
    for text in [
        CHEBYSHEV.replace('\n', "\r\n"),
        CHEBYSHEV.replace('\n', "\r"),
        CHEBYSHEV.replace("    ", "\t"),
        format!("\u{FEFF}{CHEBYSHEV}"),
        CHEBYSHEV.trim_end().to_owned(),
        CHEBYSHEV.replace("//!", "//! ☃ ñ \u{0} "),
    ] {
        assert_eq!(shape(&read(&text).file), shape(&plain));
    }
    read("");
    read("// only a comment");
}

/// Every kind of declaration and the finer points of the tree on one page.
const SMALL: &str = "\u{FEFF}edition 1\r
use \"finger.mech\"
/// Steel.
material _steel { E = 200 GPa, rho = 7.8 g/cm^3 }
mechanism m { // a lever
    param r: length = free 2 mm in 1 mm .. 3 mm
    hinge a: base to arm at (r,
        -r) axis z as leaf { size = r }
    broken
    minimize { track(tip) weight 2 }
}
";

#[test]
fn tree_of_a_small_file() {
    crate::snapshot("tree", parse(0, SMALL).tree.outline(SMALL));
}

#[test]
fn ast_of_a_small_file() {
    let parse = parse(0, SMALL);
    // Places are in the tree's snapshot; here they would drown the structure.
    let text = format!("{:#?}", parse.file);
    let mut lines = Vec::new();
    let mut skip = 0;
    for line in text.lines() {
        if line.trim_start().starts_with("at: Origin {") {
            skip = 5;
        }
        if skip == 0 {
            lines.push(line);
        } else {
            skip -= 1;
        }
    }
    crate::snapshot("ast", lines.join("\n"));
    assert_eq!(parse.diagnostics.len(), 1);
}

#[test]
fn places_are_those_of_the_text() {
    let text = "mechanism m {\n  let x = (a + b) * 2 mm // c\n}";
    let file = read(text).file;
    let Some(Item::Mechanism(m)) = file.items.first() else { panic!("no mechanism") };
    let statement = &m.statements[0];
    let at = |o: flexura::diagnostic::Origin| &text[o.start as usize..o.end as usize];
    assert_eq!(at(statement.at), "let x = (a + b) * 2 mm");
    let StatementKind::Let { name, value } = &statement.kind else { panic!("no let") };
    assert_eq!((at(name.at), at(m.name.at)), ("x", "m"));
    let ExprKind::Binary(_, left, right) = &value.kind else { panic!("no product") };
    assert_eq!((at(left.at), at(right.at)), ("a + b", "2 mm"));
    assert_eq!(at(m.at), text);
}
