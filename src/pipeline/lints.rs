//! Where lints run on the way from text to artefacts, and where their levels are applied: at the end, to the findings of
//! all stages alike.

use super::report::BuildOutcome;
use super::stages::{Simulation, Stages};
use super::{Request, read_locks, tell_once, values_of};
use crate::diagnostic::Diagnostic;
use crate::emit::lock::LockState;
use crate::ir::Assembly;
use crate::kinematics::Motion;
use crate::lint::{self, OfDesign, OfFlexures, OfMotion, OfParts, OfSolution, Part, Stage, Text};
use nalgebra::Vector3;

/// What texts and designs show.
pub(super) fn text(assembly: &Assembly, out: &mut BuildOutcome) {
    let view = Text::new(&out.sources, &out.files);
    let mut found = lint::text(&view);
    for design in &assembly.designs {
        found.extend(lint::design(&OfDesign::new(&view, assembly, design)));
    }
    out.reached = Stage::Design;
    tell_once(found, out);
}

/// What the conventional motions and the flexures at the start show; one motion a design, none where it is not known.
pub(super) fn moving(
    assembly: &Assembly,
    motions: &[Option<Motion>],
    stages: &dyn Stages,
    out: &mut BuildOutcome,
) {
    let mut found = Vec::new();
    {
        let view = Text::new(&out.sources, &out.files);
        for (design, motion) in assembly.designs.iter().zip(motions) {
            let Some(motion) = motion else { continue };
            let of = OfDesign::new(&view, assembly, design);
            found.extend(lint::motion(&OfMotion { of: &of, motion }));
            let lengths = stages.flexure_lengths(design, &super::starts(design), motion);
            if let Some(lengths) = lengths.filter(|l| !l.is_empty()) {
                let flexures = lint::flexure_shapes(&of, motion, &lengths);
                found.extend(lint::flexures(&OfFlexures { of: &of, motion, flexures: &flexures }));
            }
        }
    }
    out.reached = Stage::Flexures;
    tell_once(found, out);
}

/// The findings of a check from `told` on in the order of their places: those of lints among the others.
pub(super) fn sort(out: &mut BuildOutcome, told: usize) {
    if let Some(new) = out.diagnostics.get_mut(told..) {
        let key = |d: &Diagnostic| d.labels.first().map(|l| (l.at.file, l.at.start, l.at.end));
        new.sort_by(|a, b| key(a).cmp(&key(b)).then_with(|| a.code.cmp(&b.code)));
    }
}

/// Rules about the solution that load cases are looked at with: stress, torque, strain. That a case moves a traced point
/// off its target is what it is there to show.
const OF_CASES: [&str; 4] = ["W1301", "W1302", "W1303", "W1304"];

/// What the solution shows; `values` and `simulations` are one a design.
pub(super) fn solved(
    assembly: &Assembly,
    values: &[Vec<f64>],
    simulations: &[Simulation],
    stages: &dyn Stages,
    out: &mut BuildOutcome,
) {
    let mut found = Vec::new();
    {
        let view = Text::new(&out.sources, &out.files);
        for ((design, values), simulation) in assembly.designs.iter().zip(values).zip(simulations) {
            let of = OfDesign::new(&view, assembly, design);
            let terms = if design.all_objectives().nth(1).is_some() {
                stages.terms(design, &super::starts(design))
            } else {
                Vec::new()
            };
            let own = lint::solution(&OfSolution { of: &of, solved: values, simulation, terms: &terms });
            // What loads do to parts and motors, where the design's own have not done it.
            for (case, simulation) in design.cases.iter().zip(&simulation.cases) {
                let under = design.under(case);
                let of = OfDesign::new(&view, assembly, &under);
                let mut more =
                    lint::solution(&OfSolution { of: &of, solved: values, simulation, terms: &[] });
                let place = |d: &Diagnostic| d.labels.first().map(|l| l.at);
                more.retain(|d| {
                    OF_CASES.contains(&d.code.as_str())
                        && !own.iter().any(|o| o.code == d.code && place(o) == place(d))
                });
                found.extend(more.into_iter().map(|d| d.also(case.origin, "in this load case")));
            }
            found.extend(own);
        }
    }
    out.reached = Stage::Solution;
    tell_once(found, out);
}

/// What the parts show, from the files as they are written.
pub(super) fn parts(assembly: &Assembly, out: &mut BuildOutcome) {
    let meshes = out.artefacts.iter().filter(|a| a.name.ends_with(".stl"));
    let parts: Vec<Part> =
        meshes.map(|a| Part { name: a.name.clone(), triangles: triangles(&a.bytes) }).collect();
    tell_once(lint::parts(&OfParts { assembly, parts: &parts }), out);
}

/// The triangles of a binary STL.
fn triangles(bytes: &[u8]) -> Vec<[Vector3<f64>; 3]> {
    /// Header and count, and one facet: normal, three corners, attributes.
    const HEAD: usize = 84;
    const FACET: usize = 50;
    let number = |b: &[u8]| b.try_into().map_or(f64::NAN, |b| f64::from(f32::from_le_bytes(b)));
    let corner = |facet: &[u8], k: usize| {
        let at = |i: usize| facet.get(12 + 12 * k + 4 * i..16 + 12 * k + 4 * i).map_or(f64::NAN, number);
        Vector3::new(at(0), at(1), at(2))
    };
    let facets = bytes.get(HEAD..).unwrap_or(&[]).chunks_exact(FACET);
    facets.map(|f| [corner(f, 0), corner(f, 1), corner(f, 2)]).collect()
}

/// The lock's values and a sweep with them, where it is current for every design. What is wrong with the lock a build
/// says.
pub(super) fn from_lock(
    request: &Request,
    assembly: &Assembly,
    stages: &dyn Stages,
    out: &mut BuildOutcome,
) -> Option<(Vec<Vec<f64>>, Vec<Simulation>)> {
    let mut aside = BuildOutcome { sources: out.sources.clone(), ..BuildOutcome::default() };
    let locks = read_locks(request, assembly, &mut aside).ok()?;
    let mut values = Vec::new();
    for (design, lock) in assembly.designs.iter().zip(locks) {
        let (lock, state) = lock?;
        if state != LockState::Current {
            return None;
        }
        values.push(values_of(design, &lock.solution));
    }
    let swept = assembly.designs.iter().zip(&values).map(|(d, v)| stages.sweep(d, v).ok());
    let simulations: Vec<Simulation> = swept.collect::<Option<_>>()?;
    Some((values, simulations))
}

/// Whether a finding so far is denied: then it is told as an error.
pub(super) fn denied(request: &Request, out: &BuildOutcome) -> bool {
    let mut found = out.diagnostics.clone();
    request.levels.apply(&mut found, &out.sources, &out.files, Stage::Text);
    found.iter().any(Diagnostic::is_error)
}

/// Gives every finding its level.
pub(super) fn finish(request: &Request, out: &mut BuildOutcome) {
    let reached = out.reached;
    request.levels.apply(&mut out.diagnostics, &out.sources, &out.files, reached);
}
