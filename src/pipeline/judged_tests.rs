//! Findings about a followed cycle that no small design shows by itself: a cycle is spoilt by hand, and each finding is
//! held against the statement at which it must point.
#![allow(clippy::unwrap_used)]

use super::compiler::judge;
use super::stability::{released, snapped};
use crate::diagnostic::Diagnostic;
use crate::elaborate::{Options, elaborate};
use crate::equilibrium::{Cycle, Layout, Model, Snap, sweep};
use crate::ir::Design;
use crate::kinematics::solve_motion;
use std::collections::BTreeMap;

const EDGES: usize = 10;

fn text() -> String {
    include_str!("../../tests/motors/nodder.mech")
        .replace("MOTOR", "nema17")
        .replace("DRIVE", "drive motor from 0 deg to 360 deg with nema17")
        .replace("MORE", "")
        .replace("EXPORTS", "stl")
}

/// The finding of a spoilt cycle: code and what it points at.
fn told(look: impl FnOnce(&Design, &Layout, &Model, Cycle) -> Diagnostic) -> (String, String) {
    let text = text();
    let files = BTreeMap::from([("main.mech".to_string(), text.clone())]);
    let options = Options { steps: Some(8), ..Options::default() };
    let design = elaborate("main.mech", &files, &options).design.unwrap();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = Layout::new(&design, &solve_motion(&design, &start).unwrap(), &start);
    let model = Model::new(&design, &layout, &start, EDGES, false).unwrap();
    let found = look(&design, &layout, &model, sweep(&model).unwrap());
    let at = found.labels.first().unwrap().at;
    (found.code.clone(), text.get(at.start as usize..at.end as usize).unwrap().to_string())
}

fn is(code: &str, place: &str) -> (String, String) {
    (code.into(), place.into())
}

#[test]
fn a_cycle_that_does_not_close_points_at_the_mechanism() {
    let found = told(|design, layout, _, mut cycle| {
        assert!(judge(design, layout, &cycle).is_empty(), "sound before");
        cycle.states.last_mut().unwrap().state.poses.last_mut().unwrap().translation.x += 1.0;
        judge(design, layout, &cycle).pop().unwrap()
    });
    assert_eq!(found, is("W0604", "nodder"));
}

#[test]
fn a_snap_points_at_the_drive() {
    let snap = Snap { state: 3, drives: vec![1.0], lost_n_mm: 0.5 };
    let found = told(|design, _, _, _| snapped(design, &snap));
    assert_eq!(found, is("W0605", "drive motor from 0 deg to 360 deg with nema17"));
}

#[test]
fn rest_states_that_cannot_be_found_point_at_the_mechanism() {
    let found = told(|design, layout, model, mut cycle| {
        let mut found = Vec::new();
        released(design, layout, model, &cycle, &mut found);
        assert!(found.is_empty(), "sound before");
        cycle.states[4].state.poses.iter_mut().for_each(|p| p.translation.x = 1e6);
        released(design, layout, model, &cycle, &mut found);
        found.pop().unwrap()
    });
    assert_eq!(found, is("W0606", "nodder"));
}
