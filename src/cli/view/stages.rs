//! The stages as the view needs them: of all exports only the report, and either its outline, which takes a sweep, or
//! everything.

use flexura::emit::plate::Plate;
use flexura::emit::scene::Scene;
use flexura::ir::assembly::AssemblyExport;
use flexura::ir::{Assembly, Design, Export, ExportKind};
use flexura::kinematics::Motion;
use flexura::pipeline::{
    Between, Checked, Compiler, Failed, Files, Iteration, Parts, Plans, Response, Simulation, Solved, Stages,
};
use std::sync::atomic::AtomicBool;

/// See the module.
pub struct Shown {
    /// What does the work.
    pub compiler: Compiler,
    /// With solids and what only they show.
    pub whole: bool,
}

impl Stages for Shown {
    fn check(
        &self,
        source: &str,
        overrides: &[(String, String)],
        steps: Option<usize>,
        variant: Option<&str>,
        files: &dyn Files,
    ) -> Checked {
        let mut checked = self.compiler.check(source, overrides, steps, variant, files);
        if let Some(assembly) = &mut checked.assembly {
            let report = Export { kind: ExportKind::Report, origin: assembly.origin };
            assembly.exports.retain(|e| e.export.kind == ExportKind::Report);
            if assembly.exports.is_empty() {
                assembly.exports.push(AssemblyExport { instance: None, export: report, motors: Vec::new() });
            }
        }
        checked
    }

    fn rigid(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        self.compiler.rigid(design, values)
    }

    fn simulate(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        match self.whole {
            true => self.compiler.simulate(design, values),
            false => self.compiler.sweep(design, values),
        }
    }

    fn sweep(&self, design: &Design, values: &[f64]) -> Result<Simulation, Failed> {
        self.compiler.sweep(design, values)
    }

    fn flexure_lengths(&self, design: &Design, values: &[f64], motion: &Motion) -> Option<Vec<f64>> {
        self.compiler.flexure_lengths(design, values, motion)
    }

    fn terms(&self, design: &Design, values: &[f64]) -> Vec<(String, f64)> {
        self.compiler.terms(design, values)
    }

    fn respond(&self, design: &Design, values: &[f64], drives: &[Vec<f64>]) -> Result<Response, Failed> {
        self.compiler.respond(design, values, drives)
    }

    fn between(&self, assembly: &Assembly, simulations: &[Simulation]) -> Between {
        if self.whole { self.compiler.between(assembly, simulations) } else { Between::default() }
    }

    fn optimize(
        &self,
        design: &Design,
        start: &[f64],
        on_iteration: &dyn Fn(&Iteration),
        cancel: &AtomicBool,
    ) -> Result<Solved, Failed> {
        self.compiler.optimize(design, start, on_iteration, cancel)
    }

    fn parts(&self, assembly: &Assembly, values: &[Vec<f64>], plans: &Plans) -> Result<Parts, Failed> {
        if self.whole {
            return self.compiler.parts(assembly, values, plans);
        }
        let shown = self.compiler.outline(assembly, values)?;
        Ok(Parts { shown: Some(shown), ..Parts::default() })
    }

    fn outline(&self, assembly: &Assembly, values: &[Vec<f64>]) -> Result<(Scene, Plate), Failed> {
        self.compiler.outline(assembly, values)
    }
}
