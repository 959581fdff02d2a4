//! The report: one HTML file that needs nothing else, to look at a solved design and to move it. Plain data in, one page
//! out; the same data give the same bytes. Numbers come with their units, as they are to be read.

pub mod live;
mod pack;
mod plot;
mod text;
mod way;
mod wiring;

pub use plot::{Plot, Series};
pub use way::Way;
pub use wiring::{Motor, Wiring};

use super::drawing::svg_drawing;
use super::plate::{Bought, Plate};
use super::scene::Scene;
use super::sheet;
use crate::diagnostic::Severity;
use askama::Template;
use nalgebra::Vector3;
use text::{glance, marked, number};

/// All that a report shows beside what it works out itself.
#[derive(Clone, Debug)]
pub struct Report<'a> {
    /// The mechanism in motion.
    pub scene: &'a Scene,
    /// Its parts on the bed.
    pub plate: &'a Plate,
    /// Each trace at the start of the optimisation, mm, in the order of the scene's; empty where there is none.
    pub started: Vec<Vec<Vector3<f64>>>,
    /// The numbers that matter, before and after.
    pub figures: Vec<Figure>,
    /// Acceptance tests.
    pub checks: Vec<Check>,
    /// Quantities over the cycle.
    pub plots: Vec<Plot>,
    /// Parameters that are not free.
    pub parameters: Vec<Fixed>,
    /// How each design was solved.
    pub solved: Vec<Solved>,
    /// Findings, as their levels have them.
    pub findings: Vec<Finding>,
    /// What is bought.
    pub bought: Vec<Bought>,
    /// How each motor is wired.
    pub wiring: Vec<Wiring>,
    /// The other files that were made, with their sizes in bytes.
    pub files: Vec<(String, usize)>,
}

/// A number before and after.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What it is.
    pub name: String,
    /// At the start.
    pub before: Option<f64>,
    /// Of the result.
    pub after: Option<f64>,
    /// Unit of both.
    pub unit: String,
}

/// A `require` line.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// As written.
    pub text: String,
    /// Measured.
    pub value: Option<f64>,
    /// Required.
    pub bound: f64,
    /// Unit of both.
    pub unit: String,
    /// Whether it holds.
    pub pass: bool,
    /// It cannot be measured without solids, and there are none.
    pub open: bool,
}

/// How a design was solved.
#[derive(Clone, Debug, PartialEq)]
pub struct Solved {
    /// Name of the design.
    pub name: String,
    /// Instances that are made of it; empty for a mechanism by itself.
    pub instances: Vec<String>,
    /// Iterations of the optimiser.
    pub iterations: usize,
    /// It ended by its own rule.
    pub converged: bool,
    /// Terms of the objective: name, at the start, at the end.
    pub terms: Vec<(String, f64, f64)>,
    /// The terms on the way there, where that is known.
    pub way: Option<Way>,
    /// Its free variables.
    pub variables: Vec<Variable>,
}

/// A parameter that stays as it is written.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixed {
    /// As `--set` names it.
    pub path: String,
    /// Value and unit.
    pub text: String,
    /// What the text says of it.
    pub doc: String,
}

/// A free variable with its bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Path.
    pub path: String,
    /// Unit of the numbers, as shown.
    pub unit: String,
    /// At the start.
    pub start: f64,
    /// Solved.
    pub value: f64,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
}

/// A finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Code.
    pub code: String,
    /// Level.
    pub severity: Severity,
    /// What.
    pub message: String,
    /// What is said of its place.
    pub label: String,
    /// What to do.
    pub help: String,
}

impl Report<'_> {
    /// Whether there are paths of the start to compare with.
    fn has_started(&self) -> bool {
        self.started.iter().any(|path| !path.is_empty())
    }

    fn volume(&self) -> String {
        format!("{:.2}", self.plate.parts.iter().map(|p| p.mesh.volume_mm3()).sum::<f64>() / 1000.0)
    }

    /// Of all parts, where all densities are stated.
    fn mass(&self) -> Option<String> {
        let masses = self.plate.parts.iter().map(|p| p.mass_g()).collect::<Option<Vec<f64>>>()?;
        (masses.len() > 1).then(|| format!("{:.1} g", masses.iter().sum::<f64>()))
    }
}

impl Solved {
    /// Whether it has a name that is worth telling: it is one of several, or placed.
    fn is_placed(&self) -> bool {
        !self.instances.is_empty()
    }

    fn total(&self) -> [String; 2] {
        [number(self.terms.iter().map(|t| t.1).sum()), number(self.terms.iter().map(|t| t.2).sum())]
    }

    /// Name, start, end, and how much less that is.
    fn rows(&self) -> Vec<(&str, String, String, String)> {
        let part = |a: f64, b: f64| match b / a {
            _ if a <= 0.0 || b <= 0.0 => String::new(),
            r if r < 0.01 => format!("÷ {}", glance(1.0 / r)),
            r if r <= 1.0 => format!("−{:.0} %", 100.0 * (1.0 - r)),
            r => format!("+{:.0} %", 100.0 * (r - 1.0)),
        };
        self.terms.iter().map(|(n, a, b)| (n.as_str(), number(*a), number(*b), part(*a, *b))).collect()
    }

    /// Variables by what stands before the first point: those of a joint together.
    fn groups(&self) -> Vec<(&str, Vec<&Variable>)> {
        let mut out: Vec<(&str, Vec<&Variable>)> = Vec::new();
        for v in &self.variables {
            let group = v.path.split_once('.').map_or("", |p| p.0);
            match out.iter_mut().find(|g| g.0 == group) {
                Some(g) => g.1.push(v),
                None => out.push((group, vec![v])),
            }
        }
        out
    }
}

/// A variable nearer to a bound than this part of the way between its bounds rests on it.
const ON_BOUND: f64 = 1e-3;

impl Variable {
    fn share(&self, value: f64) -> f64 {
        let way = self.upper - self.lower;
        if way > 0.0 { ((value - self.lower) / way).clamp(0.0, 1.0) } else { 0.5 }
    }

    /// Where it is between its bounds, in percent.
    fn percent(&self, value: &f64) -> String {
        format!("{:.1}", 100.0 * self.share(*value))
    }

    fn bound(&self) -> &'static str {
        match self.share(self.value) {
            s if s < ON_BOUND => "at its lower bound",
            s if s > 1.0 - ON_BOUND => "at its upper bound",
            _ => "",
        }
    }
}

impl Check {
    fn relation(&self) -> &'static str {
        let has = |what: &str| self.text.contains(what);
        match () {
            () if has("<=") => "≤",
            () if has(">=") => "≥",
            () if has("<") => "<",
            () => ">",
        }
    }

    /// How much of the bound is used, in percent, where that means something.
    fn used(&self) -> Option<String> {
        let value = self.value.filter(|v| self.relation() != "≥" && self.relation() != ">" && *v >= 0.0)?;
        (self.bound > 0.0).then(|| format!("{:.0}", (100.0 * value / self.bound).clamp(0.0, 100.0)))
    }
}

impl Finding {
    fn level(&self) -> &'static str {
        match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Advice => "advice",
        }
    }
}

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'r> {
    of: &'r Report<'r>,
    failing: usize,
    open: usize,
    drawing: String,
    plots: Vec<(&'r Plot, String)>,
    sheets: Vec<sheet::Told>,
    machines: Vec<(String, Vec<(&'static str, String)>)>,
    data: String,
    blob: String,
    policy: &'static str,
    style: &'static str,
    script: &'static str,
    three: &'static str,
}

impl Page<'_> {
    fn shown(&self, value: &Option<f64>) -> String {
        value.map_or("–".into(), glance)
    }

    fn short(&self, value: &f64) -> String {
        glance(*value)
    }

    fn marked(&self, text: &str) -> String {
        marked(text)
    }

    fn plain(&self, value: &f64) -> String {
        number(*value)
    }

    fn size(&self, bytes: &usize) -> String {
        match *bytes {
            0..1_000 => format!("{bytes} B"),
            1_000..1_000_000 => format!("{:.1} kB", *bytes as f64 / 1e3),
            _ => format!("{:.1} MB", *bytes as f64 / 1e6),
        }
    }

    fn room(&self) -> Option<String> {
        let [wide, deep] = self.of.plate.room_mm();
        (self.of.plate.parts.len() > 1).then(|| format!("{wide:.0} × {deep:.0} mm"))
    }
}

/// The bytes of the page: same data, same bytes.
///
/// # Errors
/// What the template engine or the compressor says: never a fault of the design.
pub fn report_html(report: &Report<'_>) -> Result<Vec<u8>, String> {
    let (data, blob) = pack::pack(report)?;
    let page = Page {
        of: report,
        failing: report.checks.iter().filter(|c| !c.pass && !c.open).count(),
        open: report.checks.iter().filter(|c| c.open).count(),
        drawing: svg_drawing(report.scene),
        plots: report.plots.iter().map(|p| (p, p.svg(&report.scene.times_s))).collect(),
        sheets: report.plate.parts.iter().map(sheet::told).collect(),
        machines: sheet::machines(report.plate),
        data,
        blob,
        policy: live::POLICY,
        style: include_str!("page/report.css"),
        script: live::SCRIPT,
        three: live::THREE,
    };
    page.render().map(String::into_bytes).map_err(|e| e.to_string())
}
