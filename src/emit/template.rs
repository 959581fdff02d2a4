//! The template engine: texts with holes, from what serialises.

use minijinja::value::Serde;
use minijinja::{Environment, UndefinedBehavior, syntax::SyntaxConfig};
use serde::Serialize;

/// Renders the first of some templates (name and text); it may include the others.
///
/// # Errors
/// Where a template is faulty: never a fault of the design.
pub fn render(
    templates: &[(&'static str, &'static str)],
    context: &impl Serialize,
) -> Result<String, String> {
    let faulty = |e: minijinja::Error| e.to_string();
    let mut environment = Environment::new();
    let syntax = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .keep_trailing_newline(true)
        .build()
        .map_err(faulty)?;
    environment.set_syntax(syntax);
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    for (name, text) in templates {
        environment.add_template(name, text).map_err(faulty)?;
    }
    let name = templates.first().map(|t| t.0).unwrap_or_default();
    environment.get_template(name).map_err(faulty)?.render(Serde(context)).map_err(faulty)
}
