//! Cost against size: a row of Theo Jansen's legs on one crank pin, solved as one design, nothing free.

use super::designs::{design, example, layout, starts};
use super::{Report, Time, WHOLE, once};
use flexura::equilibrium::{Model, sweep};
use flexura::kinematics::solve_motion;
use flexura::pipeline::EDGES;
use std::fmt::Write;

/// What all legs have in common, in units of 1.2 mm.
const COMMON: &str = "
    param u: length = 1.2 mm
    point O = (0 mm, 0 mm)
    point G = O + (-38 * u, -7.8 * u)
    point A = O + polar(15 * u, 0 deg)
    point T = meet(circle(A, 50 * u),   circle(G, 41.5 * u), right)
    point L = meet(circle(A, 61.9 * u), circle(G, 39.3 * u), left)
    point E = meet(circle(G, 40.1 * u), circle(T, 55.8 * u), left)
    point F = meet(circle(E, 39.4 * u), circle(L, 36.7 * u), right)
    point H = meet(circle(L, 49 * u),   circle(F, 65.7 * u), left)
    ground base  { O, G }  layer -3
    link   crank { O, A }  layer -2
    hinge motor: base to crank at O  layer -2
    material rigur
    print on polyjet
    cycle 60 steps over 4 s
    drive motor from 0 deg to 360 deg with nema17
    rest  motor at 132 deg
";

/// One leg; `#` is its number.
const LEG: &str = "
    link k# { A, L }
    link f# { E, F }
    link j# { A, T }
    link c# { G, L }
    link upper# { G, T, E }
    link lower# { L, F, H }
    hinge pin#:   crank to k#  at A  pin 3 mm
    hinge wrist#: k# to j#     at A  as fixed_leaves { size = 5 * u }
    hinge top#:   j# to upper# at T  as fixed_leaves { size = 13 * u }
    hinge back#:  upper# to f# at E  as fixed_leaves { size = 13 * u }
    hinge heel#:  f# to lower# at F  as fixed_leaves { size = 13 * u }
    hinge hip#:   base to upper#, c# at G  as fixed_coupled { size = 11 * u }
    hinge knee#:  c# to k#, lower#   at L  as fixed_coupled { size = 15 * u }
    trace foot# = H on lower#
";

/// Two crossing leaves and three coupled ones, with numbers where those of the example have free values.
fn flexures() -> String {
    let rod = |name: &str, a: &str, b: &str, turn: &str, lift: &str| {
        format!(
            "    rod {name} {{\n        from {a} at cyl(size, {turn} deg, {lift}) along cyl(2 * size, 180 deg)\n        \
             to {b} at cyl(size, {turn} deg, {lift}) along cyl(2 * size, 0 deg)\n        \
             section ellipse(thick = 0.62 mm, wide = wide)\n    }}\n"
        )
    };
    format!(
        "flexure fixed_leaves replaces hinge {{\n    param size: length = shorter_link / 3\n    \
         let wide = (layer_height - process.clearance) / 2\n    let lift = (layer_height + process.clearance) / 4\n{}{}}}\n\
         flexure fixed_coupled replaces hinge {{\n    param size: length = shorter_link / 3\n    \
         let wide = (layer_height - 2 * process.clearance) / 3\n    let lift = wide + process.clearance\n{}{}{}}}\n",
        rod("upper", "a", "b", "35", "lift"),
        rod("lower", "a", "b", "-35", "-lift"),
        rod("ab", "a", "b", "0", "lift"),
        rod("bc", "b", "c", "0", "0 mm"),
        rod("ac", "a", "c", "0", "-lift"),
    )
}

fn text(legs: usize) -> String {
    let mut out = String::from("use std.materials.rigur\nuse std.processes.polyjet\nuse std.motors.nema17\n");
    let _ = write!(out, "{}mechanism legs {{{COMMON}", flexures());
    for leg in 0..legs {
        out.push_str(&LEG.replace('#', &leg.to_string()));
    }
    out.push_str("}\n");
    out
}

/// Conventional motion, rods and the equilibria of all states.
pub fn legs(report: &mut Report) {
    // The example itself must be there to be compared with.
    let alone = example("jansen").designs[0].rods.len();
    for legs in [1, 2, 4, 8, 16, 32] {
        let key = legs.to_string();
        if report.quick && legs > 2 {
            report.set("legs_s", &key, None);
            continue;
        }
        let design = design("legs.mech", text(legs));
        assert_eq!(design.rods.len(), alone * legs);
        let size = format!("{legs} legs, {} rods, {} bodies", design.rods.len(), design.bodies.len());
        let start = starts(&design);
        let (motion, moved) = once(|| solve_motion(&design, &start));
        if let Err(why) = moved {
            let why = why.first().map(|d| d.message.clone()).unwrap_or_default();
            report.note("legs", &format!("not simulated: {why}"), &size, "–".into(), "s");
            report.set("legs_s", &key, None);
            continue;
        }
        let layout = layout(&design);
        let (equilibria, swept) = once(|| {
            let model = Model::new(&design, &layout, &start, EDGES, false).expect("rods");
            sweep(&model)
        });
        if let Err(e) = swept {
            report.note("legs", &format!("lost at state {}", e.state), &size, "–".into(), "s");
            report.set("legs_s", &key, None);
            continue;
        }
        let time = |t: f64| Time { least: t, median: t };
        report.row("legs", "conventional motion", &size, time(motion), WHOLE);
        report.row("legs", "equilibria", &size, time(equilibria), WHOLE);
        report.set("legs_s", &key, Some(motion + equilibria));
    }
}
