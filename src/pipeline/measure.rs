//! From a simulated cycle to the numbers people ask for: errors, extremes, requirements.

use super::report::{
    DriveMeasures, GapMeasures, Measures, Place, RequirementResult, StressMeasures, TraceMeasures,
};
use super::stages::Simulation;
use crate::diagnostic::Diagnostic;
use crate::ir::{Aggregate, Design, DriveUnit, Quantity, Requirement};

/// See [`no_pull`].
const NO_PULL: f64 = 1e-6;

/// Measures of a simulated cycle.
pub fn measure(design: &Design, simulation: &Simulation) -> Measures {
    let closed = is_closed(design);
    let table = &simulation.motion;
    let mut measures = Measures::default();
    for (i, trace) in design.traces.iter().enumerate() {
        let quantity = if design.has_no_phase(i) { Quantity::ErrorClosest } else { Quantity::Error };
        let errors = series(simulation, &quantity(i));
        let path: Vec<[f64; 3]> = table.states.iter().filter_map(|s| s.traces_mm.get(i).copied()).collect();
        measures.traces.insert(
            trace.name.clone(),
            TraceMeasures {
                mean_error_mm: aggregate(&errors, Aggregate::Mean, closed).unwrap_or(f64::NAN),
                max_error_mm: aggregate(&errors, Aggregate::Max, closed).unwrap_or(f64::NAN),
                path_length_mm: path.iter().zip(path.iter().skip(1)).map(|(a, b)| distance(a, b)).sum(),
            },
        );
    }
    measures.directions = simulation.aims.measure_directions(design, closed);
    measures.outputs = simulation.aims.measure_outputs(design, closed);
    for (i, drive) in design.drives.iter().enumerate() {
        let loads = series(simulation, &Quantity::Torque(i));
        let largest = aggregate(&loads, Aggregate::Max, closed).unwrap_or(f64::NAN);
        let of_drive = match drive.unit {
            DriveUnit::Rad => DriveMeasures::Torque { max_torque_n_mm: largest },
            DriveUnit::Mm => DriveMeasures::Force { max_force_n: largest },
        };
        measures.drives.insert(drive.name.clone(), of_drive);
    }
    let stress = series(simulation, &Quantity::Stress);
    let max_mpa = if design.rods.is_empty() { None } else { aggregate(&stress, Aggregate::Max, closed) };
    measures.stress =
        StressMeasures { max_mpa, place: simulation.worst.stress.as_ref().map(|w| w.1.clone()) };
    measures.stability = simulation.stability.clone();
    measures.gap = GapMeasures {
        least_mm: aggregate(&simulation.gaps_mm, Aggregate::Min, closed),
        place: simulation.worst.gap.as_ref().map(|w| w.1.clone()),
    };
    let cases = design.cases.iter().zip(&simulation.cases);
    measures.cases = cases.map(|(case, s)| (case.name.clone(), measure(&design.under(case), s))).collect();
    measures
}

/// Whether the mechanism is in the same pose at both ends of the cycle.
pub fn is_closed(design: &Design) -> bool {
    design.is_closed()
}

/// Checks every `require` line, also those of load cases; one that fails is also a diagnostic at its line.
pub fn check_requirements(
    design: &Design,
    simulation: &Simulation,
    found: &mut Vec<Diagnostic>,
) -> Vec<RequirementResult> {
    let own = design.requirements.iter();
    let mut results: Vec<RequirementResult> =
        own.map(|r| check_requirement(r, is_closed(design), simulation, found)).collect();
    for (k, case) in design.cases.iter().enumerate() {
        let closed = is_closed(&design.under(case));
        // What was not simulated could not be measured.
        let simulation = simulation.cases.get(k).cloned().unwrap_or_default();
        for requirement in &case.requirements {
            let result = check_requirement(requirement, closed, &simulation, found);
            results
                .push(RequirementResult { text: format!("case {}: {}", case.name, result.text), ..result });
        }
    }
    results
}

pub(super) fn check_requirement(
    requirement: &Requirement,
    closed: bool,
    simulation: &Simulation,
    found: &mut Vec<Diagnostic>,
) -> RequirementResult {
    let value = aggregate(&series(simulation, &requirement.quantity), requirement.aggregate, closed);
    let unit = unit(&requirement.quantity);
    // Angles are told in degrees.
    let shown = |v: f64| if unit == "deg" { v.to_degrees() } else { v };
    let bound = requirement.bound;
    let pass = value.is_some_and(|v| match (requirement.at_most, requirement.strict) {
        (true, false) => v <= bound,
        (true, true) => v < bound,
        (false, false) => v >= bound,
        (false, true) => v > bound,
    });
    if !pass {
        let label = match value {
            Some(v) => {
                let (v, bound) = (shown(v), shown(bound));
                let at =
                    worst_place(requirement, simulation).map_or(String::new(), |p| format!(" {}", p.told()));
                format!("measured {v:.4} {unit}{at}, required {} {bound:.4} {unit}", sign(requirement))
            }
            None => "could not be measured".into(),
        };
        let message = format!("a requirement fails: {}", requirement.text);
        found.push(Diagnostic::error("E0801", message, requirement.origin).label(label));
    }
    RequirementResult {
        text: requirement.text.clone(),
        value: value.map(shown),
        unit: unit.into(),
        bound: shown(bound),
        pass,
    }
}

/// Where what is required is at its worst, if that is known.
fn worst_place<'s>(requirement: &Requirement, simulation: &'s Simulation) -> Option<&'s Place> {
    let worst = match (&requirement.quantity, requirement.aggregate) {
        (Quantity::Stress, Aggregate::Max) => simulation.worst.stress.as_ref(),
        (Quantity::Gap, Aggregate::Min) => simulation.worst.gap.as_ref(),
        _ => None,
    };
    worst.map(|w| &w.1)
}

fn sign(requirement: &Requirement) -> &'static str {
    match (requirement.at_most, requirement.strict) {
        (true, false) => "<=",
        (true, true) => "<",
        (false, false) => ">=",
        (false, true) => ">",
    }
}

fn unit(quantity: &Quantity) -> &'static str {
    match quantity {
        Quantity::Error(_) | Quantity::ErrorClosest(_) | Quantity::Gap => "mm",
        Quantity::AimError(_) | Quantity::Angle(_) => "deg",
        Quantity::Stress => "MPa",
        Quantity::Buckling => "",
        Quantity::Torque(_) => "N·mm",
        Quantity::Force(_) | Quantity::Tension(_) => "N",
    }
}

/// A quantity at every state.
fn series(simulation: &Simulation, quantity: &Quantity) -> Vec<f64> {
    let states = &simulation.motion.states;
    match *quantity {
        Quantity::Error(trace) => simulation.errors_mm.get(trace).cloned().unwrap_or_default(),
        Quantity::ErrorClosest(trace) => simulation.aims.closest_mm.get(trace).cloned().unwrap_or_default(),
        Quantity::AimError(i) => simulation.aims.aim_errors_rad.get(i).cloned().unwrap_or_default(),
        Quantity::Angle(i) => simulation.aims.angles_rad.get(i).cloned().unwrap_or_default(),
        Quantity::Gap => simulation.gaps_mm.clone(),
        Quantity::Buckling => simulation.load_factors.clone(),
        Quantity::Stress => states.iter().map(|s| s.stress_max_mpa).collect(),
        Quantity::Torque(drive) | Quantity::Force(drive) => {
            states.iter().filter_map(|s| s.drive_loads.get(drive).map(|t| t.abs())).collect()
        }
        Quantity::Tension(drive) => {
            let pulls: Vec<f64> = states.iter().filter_map(|s| s.drive_loads.get(drive).copied()).collect();
            let none = no_pull(&pulls);
            pulls.into_iter().map(|pull| if pull.abs() < none { 0.0 } else { pull }).collect()
        }
    }
}

/// Pulls of a string that are smaller than this (N) are rounding: what is left of those that balance to 1e-9.
pub fn no_pull(pulls_n: &[f64]) -> f64 {
    NO_PULL * pulls_n.iter().fold(0.0, |m, p| f64::max(m, p.abs()))
}

/// One number from a series over the states; none if it is empty or holds something that is no number.
pub fn aggregate(values: &[f64], how: Aggregate, closed: bool) -> Option<f64> {
    if values.is_empty() || !values.iter().all(|v| v.is_finite()) {
        return None;
    }
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    match how {
        Aggregate::Max => Some(most),
        Aggregate::Min => Some(least),
        Aggregate::Span => Some(most - least),
        Aggregate::Mean => {
            // The last state of a closed cycle is the first once more.
            let counted = if closed && values.len() > 1 { values.len() - 1 } else { values.len() };
            Some(values.iter().take(counted).sum::<f64>() / counted as f64)
        }
        Aggregate::At(t) => {
            let place = t.clamp(0.0, 1.0) * (values.len() - 1) as f64;
            let before = place.floor();
            let share = place - before;
            let first = *values.get(before as usize)?;
            let second = *values.get(before as usize + 1).unwrap_or(&first);
            Some(first + share * (second - first))
        }
    }
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closed_cycle_counts_its_last_state_once_in_means() {
        let values = [1.0, 2.0, 3.0, 1.0];
        assert_eq!(aggregate(&values, Aggregate::Mean, true), Some(2.0));
        assert_eq!(aggregate(&values, Aggregate::Mean, false), Some(1.75));
        assert_eq!(aggregate(&[5.0], Aggregate::Mean, true), Some(5.0));
    }

    #[test]
    fn extremes_and_moments() {
        let values = [1.0, -2.0, 3.0];
        assert_eq!(aggregate(&values, Aggregate::Max, false), Some(3.0));
        assert_eq!(aggregate(&values, Aggregate::Min, false), Some(-2.0));
        assert_eq!(aggregate(&values, Aggregate::Span, false), Some(5.0));
        assert_eq!(aggregate(&values, Aggregate::At(0.25), false), Some(-0.5));
        assert_eq!(aggregate(&values, Aggregate::At(1.0), false), Some(3.0));
    }

    #[test]
    fn what_is_no_number_is_not_measured() {
        assert_eq!(aggregate(&[], Aggregate::Max, false), None);
        assert_eq!(aggregate(&[1.0, f64::NAN], Aggregate::Max, false), None);
    }
}
