//! What keeps a rod a rod while the optimiser moves its ends: one-sided residuals that are zero for
//! every sound shape (see [`Rod::shape_excesses`](crate::rod::Rod::shape_excesses)). They are handed to
//! the quadratic model as they are, one-sided: a wall that the model cannot see is run into again and
//! again, with steps that shrink to nothing.

use super::box_qp::Hinge;
use crate::equilibrium::Model;
use nalgebra::DVector;

/// Cost of violating a limit by the whole of it, twice: ½ · this. One part in a hundred then costs as
/// much as 0.04 mm rms over 60 steps with `track(…, scale = 0.1 mm)`.
const WEIGHT: f64 = 1e5;

/// Cost of the model's rest shapes.
pub fn cost(model: &Model) -> f64 {
    let excesses = model.rods.iter().flat_map(|r| r.rod.shape_excesses());
    excesses.filter(|(e, _)| *e > 0.0).fold(0.0, |sum, (e, _)| sum + 0.5 * WEIGHT * e * e)
}

/// Every limit with its derivatives by the design parameters.
pub fn hinges(model: &Model) -> Vec<Hinge> {
    let mut out = Vec::new();
    for rod in &model.rods {
        for (value, by_parameters) in rod.rod.shape_excesses() {
            let row = rod.dq_dp.tr_mul(&DVector::from_column_slice(&by_parameters));
            out.push(Hinge { weight: WEIGHT, value, row });
        }
    }
    out
}
