//! Pages made of doc comments: every declaration of the library is described, every example of use compiles, and the site stands
//! by itself.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::doc::text::{Paper, Tone};
use flexura::doc::{Entry, Page, html, library};
use flexura::elaborate::{Options, elaborate};
use std::collections::{BTreeMap, BTreeSet};

fn page(path: &str) -> Page {
    library().into_iter().find(|p| p.path == path).unwrap_or_else(|| panic!("{path}"))
}

#[test]
fn everything_in_the_library_is_described() {
    let pages = library();
    assert!(pages.len() > 45, "{}", pages.len());
    for page in &pages {
        assert!(page.about.len() > 10, "{} says nothing of itself", page.path);
        assert!(page.summary().ends_with(['.', ':']) || page.summary().len() > 10, "{}", page.path);
        assert_eq!(page.items.len(), 1, "{}", page.path);
        for item in &page.items {
            // An import brings the name of the file.
            assert!(page.path.ends_with(&format!(".{}", item.name)), "{}", page.path);
            for p in &item.parameters {
                assert!(!p.about.is_empty(), "{}: parameter {}", page.path, p.name);
                assert!(p.kind.is_some() && p.unit.is_some(), "{}: parameter {}", page.path, p.name);
            }
            let own = page.about.len() + item.about.len();
            let sourced = ["read", "recalled", "ource", "ead", "ecalled", "anual"];
            let told = |words: &[&str]| words.iter().any(|w| item.about.contains(w));
            match item.kind.as_str() {
                // Where each figure is from, and how certain it is.
                "material" | "process" | "motor" => {
                    assert!(told(&sourced) || item.about.contains("typical"), "{}: source?", page.path);
                }
                _ => assert!(own > 80, "{}", page.path),
            }
            assert!(!item.facts.is_empty(), "{}", page.path);
        }
    }
}

/// A design in which the example of an entry stands.
fn host(item: &Entry) -> String {
    let (uses, lines): (Vec<&str>, Vec<&str>) = item.example.lines().partition(|l| l.starts_with("use "));
    let (uses, lines) = (uses.join("\n"), lines.join("\n    "));
    if item.kind == "mechanism" {
        return format!("{uses}\nmechanism whole {{\n    {lines}\n}}\n");
    }
    let mut text = String::new();
    for (line, kind, import) in [
        ("material pla", "material", "std.materials.pla"),
        ("print on fdm", "process", "std.processes.fdm"),
        ("drive motor from 0 deg to 10 deg", "motor", ""),
    ] {
        if item.kind != kind {
            text.push_str(&format!("    {line}\n"));
            if !import.is_empty() {
                text.insert_str(0, &format!("use {import}\n"));
            }
        }
    }
    let (imports, statements): (Vec<&str>, Vec<&str>) = text.lines().partition(|l| l.starts_with("use "));
    format!(
        "{uses}
{}
mechanism host {{
    point P = (0 mm, 0 mm)
    point A = (-40 mm, -15 mm)
    point B = (30 mm, 20 mm)
    point C = (0 mm, -40 mm)
    ground link1 {{ A, P }}
    link   link2 {{ P, B }}
    link   link3 {{ P, C }}
    link   end1  {{ A }}
    link   end2  {{ B }}
    link   end3  {{ C }}
    hinge motor: link1 to end1 at A
    hinge more:  link2 to end2 at B
    hinge last:  link3 to end3 at C
    cycle 10 steps
{}
    {lines}
}}
",
        imports.join("\n"),
        statements.join("\n")
    )
}

#[test]
fn every_example_of_use_compiles() {
    for page in library() {
        for item in &page.items {
            let text = host(item);
            let files = BTreeMap::from([("main.mech".to_string(), text.clone())]);
            let found = elaborate("main.mech", &files, &Options::default());
            assert_eq!(found.diagnostics, [], "{}\n{text}", page.path);
        }
    }
}

#[test]
fn a_page_shows_what_is_written() {
    let crossed = page("std.flexures.crossed_leaves");
    let item = &crossed.items[0];
    assert_eq!((item.kind.as_str(), item.replaces.as_deref()), ("flexure", Some("hinge")));
    let names: Vec<&str> = item.parameters.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["size", "height", "gap", "thickness"]);
    let thickness = &item.parameters[3];
    assert_eq!((thickness.default.as_str(), thickness.unit.as_deref()), ("0.8 mm", Some("mm")));
    assert_eq!(thickness.bounds, Some(("process.least_wall".into(), "2 mm".into())));
    assert_eq!(item.facts[0].value, "upper: a to b, ellipse(thick = thickness, wide = wide)");
    assert!(page("std.flexures.coupled_leaves").items[0].example.contains("link1 to link2, link3 at P"));
    let e = &page("std.materials.rigur").items[0].facts[0];
    assert_eq!((e.label.as_str(), e.value.as_str()), ("E", "1900 MPa"));
    let watt = page("std.mechanisms.watt");
    assert_eq!(watt.imports, ["std.materials.pla", "std.processes.fdm", "std.motors.xl330_m288"]);
    assert!(watt.items[0].facts.iter().any(|f| f.label == "trace" && f.value == "tip = M on coupler"));
}

#[test]
fn pages_of_broken_and_of_odd_files_are_made_of_what_is_understood() {
    let text = "//! A file.\n//!\n//! More <of> it.\n/// One & only.\nmechanism a {\n    /// Its `size`.\n    param s: length = free 3 mm in 1 mm .. 4 mm\n    lnik b { C }\n    rest motor at free 1 deg in 0 deg .. 2 deg\n}\nflexure _hidden replaces hinge {\n}\n";
    let page = Page::of("my designs/a.mech", text);
    assert_eq!((page.about.as_str(), page.summary().as_str()), ("A file.\n\nMore <of> it.", "A file."));
    assert_eq!(page.items.len(), 1, "private names are not shown");
    assert_eq!(page.items[0].parameters[0].bounds, Some(("1 mm".into(), "4 mm".into())));
    assert_eq!(page.items[0].free[0].name, "rest motor");
    assert!(page.items[0].example.starts_with("use \"a.mech\"\nplace one = a { s = 3 mm }"));
    for odd in ["", "}}}", "mechanism", "/// alone\n", "\u{feff}//! mark\n", "material m {\n"] {
        Page::of("x.mech", odd);
    }
    let files = html::site(&[page]).unwrap();
    assert_eq!(files[1].0, "my_designs_a.html");
    assert!(
        files[1].1.contains("More &#60;of&#62; it.") && files[1].1.contains("One &#38; only."),
        "{}",
        files[1].1
    );
    assert!(files[1].1.contains("Its <code>size</code>."));
}

#[test]
fn the_site_stands_by_itself() {
    let pages = library();
    let files = html::site(&pages).unwrap();
    assert_eq!(files.len(), pages.len() + 1);
    let names: BTreeSet<&str> = files.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names.len(), files.len());
    for (name, text) in &files {
        for link in text.split("href=\"").skip(1).map(|l| l.split('"').next().unwrap()) {
            assert!(names.contains(link), "{name} links to {link}");
        }
        for foreign in ["http:", "https:", "src=", "<script", "@import", "url("] {
            assert!(!text.contains(foreign), "{name} has {foreign}");
        }
        for needed in [
            "<!doctype html>",
            "name=\"viewport\"",
            "prefers-color-scheme: dark",
            "charset=\"utf-8\"",
            "<title>",
        ] {
            assert!(text.contains(needed), "{name} lacks {needed}");
        }
    }
    assert_eq!(files, html::site(&pages).unwrap(), "the same each time");
}

#[test]
fn text_keeps_to_its_width() {
    let paint = |_: Tone, text: &str| text.to_string();
    for width in [40, 80, 110] {
        let paper = Paper { width, paint: &paint };
        let pages = library();
        let mut text = paper.list(&pages);
        // Lines of the language and single long words are not broken.
        assert!(text.contains("std.flexures.wire"));
        for p in &pages {
            for line in paper.page(&Page { items: Vec::new(), ..p.clone() }).lines() {
                let words = line.split_whitespace().count();
                assert!(line.chars().count() <= width || words == 1, "{width}: {line}");
            }
            text.push_str(&paper.page(p));
        }
        assert!(
            text.contains("thickness: length = 0.8 mm, free in process.least_wall .. 2 mm\n")
                && text.contains("size: length = shorter_link / 3, in mm"),
            "{text}"
        );
    }
}
