//! Equilibria under point forces: derivatives of the load, compliance, reciprocity, work and energy.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Equilibrium, Layout, Model, PointForce, Solver, sweep};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::math::Pose;
use nalgebra::{SVector, Vector3};

mod common;

const EDGES: usize = 16;

/// The example, one of its states with the drive held, and its trace.
struct Fixture {
    design: Design,
    layout: Layout,
    p: Vec<f64>,
}

impl Fixture {
    fn new() -> Self {
        let options = Options { steps: Some(6), ..Options::default() };
        let design = elaborate("chebyshev.mech", &common::ExampleFiles, &options).design.unwrap();
        let p = common::shaken(&design, 5);
        let layout = Layout::new(&design, &solve_motion(&design, &p).unwrap(), &p);
        Self { design, layout, p }
    }

    fn with<T>(&self, f: impl FnOnce(&Model, &Equilibrium, &[f64]) -> T) -> T {
        let model = Model::new(&self.design, &self.layout, &self.p, EDGES, false).unwrap();
        let states = sweep(&model).unwrap().states;
        let drive = &self.layout.drives[0];
        f(&model, &states[2], &[drive.values[2] - drive.rest])
    }

    fn force(&self, force_n: Vector3<f64>) -> PointForce {
        let trace = &self.layout.traces[0];
        PointForce { body: trace.body, rest: trace.rest, force_n }
    }

    fn tip(&self, e: &Equilibrium) -> Vector3<f64> {
        let trace = &self.layout.traces[0];
        e.state.poses[trace.body].point(&trace.rest)
    }
}

#[test]
fn derivatives_of_the_load_against_differences() {
    let pose = Pose::rest(Vector3::new(1.0, 2.0, 3.0))
        .retract(&Vector3::new(4.0, -1.0, 2.0), &Vector3::new(0.3, -0.8, 0.5));
    let rest = Vector3::new(7.0, -3.0, 5.0);
    let load = PointForce { body: 0, rest, force_n: Vector3::new(0.7, -1.1, 0.4) };
    let at = |d: &SVector<f64, 6>| {
        load.potential_n_mm(&pose.retract(&d.fixed_rows::<3>(0).into(), &d.fixed_rows::<3>(3).into()))
    };
    let unit = |i: usize, h: f64| SVector::<f64, 6>::from_fn(|k, _| if k == i { h } else { 0.0 });
    let (gradient, hessian) = (load.gradient(&pose), load.hessian(&pose));
    for i in 0..6 {
        let difference = (at(&unit(i, 1e-5)) - at(&unit(i, -1e-5))) / 2e-5;
        assert!((difference - gradient[i]).abs() < 1e-8, "{i}: {difference} {}", gradient[i]);
        for j in 0..6 {
            let h = 1e-3;
            let s = |a: f64, b: f64| at(&(unit(i, a * h) + unit(j, b * h)));
            let difference = (s(1.0, 1.0) - s(1.0, -1.0) - s(-1.0, 1.0) + s(-1.0, -1.0)) / (4.0 * h * h);
            assert!((difference - hessian[(i, j)]).abs() < 1e-4, "{i} {j}: {difference}");
        }
    }
}

/// A small force displaces by compliance times force, up to second order.
#[test]
fn a_small_force_meets_the_compliance() {
    let fixture = Fixture::new();
    fixture.with(|model, free, target| {
        let mut errors = Vec::new();
        for size in [2e-2, 1e-2] {
            let load = fixture.force(Vector3::new(0.6, 0.0, 0.8) * size);
            let mut solver = Solver::new(model);
            solver.solve(model, free.state.clone(), target).unwrap();
            let response = solver.response(model, &free.state, &[load]);
            let first = fixture.layout.bodies[load.body].first_dof.unwrap();
            let arm = free.state.poses[load.body].arm(&load.rest);
            let du: Vector3<f64> = response.fixed_rows::<3>(first).into();
            let dphi: Vector3<f64> = response.fixed_rows::<3>(first + 3).into();
            let linear = du + dphi.cross(&arm);
            let moved = fixture.tip(&solver.load(model, free, target, &[load]).unwrap()) - fixture.tip(free);
            assert!(linear.norm() > 1e-3, "the force must act: {linear}");
            errors.push((moved - linear).norm() / linear.norm());
        }
        assert!(errors[1] < 0.02, "{errors:?}");
        assert!((1.8..2.2).contains(&(errors[0] / errors[1])), "{errors:?}");
    });
}

/// With the drive held only the load does work: what it does is stored in the rods.
#[test]
fn the_work_of_the_load_is_stored() {
    let fixture = Fixture::new();
    fixture.with(|model, free, target| {
        let direction = Vector3::new(0.5, -0.5, 0.5_f64.sqrt());
        let mut solver = Solver::new(model);
        let parts = 16;
        let states: Vec<(f64, f64)> = (0..=parts)
            .map(|k| {
                let load = fixture.force(direction * f64::from(k) / f64::from(parts));
                let e = solver.load(model, free, target, &[load]).unwrap();
                (direction.dot(&(fixture.tip(&e) - fixture.tip(free))), e.energy_n_mm)
            })
            .collect();
        // ∫ F dz = F z − ∫ z dF by Simpson's rule over the force.
        let z = |k: usize| states[k].0;
        let n = parts as usize;
        let simpson =
            (0..n).step_by(2).map(|k| z(k) + 4.0 * z(k + 1) + z(k + 2)).sum::<f64>() / (3 * n) as f64;
        let work = z(n) - simpson;
        let stored = states[n].1 - free.energy_n_mm;
        assert!(work > 1e-2, "the load must do work: {work}");
        assert!((work - stored).abs() < 1e-4 * work, "work {work}, stored {stored}");
    });
}

/// In parts or at once, the loaded state is the same; without a load it is the free one.
#[test]
fn the_loaded_state_does_not_depend_on_the_way() {
    let fixture = Fixture::new();
    fixture.with(|model, free, target| {
        let mut solver = Solver::new(model);
        let load = |k: f64| fixture.force(Vector3::new(-0.3, 0.9, 0.4) * k);
        let once = solver.load(model, free, target, &[load(1.0)]).unwrap();
        let half = solver.load(model, free, target, &[load(0.5)]).unwrap();
        let twice = solver.load(model, &half, target, &[load(1.0)]).unwrap();
        assert!((fixture.tip(&once) - fixture.tip(&twice)).norm() < 1e-7);
        let none = solver.load(model, free, target, &[]).unwrap();
        assert_eq!(none.state.poses, free.state.poses);
        let two = solver.load(model, free, target, &[load(0.25), load(0.75)]).unwrap();
        assert!((fixture.tip(&once) - fixture.tip(&two)).norm() < 1e-7, "forces add up");
    });
}

/// Loads taken together share the rods of their first step, and end in the bits of each by itself: near enough for a step with
/// the former factors, further, in parts only, and none at all.
#[test]
fn loads_taken_together_end_where_each_does() {
    let fixture = Fixture::new();
    fixture.with(|model, free, target| {
        let sizes = [1e-4, 0.3, 1.0, 0.0, 2e-4, 30.0];
        let loads = sizes.map(|k| [fixture.force(Vector3::new(-0.3, 0.9, 0.4) * k)]);
        let one_by_one: Vec<_> = loads
            .iter()
            .map(|load| Solver::new(model).load(model, free, target, load).map(|e| e.state.poses))
            .collect();
        assert!(one_by_one[..5].iter().all(Result::is_ok));
        let mut solver = Solver::new(model);
        let together = |solver: &mut Solver, n: usize| {
            let cases: Vec<&[PointForce]> = loads[..n].iter().map(|l| &l[..]).collect();
            solver
                .load_each(model, free, target, &cases)
                .map(|s| s.into_iter().map(|s| s.poses).collect::<Vec<_>>())
        };
        for _ in 0..2 {
            let found = together(&mut solver, 5).unwrap();
            for ((found, one), size) in found.iter().zip(&one_by_one).zip(sizes) {
                assert_eq!(Ok(found), one.as_ref(), "{size} N");
            }
        }
        assert_eq!(together(&mut solver, 6).is_ok(), one_by_one[5].is_ok());
    });
}
