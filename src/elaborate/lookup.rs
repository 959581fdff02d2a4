//! What to say when a name is not found: near misses, private names, imports that would help.

use super::codes;
use super::eval::{Evaluator, Outcome};
use super::load::{item_name, std_modules};
use super::names::suggestion;
use super::scope::LocalKind;
use crate::diagnostic::{Diagnostic, Edit, Fix, Origin};
use crate::syntax::ast::Ident;
use std::collections::BTreeMap;

fn unknown_value(name: &Ident) -> Diagnostic {
    Diagnostic::error(codes::UNKNOWN_NAME, format!("`{}` is not declared", name.node), name.at)
}

/// A guess at what was meant, with the repair.
pub(super) fn meant(d: Diagnostic, name: &Ident, near: &str) -> Diagnostic {
    d.help(format!("did you mean `{near}`?"))
        .fix(Fix::risky(format!("write `{near}`"), vec![Edit::replace(name.at, near)]))
}

impl<'a> Evaluator<'a> {
    /// The text that imports a module of the standard library: below the other imports, else below the edition, else
    /// at the top.
    fn import(&self, file: u32, module: &str) -> Edit {
        let ast = self.program.modules.iter().find(|m| m.file_id == file).map(|m| &m.file);
        let last = ast.and_then(|f| f.uses.last().map(|u| u.at).or(f.edition.as_ref().map(|e| e.at)));
        match last {
            Some(at) => Edit::replace(Origin { start: at.end, ..at }, format!("\nuse std.{module}")),
            None => Edit::replace(Origin { file, start: 0, end: 0 }, format!("use std.{module}\n")),
        }
    }

    /// A name that should be a value.
    pub(super) fn unknown_name<T>(&mut self, scope: usize, name: &Ident) -> Outcome<T> {
        let Some(s) = self.scopes.get(scope) else { return Err(super::eval::Failed) };
        if self.out.len() > super::MAX_FINDINGS {
            // So much is wrong that looking for suggestions takes longer than it helps.
            return self.finish_unknown(unknown_value(name), name, &[]);
        }
        let mut candidates: Vec<String> = s
            .locals
            .iter()
            .filter(|l| !matches!(l.kind, LocalKind::Thing(_)))
            .map(|l| l.name.clone())
            .collect();
        if let Some(m) = self.program.modules.get(s.module) {
            candidates.extend(m.names.keys().cloned());
        }
        self.finish_unknown(unknown_value(name), name, &candidates)
    }

    /// A suggestion, unless so much is wrong already that looking for one takes too long.
    fn near<'n>(&self, name: &str, candidates: impl IntoIterator<Item = &'n str>) -> Option<String> {
        if self.out.len() > super::MAX_FINDINGS { None } else { suggestion(name, candidates) }
    }

    /// A name that should be an item of a kind (`material`, `flexure`, …).
    pub(super) fn unknown_item<T>(&mut self, scope: usize, name: &Ident, kind: &str) -> Outcome<T> {
        let module = self.scopes.get(scope).map_or(0, |s| s.module);
        let candidates: Vec<String> =
            self.program.modules.get(module).map(|m| m.names.keys().cloned().collect()).unwrap_or_default();
        let d = Diagnostic::error(
            codes::UNKNOWN_NAME,
            format!("there is no {kind} `{}` here", name.node),
            name.at,
        );
        self.finish_unknown(d, name, &candidates)
    }

    fn finish_unknown<T>(&mut self, d: Diagnostic, name: &Ident, candidates: &[String]) -> Outcome<T> {
        if self.half_said.contains(&name.node)
            || self.may_be_imported(d.labels.first().map_or(0, |l| l.at.file), name)
        {
            return Err(super::eval::Failed);
        }
        if name.node.starts_with('_')
            && let Some((place, path)) = self.private(name)
        {
            return self.fail(
                Diagnostic::error(codes::PRIVATE, format!("`{}` is private to `{path}`", name.node), name.at)
                    .also(place, "declared here")
                    .help("a leading `_` keeps a name in its file"),
            );
        }
        let in_std = std_modules().into_iter().find(|m| m.rsplit('.').next() == Some(name.node.as_str()));
        let d = match in_std {
            Some(module) => {
                let d = d.help(format!("add `use std.{module}` at the top of the file"));
                d.fix(Fix::safe("add the import", vec![self.import(name.at.file, &module)]))
            }
            None => match self.near(&name.node, candidates.iter().map(String::as_str)) {
                Some(near) => meant(d, name, &near),
                None => d.label("not found here"),
            },
        };
        self.fail(d)
    }

    /// Whether an import that failed might have brought this name: then it has been reported.
    fn may_be_imported(&self, file: u32, name: &Ident) -> bool {
        use crate::syntax::ast::UseTarget;
        self.program.modules.iter().filter(|m| m.file_id == file).any(|m| {
            m.lacks_file
                || m.file.uses.iter().zip(&m.imported).any(|(u, found)| {
                    matches!(&u.target, UseTarget::Std(path)
                        if !found && path.last().is_some_and(|p| p.node == name.node))
                })
        })
    }

    fn private(&self, name: &Ident) -> Option<(Origin, String)> {
        self.program.modules.iter().find_map(|m| {
            let item = m.file.items.iter().find(|i| item_name(i).node == name.node)?;
            Some((item_name(item).at, m.path.clone()))
        })
    }

    /// The index of a body, joint or trace by name.
    pub(super) fn thing(
        &mut self,
        scope: usize,
        map: &BTreeMap<String, usize>,
        name: &Ident,
        kind: &str,
    ) -> Outcome<usize> {
        if let Some(i) = map.get(&name.node) {
            return Ok(*i);
        }
        if self.half_said.contains(&name.node) {
            return Err(super::eval::Failed);
        }
        let local = self.scopes.get(scope).and_then(|s| s.locals.get(*s.index.get(&name.node)?));
        if let Some(local) = local {
            // A body or joint whose own declaration failed has been reported already.
            let is = match &local.kind {
                LocalKind::Thing(k) if *k == kind => return Err(super::eval::Failed),
                LocalKind::Thing(k) => (*k).to_string(),
                LocalKind::Value { point: true, .. } => "point".into(),
                _ => "value".into(),
            };
            return self.wrong_kind(name, &is, &super::value::with_article(kind));
        }
        let d =
            Diagnostic::error(codes::UNKNOWN_NAME, format!("there is no {kind} `{}`", name.node), name.at);
        let d = match self.near(&name.node, map.keys().map(String::as_str)) {
            Some(near) => meant(d, name, &near),
            None if map.is_empty() => d.help(format!("the mechanism has no {kind}")),
            None => d.help(format!(
                "there {}: {}",
                if map.len() == 1 { "is" } else { "are" },
                map.keys().take(12).map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", ")
            )),
        };
        self.fail(d)
    }
}
