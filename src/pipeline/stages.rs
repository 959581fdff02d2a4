//! The stages as the pipeline sees them: what goes in, what comes out, nothing of how.
//! [`Compiler`](super::Compiler) is the real thing; tests put small mechanisms with known answers in its place.

use super::aims::AimSeries;
use super::joined::Planned;
use super::progress::Iteration;
use super::report::{Artefact, Worst};
use super::stability::Stability;
use crate::diagnostic::{Diagnostic, SourceMap};
use crate::elaborate::{Files, KnownValue, OwnFile};
use crate::emit::csv::MotionTable;
use crate::emit::plate::Plate;
use crate::emit::scene::Scene;
use crate::geometry::Carving;
use crate::ir::{Assembly, Design, Solution};
use crate::kinematics::Motion;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Findings of a stage that gave nothing.
pub type Failed = Vec<Diagnostic>;

/// What the front end gives.
#[derive(Clone, Debug, Default)]
pub struct Checked {
    /// The files read.
    pub sources: SourceMap,
    /// What is to be built, if there were no errors.
    pub assembly: Option<Assembly>,
    /// Names of its variants.
    pub variants: Vec<String>,
    /// What each of them builds, in their order, where none was chosen and there were no errors.
    pub others: Vec<Assembly>,
    /// The design's own files as understood.
    pub files: Vec<OwnFile>,
    /// What names came to.
    pub values: Vec<KnownValue>,
    /// Findings.
    pub diagnostics: Vec<Diagnostic>,
}

/// A simulated cycle.
#[derive(Clone, Debug, Default)]
pub struct Simulation {
    /// Drives, traces, forces and poses at every state.
    pub motion: MotionTable,
    /// Distance of each trace from its target at every state, mm.
    pub errors_mm: Vec<Vec<f64>>,
    /// Nearest distances, directions, angles of bodies.
    pub aims: AimSeries,
    /// Least gap of the printed solids at every state, mm; empty where there is nothing to compare.
    pub gaps_mm: Vec<f64>,
    /// Where the largest stress and the least gap are.
    pub worst: Worst,
    /// What the released mechanism does.
    pub stability: Stability,
    /// How far each traced point gives way to 1 N across its path, at most over some states, mm; of a conventional
    /// motion nothing.
    pub sway_mm: Vec<f64>,
    /// Factor by which all loads can grow at every state before it buckles; empty where nothing asks for it.
    pub load_factors: Vec<f64>,
    /// What its printed parts are planned as, for what comes after; none where there is nothing to print.
    pub planned: Option<Arc<Planned>>,
    /// Of a conventional motion, the motion.
    pub conventional: Option<Motion>,
    /// The same under each of the design's load cases, without what only solids and released drives show; of a
    /// conventional motion nothing.
    pub cases: Vec<Simulation>,
    /// Findings that do not stop the work.
    pub diagnostics: Vec<Diagnostic>,
}

/// What instances are to each other over the cycle.
#[derive(Clone, Debug, Default)]
pub struct Between {
    /// Least gap of the printed solids of two instances at every state, mm; empty where there is nothing to compare.
    pub gaps_mm: Vec<f64>,
    /// The least of them all.
    pub worst: Worst,
    /// The links of the whole, those in common included, as they make way for flexures; none where instances are not joined.
    pub carving: Option<Arc<Carving>>,
    /// Where they meet.
    pub diagnostics: Vec<Diagnostic>,
}

/// What is known of printed parts before they are made: gaps are those of the same links.
#[derive(Clone, Debug, Default)]
pub struct Plans {
    /// Each design; none where it is not known.
    pub designs: Vec<Option<Arc<Planned>>>,
    /// The links of the whole.
    pub whole: Option<Arc<Carving>>,
}

impl Plans {
    /// Those of a simulated assembly.
    pub fn of(simulations: &[Simulation], between: &Between) -> Self {
        Self {
            designs: simulations.iter().map(|s| s.planned.clone()).collect(),
            whole: between.carving.clone(),
        }
    }
}

/// What the optimiser gives.
#[derive(Clone, Debug, Default)]
pub struct Solved {
    /// The best point found.
    pub solution: Solution,
    /// It was stopped from outside.
    pub interrupted: bool,
    /// Findings.
    pub diagnostics: Vec<Diagnostic>,
}

/// Where the compliant mechanism is at given drive values: a value a place in every list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Response {
    /// Each angle of the design, unwrapped, rad.
    pub angles_rad: Vec<Vec<f64>>,
    /// Each traced point, mm.
    pub traces_mm: Vec<Vec<[f64; 3]>>,
    /// Each traced direction.
    pub directions: Vec<Vec<[f64; 3]>>,
}

/// The printed parts as files, and as what a report shows.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// Files of parts and motion.
    pub artefacts: Vec<Artefact>,
    /// Findings that do not stop the work.
    pub diagnostics: Vec<Diagnostic>,
    /// The mechanism in motion and its parts on the bed, where a report is asked for.
    pub shown: Option<(Scene, Plate)>,
}

/// What already stands in the output folder.
pub trait Made {
    /// The bytes of a file by its name relative to the folder, with `/`; none where there is none, or it is not to be
    /// read.
    fn read(&self, name: &str) -> Option<Vec<u8>>;
}

/// An output folder with nothing in it.
#[derive(Clone, Copy, Debug, Default)]
pub struct NothingMade;

impl Made for NothingMade {
    fn read(&self, _: &str) -> Option<Vec<u8>> {
        None
    }
}

/// The stages. `values` are the free variables in the design's order.
pub trait Stages {
    /// Text to design. `overrides` are `--set` names and expressions; `steps` overrides the cycle's; without a `variant`
    /// it is the design as it stands.
    fn check(
        &self,
        source: &str,
        overrides: &[(String, String)],
        steps: Option<usize>,
        variant: Option<&str>,
        files: &dyn Files,
    ) -> Checked;

    /// Motion of the conventional mechanism.
    ///
    /// # Errors
    /// Where it cannot be assembled, or its mobility does not match its drives.
    fn rigid(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed>;

    /// One sweep of the compliant mechanism from its unstressed rest pose.
    ///
    /// # Errors
    /// Where no equilibrium is found.
    fn simulate(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed>;

    /// As [`Self::simulate`], without what only printed solids and released drives show: what a check can afford.
    ///
    /// # Errors
    /// Where no equilibrium is found.
    fn sweep(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        self.simulate(design, values)
    }

    /// Lengths of all flexures in the rest pose, mm; none where one has no shape. `motion` is that of these values.
    fn flexure_lengths(&self, _design: &Design, _values: &[f64], _motion: &Motion) -> Option<Vec<f64>> {
        None
    }

    /// The terms of the objective by name, and their contributions; empty where there are none or they cannot be computed.
    fn terms(&self, _design: &Design, _values: &[f64]) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// Where the compliant mechanism is when its drives have these values (one list a place, rad or mm from the drawing
    /// pose), followed from place to place.
    ///
    /// # Errors
    /// Where no equilibrium is found.
    fn respond(&self, _design: &Design, _values: &[f64], _drives: &[Vec<f64>]) -> Result<Response, Failed> {
        Err(Failed::new())
    }

    /// What the instances of an assembly are to each other; `simulations` are those of each design. Nothing where there is
    /// one instance, or no printed form.
    fn between(&self, _assembly: &Assembly, _simulations: &[Simulation]) -> Between {
        Between::default()
    }

    /// The best design from a start; stops early when `cancel` is set.
    ///
    /// # Errors
    /// Where the start itself cannot be simulated.
    fn optimize(
        &self,
        design: &Design,
        start: &[f64],
        on_iteration: &dyn Fn(&Iteration),
        cancel: &AtomicBool,
    ) -> Result<Solved, Failed>;

    /// The files of printed parts that the assembly's exports ask for; where they ask for none, an STL a part in the
    /// rest pose of the assembly. `values` are those of each design; what `plans` lack is worked out.
    ///
    /// # Errors
    /// Where no closed solid comes out.
    fn parts(&self, assembly: &Assembly, values: &[Vec<f64>], plans: &Plans) -> Result<Parts, Failed>;

    /// The mechanism in motion without uniting anything: links as the primitives that they are planned of, flexures as
    /// they bend, and an empty bed. It takes a sweep, where [`Self::parts`] takes solids.
    ///
    /// # Errors
    /// Where no equilibrium is found.
    fn outline(&self, _assembly: &Assembly, _values: &[Vec<f64>]) -> Result<(Scene, Plate), Failed> {
        Err(Failed::new())
    }

    /// An STL a printed part of a mechanism by itself, in its own coordinates.
    ///
    /// # Errors
    /// Where no closed solid comes out.
    fn mesh(&self, design: &Design, values: &[f64]) -> Result<(Vec<Artefact>, Vec<Diagnostic>), Failed> {
        let assembly = Assembly { exports: Vec::new(), ..Assembly::of(design.clone()) };
        self.parts(&assembly, &[values.to_vec()], &Plans::default()).map(|p| (p.artefacts, p.diagnostics))
    }
}
