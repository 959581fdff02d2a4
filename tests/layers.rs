//! Who sees whom: each dependency in one folder, and no numerics before the waist `ir/`, no text after it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::{Path, PathBuf};

/// Every Rust file below `src/`, as its path there and its text.
fn sources() -> Vec<(String, String)> {
    fn collect(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    collect(&root, &mut found);
    let name = |p: &Path| p.strip_prefix(&root).unwrap().to_str().unwrap().replace('\\', "/");
    found.iter().map(|p| (name(p), std::fs::read_to_string(p).unwrap())).collect()
}

/// Whether code (not a comment) names a path that begins with `word::`.
fn uses(text: &str, word: &str) -> bool {
    let path = format!("{word}::");
    text.lines().filter(|l| !l.trim_start().starts_with("//")).any(|line| {
        line.match_indices(&path)
            .any(|(at, _)| !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_'))
    })
}

#[test]
fn each_dependency_is_seen_by_one_folder() {
    let sources = sources();
    for (name, folder) in [
        ("pest", "syntax/"),
        ("pest_derive", "syntax/"),
        ("miette", "diagnostic/"),
        ("argmin", "optimize/"),
        ("argmin_math", "optimize/"),
        ("boolmesh", "geometry/"),
        ("minijinja", "emit/template.rs"),
        ("askama", "doc/"),
        ("base64", "emit/report/"),
        ("flate2", "emit/report/"),
        ("stl_io", "emit/"),
        ("toml", "lint/"),
        ("gltf_json", "emit/glb/"),
        ("threemf2", "emit/"),
        ("png", "emit/"),
        ("dxf", "emit/"),
        ("chrono", "emit/"),
        ("lsp_server", "lsp/"),
        ("lsp_types", "lsp/"),
        ("clap", "cli/"),
        ("notify", "cli/"),
        ("tiny_http", "cli/view/"),
        ("getrandom", "cli/view/"),
        ("indicatif", "cli/"),
        ("ctrlc", "cli/"),
        ("quick_xml", "cli/"),
    ] {
        for (file, text) in &sources {
            // The command and the lints each read their table of `flexura.toml`; pages and the report are HTML.
            let shared = (name == "toml" && file == "cli/config.rs")
                || (name == "askama" && file.starts_with("emit/report/"))
                // One reads what the other writes.
                || (name == "stl_io" && file == "elaborate/stl.rs");
            assert!(!uses(text, name) || file.starts_with(folder) || shared, "{file} uses {name}");
        }
    }
    assert!(
        sources.iter().any(|(f, t)| f.starts_with("diagnostic/") && uses(t, "miette")),
        "the test sees uses"
    );
}

#[test]
fn ir_is_the_waist() {
    let before = ["syntax", "elaborate"];
    let after = ["math", "kinematics", "rod", "equilibrium", "optimize", "geometry", "emit"];
    for (file, text) in sources() {
        let folder = file.split('/').next().unwrap_or("");
        let forbidden: &[&str] = if before.contains(&folder) {
            &after
        } else if after.contains(&folder) || folder == "ir" {
            &before
        } else {
            &[]
        };
        for other in forbidden {
            assert!(!uses(&text, &format!("crate::{other}")), "{file} uses {other}");
        }
    }
}

#[test]
fn the_library_touches_neither_disk_nor_clock() {
    for (file, text) in sources() {
        if file.starts_with("cli/") || file == "main.rs" {
            continue;
        }
        let code = text.split("#[cfg(test)]").next().unwrap_or("");
        for word in ["std::fs", "std::net", "std::process", "std::env", "Instant", "SystemTime"] {
            assert!(!code.contains(word), "{file} uses {word}");
        }
    }
}
