//! What the released mechanism does, as the report tells it.

use crate::diagnostic::Diagnostic;
use crate::equilibrium::{Cycle, Landscape, Layout, Model, Snap, landscape};
use crate::ir::{Design, DriveUnit};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Drive values by `NAME_deg` or `NAME_mm`, as in the table of `simulate`.
pub type DriveValues = BTreeMap<String, f64>;

/// Rest states with the drives released, of several drives along the cycle's way only.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stability {
    /// In the order of the only drive's value, else along the cycle.
    pub rest_states: Vec<RestState>,
    /// Where the load of the only drive has a maximum: held softly, it would run on from there. Between two states of
    /// the cycle interpolated.
    pub limit_points: Vec<LimitPoint>,
    /// Jumps although the drives are held.
    pub snaps: Vec<SnapThrough>,
}

/// A state in which the released mechanism stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RestState {
    /// Drive values there.
    pub drives: DriveValues,
    /// Place along the cycle, in states.
    pub state: f64,
    /// Elastic energy, N·mm.
    pub energy_n_mm: f64,
    /// Largest stress that stays, MPa.
    pub stress_mpa: f64,
    /// Work to reach the next rest state towards larger drive values (or along the cycle), N·mm.
    pub barrier_up_n_mm: Option<f64>,
    /// The same towards smaller ones.
    pub barrier_down_n_mm: Option<f64>,
}

/// A maximum of the load.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LimitPoint {
    /// Drive value there.
    pub drives: DriveValues,
    /// Place along the cycle, in states.
    pub state: f64,
    /// Torque, N·mm, or force, N.
    pub load: f64,
}

/// A jump.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SnapThrough {
    /// Drive values just before.
    pub drives: DriveValues,
    /// State reached by it.
    pub state: usize,
    /// Energy lost, N·mm.
    pub lost_n_mm: f64,
}

/// The released mechanism, and findings.
pub(super) fn released(
    design: &Design,
    layout: &Layout,
    model: &Model,
    cycle: &Cycle,
    found: &mut Vec<Diagnostic>,
) -> Stability {
    // Nothing pushes a mechanism without flexures and loads anywhere: its torques are rounding errors.
    if design.rods.is_empty() && design.loads.is_empty() {
        return Stability::default();
    }
    match landscape(model, cycle) {
        Ok(l) => {
            found.extend(l.snaps.iter().map(|s| snapped(design, s)));
            report(design, layout, model, cycle, &l)
        }
        Err(_) => {
            found.push(
                Diagnostic::warning(
                    "W0606",
                    "the rest states of the released mechanism could not be found",
                    design.origin,
                )
                .help("a state between two of the cycle has no equilibrium: more steps may tell where"),
            );
            Stability::default()
        }
    }
}

fn report(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle, l: &Landscape) -> Stability {
    let rest_states = l.rests.iter().map(|r| RestState {
        drives: values(design, &r.balance.drives),
        state: r.balance.place,
        energy_n_mm: r.balance.equilibrium.energy_n_mm,
        stress_mpa: r.balance.equilibrium.max_stress_mpa(model),
        barrier_up_n_mm: r.barrier_up_n_mm,
        barrier_down_n_mm: r.barrier_down_n_mm,
    });
    let mut limit_points = Vec::new();
    for (s, pair) in l.stiffness.windows(2).enumerate() {
        let Some(drive) = layout.drives.first() else { break };
        let [v0, v1] = [drive.values[s], drive.values[s + 1]];
        // Along rising values.
        let falls = if v1 > v0 { pair[0] > 0.0 && pair[1] <= 0.0 } else { pair[0] <= 0.0 && pair[1] > 0.0 };
        if falls {
            let u = pair[0] / (pair[0] - pair[1]);
            let load = |s: usize| cycle.states[s].drive_load(model, 0);
            limit_points.push(LimitPoint {
                drives: values(design, &[v0 + u * (v1 - v0)]),
                state: s as f64 + u,
                load: load(s) + u * (load(s + 1) - load(s)),
            });
        }
    }
    let snaps = l.snaps.iter().map(|s| SnapThrough {
        drives: values(design, &s.drives),
        state: s.state,
        lost_n_mm: s.lost_n_mm,
    });
    Stability { rest_states: rest_states.collect(), limit_points, snaps: snaps.collect() }
}

fn values(design: &Design, drives: &[f64]) -> DriveValues {
    let named = |(d, v): (&crate::ir::Drive, &f64)| match d.unit {
        DriveUnit::Rad => (format!("{}_deg", d.name), v.to_degrees()),
        DriveUnit::Mm => (format!("{}_mm", d.name), *v),
    };
    design.drives.iter().zip(drives).map(named).collect()
}

pub(super) fn snapped(design: &Design, snap: &Snap) -> Diagnostic {
    let message = format!(
        "the mechanism snaps on the way to state {}, although its drives are held: {:.3} N·mm are lost",
        snap.state, snap.lost_n_mm
    );
    let at = design.drives.first().map_or(design.origin, |d| d.origin);
    Diagnostic::warning("W0605", message, at)
        .label(format!("last before it: {}", shown(design, &snap.drives)))
        .help("thicken or shorten the flexures that work in compression, or stay on this side")
}

/// `motor = 30 deg, pull = 2 mm`.
pub(super) fn shown(design: &Design, drives: &[f64]) -> String {
    let one = |(d, v): (&crate::ir::Drive, &f64)| format!("{} = {}", d.name, d.unit.show(*v));
    design.drives.iter().zip(drives).map(one).collect::<Vec<_>>().join(", ")
}
