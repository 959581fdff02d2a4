//! Reading and checking: a generated design of ten thousand lines, and parts of it to see that cost grows in proportion.

use super::{MILLI, Report};
use flexura::pipeline::{Compiler, Request, check as run_check};
use std::collections::BTreeMap;
use std::fmt::Write;

/// A mechanism of about 30 lines.
const MECHANISM: &str = "mechanism m# {
    /// Crank radius.
    param r: length = 20 mm
    let   half = 2.5 * r
    point O = (0 mm, 0 mm)
    point D = O + (2 * r, 0 mm)
    point A = O + polar(r, 90 deg)
    point B = meet(circle(A, half), circle(D, half), left)
    point P = A + 2 * (B - A)
    point S = D - (0 mm, 25 mm)      // where the bracket leaves

    ground base    { O, D }  layer -2
    link   crank   { O, A }  layer -1
    link   coupler { A, B, P }
    link   rocker  { B, D }
    hinge motor: base to crank     at O  layer -1
    hinge pin:   crank to coupler  at A  layer -1  pin 3 mm
    hinge knee:  coupler to rocker at B  into coupler toward P  as crossed_leaves
    hinge heel:  rocker to base    at D  into base toward S     as crossed_leaves { thickness = free 0.8 mm in 0.6 mm .. 1.4 mm }

    material rigur
    print on polyjet
    cycle 60 steps over 2 s
    drive motor from 0 deg to 360 deg with nema17
    rest  motor at 30 deg
    trace tip = P on coupler
    minimize {
        track(tip, scale = 0.1 mm)
        stress(below = 25 MPa, scale = 0.2 MPa)
    }
    require max(error(tip)) <= 1 mm
}
";

/// Mechanisms until the text has so many lines.
fn text(lines: usize) -> String {
    let mut out = String::from(
        "use std.materials.rigur\nuse std.processes.polyjet\nuse std.motors.nema17\nuse std.flexures.crossed_leaves\n",
    );
    let own = MECHANISM.lines().count();
    let count = lines.saturating_sub(4) / own;
    (0..count).for_each(|i| out.push_str(&MECHANISM.replacen('#', &i.to_string(), 1)));
    for _ in 4 + own * count..lines {
        let _ = writeln!(out, "// so that it has just so many lines");
    }
    out
}

pub fn check(report: &mut Report) {
    let request = Request { source: "long.mech".into(), ..Request::default() };
    for lines in [2_500, 5_000, 10_000] {
        let text = text(lines);
        let parse = report.time(|| flexura::syntax::parse(0, &text).file.items.len());
        let size = format!("{lines} lines, {:.0} kB", text.len() as f64 / 1e3);
        report.row("check", "parse", &size, parse, MILLI);
        let files = BTreeMap::from([(request.source.clone(), text)]);
        let time = report.time(|| {
            let out = run_check(&request, &Compiler::default(), &files);
            assert!(!out.diagnostics.iter().any(|d| d.is_error()), "{:?}", out.diagnostics);
        });
        report.row("check", "parse and check", &size, time, MILLI);
        if lines == 10_000 {
            report.set("check_10k_lines_ms", "", Some(time.least * MILLI.0));
        }
    }
}
