//! `--set name=value`: values are expressions of the language, parsed like any other text.

use super::codes;
use crate::diagnostic::{Diagnostic, Origin, SourceMap};
use crate::syntax::ast::{Expr, ExprKind, Item, StatementKind};

/// One `--set`.
pub struct Setting {
    /// What is set.
    pub path: String,
    /// To what; none if it could not be understood.
    pub value: Option<Expr>,
    /// Its place in the source map.
    pub at: Origin,
}

impl Setting {
    /// The same once more.
    pub fn again(&self) -> Self {
        Self { path: self.path.clone(), value: self.value.clone(), at: self.at }
    }
}

/// All of them, in order.
#[derive(Default)]
pub struct Settings(pub Vec<Setting>);

/// What stands before the value in the little file that each setting becomes.
const BEFORE: &str = "mechanism set {\n    let value = ";

impl Settings {
    /// Parses the settings; each becomes a file of the source map.
    pub fn parse(set: &[(String, String)], sources: &mut SourceMap, out: &mut Vec<Diagnostic>) -> Self {
        let mut all: Vec<Setting> = Vec::new();
        for (path, text) in set {
            let file = sources.add(format!("--set {path}"), text.clone());
            let at = Origin { file, start: 0, end: text.len() as u32 };
            let value = match expression(file, text) {
                Some(e) => Some(e),
                None => {
                    out.push(
                        Diagnostic::error(
                            codes::SET_SYNTAX,
                            format!("`{text}` is not a value for `{path}`"),
                            at,
                        )
                        .help("write for instance `--set r=25 mm`"),
                    );
                    None
                }
            };
            if all.iter().any(|s| s.path == *path) {
                out.push(Diagnostic::error(codes::DUPLICATE, format!("`{path}` is set twice"), at));
            }
            all.push(Setting { path: path.clone(), value, at });
        }
        Self(all)
    }

    /// The settings of a placed mechanism: `finger.leaf` is its `leaf`.
    pub fn below(&self, mechanism: &str) -> Self {
        let inside = |s: &Setting| {
            let path = s.path.strip_prefix(mechanism)?.strip_prefix('.')?.to_string();
            Some(Setting { path, value: s.value.clone(), at: s.at })
        };
        Self(self.0.iter().filter_map(inside).collect())
    }

    /// Adds what a text gives for a parameter that is not set already.
    pub fn given(&mut self, path: &str, value: Expr) {
        if self.find(path).is_none() {
            let at = value.at;
            self.0.push(Setting { path: path.to_string(), value: Some(value), at });
        }
    }

    /// The setting of `path`: its index and value (none: it was not understood).
    pub fn find(&self, path: &str) -> Option<(usize, Option<&Expr>)> {
        let i = self.0.iter().position(|s| s.path == path)?;
        Some((i, self.0.get(i)?.value.as_ref()))
    }
}

/// The one expression of the wrapped text, if it is nothing else.
fn expression(file: u32, text: &str) -> Option<Expr> {
    if text.trim().is_empty() || text.contains(['\n', '\r']) || text.len() > 4096 {
        return None;
    }
    let parsed = crate::syntax::parse(file, &format!("{BEFORE}{text}\n}}\n"));
    if parsed.diagnostics.iter().any(Diagnostic::is_error) {
        return None;
    }
    let [Item::Mechanism(m)] = parsed.file.items.as_slice() else { return None };
    let [statement] = m.statements.as_slice() else { return None };
    match &statement.kind {
        StatementKind::Let { value, .. } => {
            let mut value = value.clone();
            shift(&mut value);
            Some(value)
        }
        _ => None,
    }
}

/// Makes the places in an expression count from the value's own start.
fn shift(e: &mut Expr) {
    shift_at(&mut e.at);
    match &mut e.kind {
        ExprKind::Number { unit, .. } => unit.iter_mut().for_each(|u| shift_at(&mut u.symbol.at)),
        ExprKind::Name(path) => path.iter_mut().for_each(|p| shift_at(&mut p.at)),
        ExprKind::Tuple(items) => items.iter_mut().for_each(shift),
        ExprKind::Negate(inner) => shift(inner),
        ExprKind::Binary(_, l, r) => {
            shift(l);
            shift(r);
        }
        ExprKind::Call { function, arguments } => {
            shift_at(&mut function.at);
            for a in arguments {
                if let Some(n) = &mut a.name {
                    shift_at(&mut n.at);
                }
                shift(&mut a.value);
            }
        }
        ExprKind::Free { start, lower, upper } => {
            shift(start);
            shift(lower);
            shift(upper);
        }
        ExprKind::About { body, axis } => {
            shift_at(&mut body.at);
            shift(axis);
        }
        ExprKind::Text(_) | ExprKind::Broken => {}
    }
}

fn shift_at(at: &mut Origin) {
    let by = BEFORE.len() as u32;
    at.start = at.start.saturating_sub(by);
    at.end = at.end.saturating_sub(by);
}
