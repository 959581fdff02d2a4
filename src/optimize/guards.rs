//! What keeps a rod a rod while the optimiser moves its ends: one-sided residuals that are zero for
//! every sound shape (see [`Rod::shape_excesses`](crate::rod::Rod::shape_excesses)).

use super::normal::Normal;
use crate::equilibrium::Model;

/// Cost of violating a limit by the whole of it, twice: ½ · this. One part in a hundred then costs as
/// much as 0.1 mm rms over 60 steps with `track(…, scale = 0.1 mm)`; between 1e3 and 1e6 the optimum
/// of Chebyshev is the same, because no limit is active there.
const WEIGHT: f64 = 1e5;

/// Cost of the model's rest shapes.
pub fn cost(model: &Model) -> f64 {
    let excesses = model.rods.iter().flat_map(|r| r.rod.shape_excesses());
    excesses.map(|(excess, _)| 0.5 * WEIGHT * excess * excess).sum()
}

/// The same with derivatives.
pub fn accumulate(model: &Model, out: &mut Normal) {
    for rod in &model.rods {
        for (excess, by_parameters) in rod.rod.shape_excesses() {
            let row = rod.dq_dp.tr_mul(&nalgebra::DVector::from_column_slice(&by_parameters));
            out.add(WEIGHT, excess, row.as_slice());
        }
    }
}
