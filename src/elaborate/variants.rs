//! `variant`: the same design with other parameters, set as by `--set`.

use super::codes;
use super::names::suggestion;
use super::settings::{Setting, Settings};
use crate::diagnostic::Diagnostic;
use crate::syntax::ast::{At, Mechanism, StatementKind, Variant};

/// The variants of a mechanism in their order, each name once.
pub fn of<'m>(m: &'m Mechanism, out: &mut Vec<Diagnostic>) -> Vec<&'m Variant> {
    let mut found: Vec<&Variant> = Vec::new();
    for s in &m.statements {
        let StatementKind::Variant(variant) = &s.kind else { continue };
        match found.iter().find(|v| v.name.node == variant.name.node) {
            Some(first) => out.push(twice("variant", &variant.name, first.name.at)),
            None => found.push(variant),
        }
        for (i, (path, _)) in variant.settings.iter().enumerate() {
            let before = variant.settings.iter().take(i).find(|(p, _)| p.node == path.node);
            if let Some((first, _)) = before {
                out.push(twice("setting", path, first.at));
            }
        }
    }
    found
}

fn twice(what: &str, name: &At<String>, first: crate::diagnostic::Origin) -> Diagnostic {
    Diagnostic::error(codes::DUPLICATE, format!("the {what} `{}` is declared twice", name.node), name.at)
        .also(first, "first here")
}

/// What a variant sets, and what is set from outside besides: that counts where both set the same.
pub fn settings(variant: &Variant, outside: &Settings) -> Settings {
    let mut all: Vec<Setting> = outside.0.iter().map(Setting::again).collect();
    for (path, value) in &variant.settings {
        if !all.iter().any(|s| s.path == path.node) {
            all.push(Setting { path: path.node.clone(), value: Some(value.clone()), at: path.at });
        }
    }
    Settings(all)
}

/// A variant that was asked for and is not there.
pub fn missing(name: &str, variants: &[&Variant], m: &Mechanism) -> Diagnostic {
    let known = || variants.iter().map(|v| v.name.node.as_str());
    let message = format!("mechanism `{}` has no variant `{name}`", m.name.node);
    let d = Diagnostic::error(codes::NO_VARIANT, message, m.name.at);
    match suggestion(name, known()) {
        Some(near) => d.help(format!("did you mean `{near}`?")),
        None if variants.is_empty() => d.help(format!("add for instance `variant {name} {{ r = 30 mm }}`")),
        None => d.help(format!("it has: {}", known().collect::<Vec<_>>().join(", "))),
    }
}
