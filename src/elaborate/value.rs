//! What an expression can evaluate to. Every number inside is a node of the design's expression
//! graph, so that free values flow through.

use super::dimension::Dimension;
use crate::ir::ExprPoint;
use crate::ir::expr::ExprId;

/// A number with its dimension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scalar {
    /// The number in internal units.
    pub id: ExprId,
    /// Its dimension.
    pub dim: Dimension,
}

/// Index of a record: module and item within it.
pub type ItemRef = (usize, usize);

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Number or quantity.
    Scalar(Scalar),
    /// A place in space, mm.
    Point(ExprPoint),
    /// A difference of points (length), or a direction (plain numbers).
    Vector {
        /// Components.
        v: ExprPoint,
        /// Their dimension.
        dim: Dimension,
        /// Written as a tuple just here: may still become a point.
        literal: bool,
    },
    /// A circle in a plane normal to z.
    Circle {
        /// Centre, mm.
        center: ExprPoint,
        /// Radius, mm.
        radius: ExprId,
    },
    /// Text.
    Text(String),
    /// A material, process or motor.
    Record(ItemRef),
}

impl Value {
    /// In plain words, for messages: "length (mm)", "point", "direction".
    pub fn describe(&self) -> String {
        match self {
            Value::Scalar(s) => s.dim.to_string(),
            Value::Point(_) => "point".into(),
            Value::Vector { dim, .. } if dim.is_number() => "direction".into(),
            Value::Vector { dim, .. } if *dim == Dimension::LENGTH => "vector (mm)".into(),
            Value::Vector { dim, .. } => format!("vector of {dim}"),
            Value::Circle { .. } => "circle".into(),
            Value::Text(_) => "text".into(),
            Value::Record(_) => "record".into(),
        }
    }

    /// The same with an article: "a length (mm)", "an angle (deg)".
    pub fn a(&self) -> String {
        with_article(&self.describe())
    }
}

/// "a length", "an angle"; text that already starts with an article is kept.
pub fn with_article(text: &str) -> String {
    if text.starts_with("a ") || text == "text" {
        return text.into();
    }
    let vowel = text.starts_with(['a', 'e', 'i', 'o', 'u']);
    format!("{} {text}", if vowel { "an" } else { "a" })
}
