//! The parameters of what is built: what `--set` takes, with what it came to.

use super::stages::Checked;
use crate::diagnostic::Origin;
use crate::syntax::ast::{Expr, ExprKind, Item, Mechanism, StatementKind};

/// A `param` of a mechanism.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameter {
    /// As `--set` names it: `r`, of a placed mechanism `lambda.r`.
    pub path: String,
    /// What it came to, as it is read: `20 mm`.
    pub text: String,
    /// The number in it; none where it is no single number.
    pub value: Option<f64>,
    /// Its unit, as it is read; empty for a plain number.
    pub unit: String,
    /// The optimiser chooses it.
    pub free: bool,
    /// Bounds, where it is `free` and they are single numbers; in `unit`.
    pub bounds: Option<[f64; 2]>,
    /// `///` lines above it.
    pub doc: String,
}

/// Parameters of what is built and of the mechanisms that it places, in the order of the text. Their values are those
/// of the first use.
pub fn of(checked: &Checked) -> Vec<Parameter> {
    let Some(assembly) = &checked.assembly else { return Vec::new() };
    let mechanisms = || {
        let items = checked.files.iter().flat_map(|f| &f.ast.items);
        items.filter_map(|i| if let Item::Mechanism(m) = i { Some(m) } else { None })
    };
    let mut out = Vec::new();
    for m in mechanisms().filter(|m| m.name.at == assembly.origin) {
        take(checked, m, "", &mut out);
    }
    for m in mechanisms().filter(|m| m.name.at != assembly.origin) {
        if assembly.designs.iter().any(|d| d.origin == m.name.at) {
            take(checked, m, &format!("{}.", m.name.node), &mut out);
        }
    }
    out
}

fn take(checked: &Checked, m: &Mechanism, before: &str, out: &mut Vec<Parameter>) {
    for s in &m.statements {
        let StatementKind::Param { name, value, .. } = &s.kind else { continue };
        let Some(text) = came_to(checked, name.at) else { continue };
        let (value_is, unit) = parts(&text);
        let path = format!("{before}{}", name.node);
        let variable = checked.assembly.iter().flat_map(|a| &a.designs).flat_map(|d| &d.free);
        let variable = variable.filter(|_| is_free(value)).find(|v| v.path == name.node);
        let per = if unit == "deg" { 1.0_f64.to_degrees() } else { 1.0 };
        out.push(Parameter {
            path,
            value: value_is,
            unit,
            free: variable.is_some(),
            bounds: variable.map(|v| [v.lower * per, v.upper * per]),
            doc: s.doc.clone(),
            text,
        });
    }
}

fn is_free(value: &Expr) -> bool {
    matches!(value.kind, ExprKind::Free { .. })
}

fn came_to(checked: &Checked, at: Origin) -> Option<String> {
    checked.values.iter().find(|v| v.at == at).map(|v| v.text.clone())
}

/// Number and unit of `20 mm`; no number in `(1 mm, 2 mm, 0 mm)`.
fn parts(text: &str) -> (Option<f64>, String) {
    let (number, unit) = text.split_once(' ').unwrap_or((text, ""));
    match number.parse() {
        Ok(value) => (Some(value), unit.to_string()),
        Err(_) => (None, String::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::parts;

    #[test]
    fn numbers_are_told_from_points() {
        assert_eq!(parts("20 mm"), (Some(20.0), "mm".into()));
        assert_eq!(parts("0.33333"), (Some(0.33333), String::new()));
        assert_eq!(parts("1.2700e-9 t/mm^3"), (Some(1.27e-9), "t/mm^3".into()));
        assert_eq!(parts("(1 mm, 2 mm, 0 mm)"), (None, String::new()));
    }
}
