//! A design as it stands: read, given values, simulated and measured. Nothing is written; it is what `test` asks of
//! many designs and `diff` of two versions of one.

use super::report::{BuildOutcome, Origin};
use super::stages::{Failed, Plans, Simulation, Stages};
use super::{Progress, Request, assembly, check_locked, front_end, keep, solve_all, tell_once, values_of};
use crate::diagnostic::Diagnostic;
use crate::elaborate::Files;
use crate::ir::{ExportKind, Solution};
use std::sync::atomic::AtomicBool;

/// Where the values of the free variables come from.
#[derive(Clone, Copy)]
pub enum Values<'a> {
    /// The lock's where it is current, else the design's own start.
    LockOrStart,
    /// The lock's; a design without a current one is an error (E0714).
    Lock,
    /// The lock's where it is current, else the optimiser's.
    Solve(&'a dyn Progress, &'a AtomicBool),
}

/// How far to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Extent {
    /// The values only: nothing is simulated.
    Values,
    /// Simulated and measured.
    Measures,
    /// The printed parts are made as well, to weigh them.
    Volume,
}

/// What was found.
#[derive(Clone, Debug, Default)]
pub struct Examined {
    /// As a build tells it: `after` and `requirements` belong to the values below, `before` and the artefacts stay
    /// empty.
    pub outcome: BuildOutcome,
    /// Values of the free variables of each design, in its order.
    pub values: Vec<Vec<f64>>,
    /// Where those of each design came from.
    pub origins: Vec<Origin>,
    /// Volume of all printed parts, mm³; none where it was not asked for, or nothing is printed.
    pub volume_mm3: Option<f64>,
}

/// Reads a design, and simulates and measures it as far as is wanted.
pub fn examine(
    request: &Request,
    from: Values,
    extent: Extent,
    stages: &dyn Stages,
    files: &dyn Files,
) -> Examined {
    let mut found = Examined::default();
    run(request, from, extent, stages, files, &mut found);
    found
}

/// `None` ends the way early; the outcome says why.
fn run(
    request: &Request,
    from: Values,
    extent: Extent,
    stages: &dyn Stages,
    files: &dyn Files,
    found: &mut Examined,
) -> Option<()> {
    let out = &mut found.outcome;
    let assembly = front_end(request, stages, files, out)?;
    (found.values, found.origins) = match from {
        Values::Solve(progress, cancel) => {
            let solutions = solve_all(request, &assembly, stages, progress, cancel, out)?;
            let values = assembly.designs.iter().zip(&solutions).map(|(d, s)| values_of(d, s)).collect();
            (values, vec![out.solved_from; assembly.designs.len()])
        }
        Values::Lock | Values::LockOrStart => {
            let must = matches!(from, Values::Lock);
            let locked = check_locked(request, &assembly, must, out)?;
            let values = |(d, lock): (_, &Option<Solution>)| match lock {
                Some(solution) => values_of(d, solution),
                None => super::starts(d),
            };
            let origin = |lock: &Option<Solution>| lock.as_ref().map_or(Origin::Start, |_| Origin::Lock);
            let origins: Vec<Origin> = locked.iter().map(origin).collect();
            let all_locked = origins.iter().all(|o| *o == Origin::Lock);
            out.solved_from = if all_locked { Origin::Lock } else { Origin::Start };
            (assembly.designs.iter().zip(&locked).map(values).collect(), origins)
        }
    };
    if extent < Extent::Measures {
        return Some(());
    }
    let pairs = || assembly.designs.iter().zip(&found.values);
    let simulations =
        pairs().map(|(d, v)| stages.simulate(d, v)).collect::<Result<Vec<Simulation>, Failed>>();
    let simulations = keep(simulations, &mut out.diagnostics)?;
    let between = stages.between(&assembly, &simulations);
    tell_once(simulations.iter().flat_map(|s| s.diagnostics.iter().cloned()), out);
    tell_once(between.diagnostics.iter().cloned(), out);
    let placed = assembly::place(&assembly, &simulations);
    out.after = Some(assembly::measure_all(&assembly, &placed, &between));
    out.requirements = assembly::check_all(&assembly, &simulations, &placed, &between, &mut out.diagnostics);
    if extent >= Extent::Volume && assembly.exports.iter().any(|e| e.export.kind == ExportKind::Stl) {
        // What cannot be printed is no finding here: a build tells it.
        let mut solids = assembly.clone();
        // Without exports each part comes once, whatever is asked for.
        solids.exports.clear();
        let parts = stages.parts(&solids, &found.values, &Plans::of(&simulations, &between)).ok();
        found.volume_mm3 = parts.map(|p| p.artefacts.iter().map(|p| volume_mm3(&p.bytes)).sum());
    }
    Some(())
}

/// Volume of a closed surface, mm³, from a binary STL: the sum of the tetrahedra of its facets and the origin.
fn volume_mm3(stl: &[u8]) -> f64 {
    /// Bytes before the first facet, and of each: a normal, three corners and an attribute.
    const HEADER: usize = 84;
    const FACET: usize = 50;
    let facets = stl.get(HEADER..).unwrap_or_default().chunks_exact(FACET);
    let corner = |facet: &[u8], k: usize| {
        let axis = |a: usize| {
            let at = 12 + 12 * k + 4 * a;
            let bytes = facet.get(at..at + 4).and_then(|b| b.try_into().ok());
            bytes.map_or(f64::NAN, |b| f64::from(f32::from_le_bytes(b)))
        };
        nalgebra::Vector3::new(axis(0), axis(1), axis(2))
    };
    facets.map(|f| corner(f, 0).dot(&corner(f, 1).cross(&corner(f, 2))) / 6.0).sum()
}

/// A design that has something to decide and no lock that says how it was decided.
pub(super) fn not_locked(request: &Request, design: &crate::ir::Design) -> Diagnostic {
    let message = match request.lock {
        Some(_) => "the lock does not belong to this design as it stands: there is nothing to test",
        None => "this design has not been solved: there is no lock to test",
    };
    Diagnostic::error("E0714", message, design.origin).help("`flexura build` solves it and writes its lock")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A corner of a cube, 2 × 3 × 4 mm: four facets, 4 mm³.
    #[test]
    fn a_tetrahedron_has_its_volume() {
        let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 4.0_f32]];
        let mut stl = vec![0; 84];
        for face in [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
            stl.extend([0; 12]);
            for corner in face {
                // Away from the origin: a closed surface does not care.
                stl.extend(corners[corner].iter().flat_map(|x| (x + 7.0).to_le_bytes()));
            }
            stl.extend([0; 2]);
        }
        assert!((volume_mm3(&stl) - 4.0).abs() < 1e-9, "{}", volume_mm3(&stl));
    }
}
