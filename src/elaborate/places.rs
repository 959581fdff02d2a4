//! Places and directions at the ends of a template's rods: `cyl` and `sph` in the frame of the end's body.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Failed, Outcome};
use crate::diagnostic::Diagnostic;
use crate::ir::ExprPoint;
use crate::ir::expr::{ExprId, Node};
use crate::syntax::ast::{Expr, ExprKind};

/// Arguments of a place: name as written, name in paths, dimension, what it is.
type Coordinates = [(&'static str, &'static str, Dimension, &'static str); 3];

const CYLINDER: Coordinates = [
    ("r", "r", Dimension::LENGTH, "the radius of `cyl`"),
    ("φ", "phi", Dimension::ANGLE, "the angle of `cyl`"),
    ("z", "z", Dimension::LENGTH, "the height of `cyl`"),
];
const SPHERE: Coordinates = [
    ("r", "r", Dimension::LENGTH, "the radius of `sph`"),
    ("azimuth", "azimuth", Dimension::ANGLE, "the azimuth of `sph`"),
    ("elevation", "elevation", Dimension::ANGLE, "the elevation of `sph`"),
];
const FORMS: &str = "write `cyl(r, φ)`, `cyl(r, φ, z)` or `sph(r, azimuth, elevation)`";

impl<'a> Evaluator<'a> {
    /// `cyl(r, φ[, z])` or `sph(r, azimuth[, elevation])` as Cartesian components on (e1, e2, e3); free values
    /// inside are called `path.r` and so on.
    pub(super) fn place(&mut self, scope: usize, e: &'a Expr, path: &str) -> Outcome<ExprPoint> {
        let ExprKind::Call { function, arguments } = &e.kind else {
            if matches!(e.kind, ExprKind::Broken) {
                return Err(Failed);
            }
            let message = "a rod's end is given in coordinates of a cylinder or sphere";
            return self.fail(
                Diagnostic::error(codes::TYPE, message, e.at)
                    .help(format!("{FORMS}, in the frame of the end's body")),
            );
        };
        let (coordinates, sphere) = match function.node.as_str() {
            "cyl" => (CYLINDER, false),
            "sph" => (SPHERE, true),
            other => {
                let message = format!("`{other}` does not give the place of a rod's end");
                return self
                    .fail(Diagnostic::error(codes::UNKNOWN_FUNCTION, message, function.at).help(FORMS));
            }
        };
        let slots = self.arguments(function, arguments, &coordinates.map(|c| c.0), 2)?;
        let mut ids: Vec<Outcome<ExprId>> = Vec::new();
        for (slot, (_, name, dim, what)) in slots.into_iter().zip(coordinates) {
            ids.push(match slot {
                Some(e) => self.eval_scalar(&Env::named(scope, format!("{path}.{name}")), e, dim, what),
                None => self.constant(0.0, e.at),
            });
        }
        let [r, phi, third]: [Outcome<ExprId>; 3] = ids.try_into().map_err(|_| Failed)?;
        let (r, phi, third) = (r?, phi?, third?);
        if !sphere {
            let [x, y] = self.polar_components(r, phi, e.at)?;
            return Ok([x, y, third]);
        }
        let [across, z] = self.polar_components(r, third, e.at)?;
        let [x, y] = self.polar_components(across, phi, e.at)?;
        Ok([x, y, z])
    }

    /// Half of a value.
    pub(super) fn half(&mut self, id: ExprId, e: &Expr) -> Outcome<ExprId> {
        let half = self.constant(0.5, e.at)?;
        self.node(Node::Mul(id, half), e.at)
    }
}
