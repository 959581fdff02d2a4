//! One mechanism from its statements to a [`Design`].

use super::codes;
use super::eval::Evaluator;
use super::sheet::Sheet;
use super::structure::Structure;
use super::template::Site;
use super::terms::Named;
use super::value::ItemRef;
use crate::diagnostic::{Diagnostic, Origin, SourceMap};
use crate::ir::expr::ExprId;
use crate::ir::{Design, Drive, Process, Realization, Rod};
use crate::syntax::ast::Mechanism;
use std::collections::BTreeMap;

/// What is told to a mechanism from outside.
pub struct Outside<'s> {
    /// Module it stands in.
    pub module: usize,
    /// `--steps`.
    pub steps: Option<usize>,
    /// Texts, to quote lines.
    pub sources: &'s SourceMap,
    /// Files that targets are read from.
    pub files: &'s dyn super::Files,
}

impl<'a> Evaluator<'a> {
    /// Elaborates a mechanism; none when it has errors.
    pub(super) fn mechanism(&mut self, m: &'a Mechanism, outside: &Outside<'_>) -> Option<Design> {
        let module = outside.module;
        let scope = self.scope(module);
        let mut sheet = self.sheet(scope, m);
        sheet.broken |= self.program.modules.get(module).is_some_and(|m| m.broken);
        self.force_all(scope);
        self.assertions(scope, &sheet);
        let material = match sheet.material {
            Some((name, _)) => {
                self.record_named(module, name, "material").and_then(|item| self.material(item)).ok()
            }
            None => self.missing(&sheet, m, "material", "`material rigur`"),
        };
        let process: Option<(ItemRef, Process)> = match sheet.process {
            Some((name, _)) => self
                .record_named(module, name, "process")
                .and_then(|item| Ok((item, self.process(item)?)))
                .ok(),
            None => self.missing(&sheet, m, "process", "`print on polyjet`"),
        };
        let mut s = self.structure(scope, &sheet, m.name.at);
        self.fittings(scope, module, &sheet, &mut s);
        self.solids(scope, &sheet, &mut s, outside);
        let strings = self.strings(scope, &sheet, &mut s);
        let clearance = process.as_ref().map(|(_, p)| p.clearance_mm);
        let layers = self.layers(scope, &sheet, &s, clearance).ok();
        let mut rods = Vec::new();
        if let Some(layers) = &layers {
            let process = process.as_ref().map(|(item, _)| *item);
            self.flexures(scope, module, &mut s, process, layers.height_mm, &mut rods);
        }
        let model = self.rod_model(&sheet);
        let cycle = match sheet.cycle {
            Some(_) => self.cycle(scope, &sheet, outside.steps).ok(),
            None => self.missing(&sheet, m, "cycle", "`cycle 60 steps over 2 s`"),
        };
        let loaded = !sheet.loads.is_empty() || sheet.cases.iter().any(|(_, c, _)| !c.loads.is_empty());
        if sheet.drives.is_empty() && !loaded {
            let _: Option<()> = self.missing(&sheet, m, "drive or load", "`drive J from 0 deg to 360 deg`");
        }
        let drives = self.drives(scope, module, &sheet, &s).ok();
        let weightless = material.as_ref().filter(|m| m.density_g_mm3.is_none()).map(|m| m.name.as_str());
        // Terms and queries ask for it.
        self.undriven = sheet.drives.is_empty() && loaded && !sheet.broken && !sheet.later;
        let loads = self.loads(scope, &sheet, &s, weightless).ok();
        let mut traces = Vec::new();
        let mut trace_index = BTreeMap::new();
        for text in &sheet.traces {
            if let Ok(t) = self.trace(scope, text, &s) {
                trace_index.insert(t.name.clone(), traces.len());
                traces.push(t);
            }
        }
        self.aims(scope, &sheet, &s, &trace_index, cycle.as_ref().map(|c| c.steps), outside);
        let driven = drive_names(&drives, &sheet);
        self.workspaces(scope, &sheet, &driven, drives.as_deref());
        let named = Named { traces: &trace_index, driven: &driven, drives: drives.as_deref() };
        // Goals do not grow with the drawing.
        self.as_is = true;
        self.loaded = !sheet.loads.is_empty() || sheet.broken;
        let (objectives, requirements) = self.goals(scope, &sheet, &named, outside);
        let cases = self.cases(scope, &sheet, &s, &named, weightless, outside);
        let mut exports = Vec::new();
        for e in &sheet.exports {
            exports.extend(self.export(scope, e, &driven, &sheet.drives));
        }
        self.as_is = false;
        // Last: the numbers of nodes in the graph, and so locks, do not depend on it.
        self.fillets(scope, &sheet, &s, &mut rods);
        if self.out.iter().any(Diagnostic::is_error) {
            return None;
        }
        let mut design = Design {
            name: m.name.node.clone(),
            exprs: Default::default(),
            free: std::mem::take(&mut self.free),
            bodies: s.bodies,
            joints: s.joints,
            rods,
            model: model?,
            drives: drives?,
            strings: strings.map(|()| s.strings).ok()?,
            loads: loads?,
            cases,
            cycle: cycle?,
            traces,
            aims: std::mem::take(&mut self.aims.made),
            objectives,
            requirements,
            material: material?,
            process: process?.1,
            layers: layers?,
            exports,
            origin: m.name.at,
        };
        self.finish(&mut design)?;
        Some(design)
    }

    /// Evaluates every name of a scope.
    pub(super) fn force_all(&mut self, scope: usize) {
        for i in 0..self.scopes.get(scope).map_or(0, |s| s.locals.len()) {
            let local = self.scopes.get(scope).and_then(|s| s.locals.get(i));
            let Some(at) =
                local.filter(|l| !matches!(l.kind, super::scope::LocalKind::Thing(_))).map(|l| l.at)
            else {
                continue;
            };
            // Errors have been reported; the rest of the mechanism is looked at all the same.
            let _ = self.force(scope, i, at);
        }
    }

    /// Reports a statement that every mechanism needs.
    fn missing<T>(&mut self, sheet: &Sheet<'a>, m: &Mechanism, what: &str, example: &str) -> Option<T> {
        if !sheet.broken && !sheet.later {
            self.out.push(
                Diagnostic::error(
                    codes::MISSING,
                    format!("mechanism `{}` has no {what}", m.name.node),
                    m.name.at,
                )
                .help(format!("add for instance {example}")),
            );
        }
        None
    }

    fn flexures(
        &mut self,
        scope: usize,
        module: usize,
        s: &mut Structure<'a>,
        process: Option<ItemRef>,
        layer_height_mm: f64,
        rods: &mut Vec<Rod>,
    ) {
        for i in 0..s.joints.len() {
            let (Some(text), Some(shorter_link_mm)) = (s.texts.get(i).copied(), self.shorter_link(s, i))
            else {
                continue;
            };
            let Some(template) = &text.template else { continue };
            let Some(joint) = s.joints.get(i) else { continue };
            let bodies = joint.bodies.clone();
            let site = Site {
                joint_name: &text.name.node,
                joint: i,
                statement: joint.origin,
                bodies: &bodies,
                layer: joint.layer,
                kind: &text.kind.node,
                shorter_link_mm,
                layer_height_mm,
                process,
            };
            if let Ok(made) = self.template(scope, module, template, &site, (rods, &mut s.bodies))
                && let Some(joint) = s.joints.get_mut(i)
            {
                joint.realization =
                    Realization::Compliant { template: template.name.node.clone(), rods: made };
            }
        }
    }

    /// Drops what the design does not use from the graph, and checks what is left at the start values.
    fn finish(&mut self, design: &mut Design) -> Option<()> {
        design.exprs = self.exprs.clone();
        let used = design.drop_unused();
        for (i, f) in design.free.iter().enumerate() {
            if !used.contains(&i) {
                self.out.push(
                    Diagnostic::warning(
                        codes::IDLE_FREE,
                        format!("nothing depends on `{}`", f.path),
                        f.origin,
                    )
                    .help("remove `free`, or use the value"),
                );
            }
        }
        let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
        let values = design.exprs.values(&start);
        for rod in &design.rods {
            let mut widths =
                std::iter::once(&rod.section).chain(&rod.section_to).flat_map(|s| s.half_widths());
            let ids = [rod.from.position, rod.from.derivative, rod.to.position, rod.to.derivative];
            let finite = |id: &ExprId| values.get(id.0 as usize).is_some_and(|v| v.is_finite());
            if !(ids.iter().flatten().all(finite) && widths.all(|id| finite(&id))) {
                self.out.push(
                    Diagnostic::error(
                        codes::NOT_FINITE,
                        format!("rod `{}` is not finite at the start values", rod.path),
                        rod.origin,
                    )
                    .label("a division by zero, or a root of a negative number"),
                );
            }
        }
        (!self.out.iter().any(Diagnostic::is_error)).then_some(())
    }
}

/// Indices of the drives by name; wrong drives keep their place so that what names them is not reported too.
fn drive_names(drives: &Option<Vec<Drive>>, sheet: &Sheet<'_>) -> BTreeMap<String, usize> {
    match drives {
        Some(d) => d.iter().enumerate().map(|(i, d)| (d.name.clone(), i)).collect(),
        None => sheet.drives.iter().enumerate().map(|(i, d)| (d.joint.node.clone(), i)).collect(),
    }
}

pub(super) fn quote(sources: &SourceMap, at: Origin) -> String {
    let text =
        sources.files.get(at.file as usize).and_then(|f| f.text.get(at.start as usize..at.end as usize));
    text.unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" ")
}
