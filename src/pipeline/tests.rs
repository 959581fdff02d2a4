//! The pipeline around stages with known answers: locks, requirements, artefacts, interruption.

use super::*;
use crate::diagnostic::SourceMap;
use crate::emit::csv::{MotionState, MotionTable};
use crate::ir::ExportKind;
use crate::ir::expr::ExprGraph;
use crate::ir::{
    Aggregate, Cycle, DriveUnit, Export, FreeVariable, JointId, Layers, Material, Motor, MotorInterface,
    Objective, ObjectiveKind, Process, Profile, Quantity, Requirement, Trace,
};
use std::cell::Cell;
use std::sync::atomic::Ordering;

/// A design with one free variable `x` whose error is |x − 1| mm at every state.
pub(super) fn design() -> Design {
    let mut exprs = ExprGraph::default();
    let zero = exprs.constant(0.0);
    let origin = crate::ir::Origin::default();
    let hinge: JointId = 0;
    Design {
        name: "toy".into(),
        exprs,
        free: vec![FreeVariable {
            path: "x".into(),
            unit: "mm".into(),
            start: 3.0,
            lower: 0.0,
            upper: 5.0,
            origin,
        }],
        bodies: Vec::new(),
        joints: Vec::new(),
        rods: Vec::new(),
        model: Default::default(),
        drives: vec![crate::ir::Drive {
            name: "motor".into(),
            on: crate::ir::DriveOn::Joint(hinge),
            drum_radius_mm: None,
            unit: DriveUnit::Rad,
            profile: Profile::Range { from: 0.0, to: std::f64::consts::TAU },
            rest: 0.0,
            free_rest: None,
            motor: Some(Motor {
                motion: Default::default(),
                name: "m".into(),
                interface: MotorInterface::Stepper { steps_per_turn: 200, microsteps: 8 },
                stall_n_mm: 400.0,
                shaft_diameter_mm: None,
            }),
            continuous: true,
            origin,
        }],
        loads: Vec::new(),
        cases: Vec::new(),
        strings: Vec::new(),
        cycle: Cycle { steps: 4, duration_s: 2.0, origin },
        traces: vec![Trace { name: "tip".into(), body: 0, point: [zero; 3], origin }],
        aims: Default::default(),
        objectives: vec![Objective {
            kind: ObjectiveKind::Track { trace: 0, scale_mm: None },
            weight: 1.0,
            origin,
        }],
        requirements: vec![Requirement {
            aggregate: Aggregate::Max,
            quantity: Quantity::Error(0),
            at_most: true,
            strict: false,
            bound: 0.5,
            text: "max(error(tip)) <= 0.5 mm".into(),
            origin,
        }],
        material: Material {
            name: "m".into(),
            e_mpa: 1900.0,
            nu: 0.4,
            density_g_mm3: None,
            strength_mpa: None,
            yield_mpa: None,
            strain_once: None,
            strain_repeated: None,
        },
        process: Process {
            name: "p".into(),
            least_wall_mm: 0.6,
            clearance_mm: 0.3,
            machine: Default::default(),
        },
        layers: Layers { height_mm: 6.0, pitch_mm: 6.3, axis: [0.0, 0.0, 1.0] },
        exports: vec![
            Export { kind: ExportKind::Stl, origin },
            Export { kind: ExportKind::Arduino(0), origin },
        ],
        origin,
    }
}

#[derive(Default)]
pub(super) struct Toy {
    pub(super) solved: Cell<usize>,
    /// How often a cycle was simulated.
    pub(super) simulated: Cell<usize>,
    pub(super) started_at: Cell<f64>,
    pub(super) change: Option<fn(&mut Design)>,
    /// What the simulation finds.
    pub(super) finds: Option<fn(&Design) -> Diagnostic>,
}

impl Stages for Toy {
    fn check(
        &self,
        source: &str,
        _: &[(String, String)],
        steps: Option<usize>,
        _: Option<&str>,
        _: &dyn Files,
    ) -> Checked {
        let mut design = design();
        design.cycle.steps = steps.unwrap_or(design.cycle.steps);
        if let Some(change) = self.change {
            change(&mut design);
        }
        let mut sources = SourceMap::default();
        sources.add(source, "text");
        Checked { sources, assembly: Some(Assembly::of(design)), ..Checked::default() }
    }

    fn rigid(&self, design: &Design, _: &[f64]) -> Result<Simulation, Failed> {
        let states = vec![MotionState::default(); design.cycle.steps + 1];
        Ok(Simulation { motion: MotionTable { states, ..Default::default() }, ..Default::default() })
    }

    fn simulate(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        self.simulated.set(self.simulated.get() + 1);
        let n = design.cycle.steps + 1;
        let state =
            MotionState { traces_mm: vec![[0.0; 3]], drive_loads: vec![-7.0], ..MotionState::default() };
        let bodies = vec!["a".into()];
        Ok(Simulation {
            motion: MotionTable { states: vec![state; n], bodies, ..Default::default() },
            errors_mm: vec![vec![(values[0] - 1.0).abs(); n]],
            diagnostics: self.finds.map(|finds| finds(design)).into_iter().collect(),
            ..Simulation::default()
        })
    }

    fn optimize(
        &self,
        _: &Design,
        start: &[f64],
        on_iteration: &dyn Fn(&Iteration),
        cancel: &AtomicBool,
    ) -> Result<Solved, Failed> {
        self.solved.set(self.solved.get() + 1);
        self.started_at.set(start[0]);
        on_iteration(&Iteration::default());
        let interrupted = cancel.load(Ordering::SeqCst);
        let x = if interrupted { start[0] } else { 1.25 };
        let solution =
            Solution { values: [("x".to_string(), x)].into(), iterations: 7, converged: !interrupted };
        Ok(Solved { solution, interrupted, diagnostics: Vec::new() })
    }

    fn parts(&self, _: &Assembly, values: &[Vec<f64>], _: &Plans) -> Result<Parts, Failed> {
        let part = Artefact { name: "toy.stl".into(), bytes: values[0][0].to_le_bytes().to_vec() };
        Ok(Parts { artefacts: vec![part], ..Parts::default() })
    }
}

pub(super) struct NoFiles;
impl Files for NoFiles {
    fn read(&self, _: &str) -> Result<String, FileError> {
        Err(FileError::NotFound)
    }
}

pub(super) struct Ticks(pub(super) Cell<f64>);
impl Progress for Ticks {
    fn seconds(&self) -> f64 {
        self.0.set(self.0.get() + 1.0);
        self.0.get()
    }
}

fn run(toy: &Toy, request: &Request, cancelled: bool) -> BuildOutcome {
    build(request, toy, &NoFiles, &Ticks(Cell::new(0.0)), &AtomicBool::new(cancelled))
}

/// All findings but those of the lints, which have tests of their own.
pub(super) fn codes(out: &BuildOutcome) -> Vec<&str> {
    out.diagnostics.iter().map(|d| d.code.as_str()).filter(|c| !c.starts_with("W1")).collect()
}

pub(super) fn with_lock(out: &BuildOutcome) -> Request {
    Request { lock: Some(("toy.lock".into(), out.lock.clone().unwrap())), ..Request::default() }
}

#[test]
fn solves_measures_and_emits() {
    let toy = Toy::default();
    let out = run(&toy, &Request::default(), false);
    assert!(!out.failed(), "{:?}", out.diagnostics);
    assert_eq!(out.before.as_ref().unwrap().traces["tip"].max_error_mm, 2.0);
    assert_eq!(out.after.as_ref().unwrap().traces["tip"].mean_error_mm, 0.25);
    assert_eq!(out.after.as_ref().unwrap().drives["motor"].parts(), ("largest torque", 7.0, "N·mm"));
    assert_eq!(out.after.as_ref().unwrap().stress.max_mpa, None, "there are no rods");
    let names: Vec<&str> = out.artefacts.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["toy.stl", "toy_motor/toy_motor.ino"]);
    assert_eq!(out.seconds.check, 1.0);
    assert!(out.seconds.total > out.seconds.solve);
}

#[test]
fn a_current_lock_is_not_solved_again_and_gives_the_same_bytes() {
    let toy = Toy::default();
    let first = run(&toy, &Request::default(), false);
    let second = run(&toy, &with_lock(&first), false);
    assert_eq!(toy.solved.get(), 1);
    assert_eq!(second.solved_from, Origin::Lock);
    assert_eq!(second.lock, None, "it is not written again");
    assert_eq!(first.artefacts, second.artefacts);
    assert_eq!(first.after, second.after);
    let fresh = run(&toy, &Request { fresh: true, ..with_lock(&first) }, false);
    assert_eq!(toy.solved.get(), 2);
    assert_eq!(toy.started_at.get(), 3.0);
    assert_eq!(fresh.lock, first.lock);
}

#[test]
fn a_changed_design_starts_from_its_old_lock() {
    let first = run(&Toy::default(), &Request::default(), false);
    let toy = Toy { change: Some(|d| d.material.e_mpa = 2000.0), ..Toy::default() };
    let out = run(&toy, &with_lock(&first), false);
    assert_eq!((toy.solved.get(), toy.started_at.get()), (1, 1.25));
    assert_eq!(out.solved_from, Origin::OldLock);
    let narrowed = Toy { change: Some(|d| d.free[0].lower = 2.0), ..Toy::default() };
    run(&narrowed, &with_lock(&first), false);
    assert_eq!(narrowed.started_at.get(), 2.0, "kept within the new bounds");
}

#[test]
fn places_exports_and_requirements_do_not_make_a_lock_stale() {
    let first = run(&Toy::default(), &Request::default(), false);
    let toy = Toy {
        change: Some(|d| {
            d.free[0].origin.start = 99;
            d.exports.pop();
            d.requirements[0].bound = 0.6;
        }),
        ..Toy::default()
    };
    assert_eq!(run(&toy, &with_lock(&first), false).solved_from, Origin::Lock);
    assert_eq!(toy.solved.get(), 0);
}

#[test]
fn frozen_refuses_to_solve() {
    let toy = Toy::default();
    let frozen = |request: Request| run(&toy, &Request { frozen: true, ..request }, false);
    assert_eq!(codes(&frozen(Request::default())), ["E0710"]);
    let first = run(&Toy::default(), &Request::default(), false);
    assert!(!frozen(with_lock(&first)).failed());
    assert_eq!(codes(&frozen(Request { steps: Some(8), ..with_lock(&first) })), ["E0710"]);
    assert_eq!(toy.solved.get(), 0);
}

#[test]
fn edited_and_damaged_locks_are_told() {
    let toy = Toy::default();
    let first = run(&toy, &Request::default(), false);
    let lock = |from: &str, to: &str| Request {
        lock: Some(("toy.lock".into(), first.lock.clone().unwrap().replace(from, to))),
        ..Request::default()
    };
    let edited = run(&toy, &lock("1.25", "2.5"), false);
    assert_eq!(codes(&edited), ["W0711"]);
    assert_eq!(toy.started_at.get(), 2.5);
    let damaged = run(&toy, &lock("x = 1.25 mm", "x = mm"), false);
    assert_eq!(codes(&damaged), ["E0703"]);
    assert_eq!(damaged.diagnostics[0].labels[0].at.file, 1, "points into the lock");
    assert!(!run(&toy, &Request { fresh: true, ..lock("x = 1.25 mm", "x = mm") }, false).failed());
}

#[test]
fn a_failing_requirement_fails_the_build_at_its_line_but_still_emits() {
    let toy = Toy { change: Some(|d| d.requirements[0].bound = 0.2), ..Toy::default() };
    let out = run(&toy, &Request::default(), false);
    assert!(out.failed());
    assert_eq!(codes(&out), ["E0801"]);
    assert_eq!(out.requirements[0].value, Some(0.25));
    assert_eq!(out.artefacts.len(), 2);
}

#[test]
fn an_interrupted_run_keeps_its_best_point_and_says_so() {
    let toy = Toy { change: Some(|d| d.requirements.clear()), ..Toy::default() };
    let out = run(&toy, &Request::default(), true);
    assert_eq!(codes(&out), ["W0713"]);
    assert!(out.lock.as_ref().unwrap().contains("converged false"));
    assert_eq!(codes(&run(&toy, &with_lock(&out), false)), ["W0712"]);
    // Asked to, it goes on; a solution that has converged stays.
    let resume = |out: &BuildOutcome| Request { resume: true, ..with_lock(out) };
    let before = toy.solved.get();
    let on = run(&toy, &resume(&out), false);
    assert_eq!((codes(&on).len(), on.solved_from, toy.solved.get()), (0, Origin::OldLock, before + 1));
    assert!(on.lock.as_ref().unwrap().contains("converged true"));
    let again = run(&toy, &resume(&on), false);
    assert_eq!((again.solved_from, toy.solved.get()), (Origin::Lock, before + 1));
}

#[test]
fn nothing_to_decide_needs_no_solver() {
    let toy = Toy { change: Some(|d| d.objectives.clear()), ..Toy::default() };
    let out = run(&toy, &Request::default(), false);
    assert_eq!(toy.solved.get(), 0);
    assert_eq!(out.solution.unwrap().values["x"], 3.0);
}

#[test]
fn a_motor_that_is_no_stepper_is_an_error_at_the_export() {
    let toy = Toy {
        change: Some(|d| {
            d.drives[0].motor.as_mut().unwrap().interface = MotorInterface::Pwm { range_rad: 3.0 };
        }),
        ..Toy::default()
    };
    assert_eq!(codes(&run(&toy, &Request::default(), false)), ["E0724"]);
}

#[test]
fn simulation_shows_the_lock_or_the_start() {
    let toy = Toy::default();
    let first = run(&toy, &Request::default(), false);
    let errors = |request: &Request| {
        let (_, simulation) = simulate(request, Show::default(), &toy, &NoFiles);
        simulation.unwrap().errors_mm[0][0]
    };
    assert_eq!(errors(&Request::default()), 2.0);
    assert_eq!(errors(&with_lock(&first)), 0.25);
    let (_, plain) = simulate(&Request::default(), Show::default(), &toy, &NoFiles);
    assert!(plain.unwrap().motion.bodies.is_empty());
    let (_, posed) = simulate(&Request::default(), Show { poses: true, rigid: false }, &toy, &NoFiles);
    assert_eq!(posed.unwrap().motion.bodies, ["a"]);
}
