//! Findings of what is solved, built, locked and compared: small designs that show them within a moment.

use super::{changed, common, told};
use flexura::pipeline::{self, BuildOutcome, Compiler, Extent, Request, Show, Values};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

fn files(text: &str) -> BTreeMap<String, String> {
    BTreeMap::from([("main.mech".to_string(), text.to_string())])
}

fn all(out: &BuildOutcome) -> Vec<String> {
    out.diagnostics.iter().map(|d| told(d, &out.sources)).collect()
}

/// Built where the free values start, with a lock if there is one.
fn built(text: &str, lock: Option<&str>, change: impl FnOnce(&mut Request)) -> BuildOutcome {
    let lock = lock.map(|l| ("main.lock".to_string(), l.to_string()));
    let mut request = Request { source: "main.mech".into(), lock, ..Request::default() };
    change(&mut request);
    let compiler = Compiler { iterations: 0, ..Compiler::default() };
    pipeline::build(&request, &compiler, &files(text), &common::NoClock, &AtomicBool::new(false))
}

fn at_start(text: &str) -> Vec<String> {
    all(&built(text, None, |_| {}))
}

fn moved(text: &str) -> Vec<String> {
    let request = Request { source: "main.mech".into(), ..Request::default() };
    all(&pipeline::simulate(&request, Show::default(), &Compiler::default(), &files(text)).0)
}

/// The manual's first design in few steps, with parts put in place of others.
fn short(edits: &[(&str, &str)]) -> String {
    let mut all = vec![("cycle 60 steps", "cycle 12 steps")];
    all.extend(edits);
    changed(&all)
}

/// A block from a file on the coupler, without some of its triangles.
fn with_solid(place: &str, missing: usize) -> Vec<String> {
    let text = short(&[(
        "    material rigur",
        &format!("    solid \"block.stl\" on coupler {place}\n    material rigur"),
    )]);
    let block = include_str!("../elaborate/errors/solids/block.stl");
    let facets: Vec<&str> = block.split_inclusive("endfacet\n").collect();
    let block = format!("solid block\n{}", facets[1 + missing..].concat());
    let whole = if missing == 0 { include_str!("../elaborate/errors/solids/block.stl") } else { &block };
    let mut files = files(&text);
    files.insert("block.stl".into(), whole.into());
    let request = Request { source: "main.mech".into(), ..Request::default() };
    let compiler = Compiler { iterations: 0, ..Compiler::default() };
    all(&pipeline::build(&request, &compiler, &files, &common::NoClock, &AtomicBool::new(false)))
}

/// A process of the design's own, `print on small`.
fn on(fields: &str) -> String {
    let text = short(&[("print on polyjet", "print on small"), ("use std.processes.polyjet\n", "")]);
    format!("{text}\nprocess small {{\n    least_wall = 0.6 mm\n    {fields}\n}}\n")
}

/// A crank that rocks a lever.
fn nodder(drive: &str, more: &str) -> String {
    let motor = if drive.contains("nema17") { "nema17" } else { "sg90" };
    let text = include_str!("../motors/nodder.mech").replace("MOTOR", motor).replace("DRIVE", drive);
    text.replace("MORE", more).replace("EXPORTS", "c")
}

const BUTTERFLY: &str = include_str!("../instances/butterfly.mech");
const CANTILEVER: &str = include_str!("../loads/cantilever.mech");
const FINGER: &str = include_str!("../strings/finger.mech");

/// A parallelogram that stands on a line after a quarter turn, its height free.
fn parallelogram(term: &str, steps: usize) -> String {
    format!(
        "use std.materials.rigur\nuse std.processes.polyjet\nuse std.flexures.crossed_leaves\n\
        mechanism flat {{\n    let r = free 10 mm in 8 mm .. 12 mm\n\
        point O = (0 mm, 0 mm)\n    point D = (40 mm, 0 mm)\n    point A = (0 mm, r)\n    point B = (40 mm, r)\n\
        ground base {{ O, D }}\n    link crank {{ O, A }}\n    link coupler {{ A, B }}\n    link rocker {{ B, D }}\n\
        hinge motor: base to crank at O\n    hinge pin: crank to coupler at A\n\
        hinge knee: coupler to rocker at B\n\
        hinge heel: rocker to base at D as crossed_leaves {{ size = 6 mm }}\n\
        material rigur\n    print on polyjet\n    cycle {steps} steps over 1 s\n    drive motor from 0 deg to 120 deg\n\
        trace tip = B on rocker\n    minimize {{ {term} }}\n}}\n"
    )
}

/// A kite whose knee goes round once while its crank goes round twice.
const KITE: &str = "use std.materials.rigur\nuse std.processes.polyjet\nmechanism kite {
    point O = (0 mm, 0 mm)
    point D = (20 mm, 0 mm)
    point A = (0 mm, 20 mm)
    point B = meet(circle(A, 50 mm), circle(D, 50 mm), left)
    ground base { O, D }
    link crank { O, A } layer 1
    link coupler { A, B }
    link rocker { B, D } layer 1
    hinge motor: base to crank at O
    hinge pin: crank to coupler at A
    hinge knee: coupler to rocker at B
    hinge heel: rocker to base at D
    material rigur
    print on polyjet
    cycle 24 steps over 1 s
    drive motor from 0 deg to 360 deg
    trace tip = B on rocker
}
";

/// A slider whose crank's length is free, with links that must not collide.
const SLIDING: &str =
    "use std.materials.rigur\nuse std.processes.polyjet\nuse std.flexures.crossed_leaves\nmechanism press {
    let   r = free 10 mm in 8 mm .. 12 mm
    point O = (0 mm, 0 mm)
    point A = (0 mm, r)
    point B = (60 mm, 0 mm)
    point C = (90 mm, 0 mm)
    ground base { O, C }
    link crank { O, A } layer 1
    link rod { A, B }
    link ram { B, C }
    hinge motor: base to crank at O
    hinge pin: crank to rod at A
    hinge knee: rod to ram at B into ram toward C as crossed_leaves { size = 8 mm }
    slider way: base to ram at C axis x
    material rigur
    print on polyjet
    cycle 6 steps over 1 s
    drive motor from 0 deg to 40 deg
    trace tip = B on ram
    minimize { track(tip), collision(gap = 0.5 mm) }
}
";

/// Two crossed hinges with axes at right angles: their leaves run in three directions.
const WRIST: &str = include_str!("../exports/wrist.mech");

/// A body between two leaves, smaller than what they sweep; pressed, it goes down between them.
const TOGGLE: &str = "edition 1
use std.materials.rigur
use std.processes.polyjet
flexure straight replaces hinge {
    rod leaf {
        from a at cyl(15 mm, 0 deg) along cyl(30 mm, 180 deg)
        to   b at cyl(15 mm, 0 deg) along cyl(30 mm, 0 deg)
        section rect(thick = 0.8 mm, wide = 5 mm)
    }
}
mechanism toggle {
    point O = (0 mm, 0 mm)
    point L = (-50 mm, 0 mm)
    point R = (50 mm, 0 mm)
    ground wall { L, R }
    link   mid  { O }
    hinge left:  wall to mid at (-18 mm, 1.5 mm) into wall toward L into mid toward O as straight
    hinge right: wall to mid at (18 mm, 1.5 mm)  into wall toward R into mid toward O as straight
    material rigur
    print on polyjet
    cycle in 24 steps
    load 3 N * sin(360 deg * t) along (0, -1) on mid at O
    trace tip = O on mid
}
";

/// A motor two of whose screws are under the arm that it turns.
const SEATED: &str = "edition 1
use std.materials.petg
use std.processes.fdm
use std.flexures.crossed_leaves
use std.motors.xl330_m288
mechanism nodder {
    point O = (0 mm, 0 mm)
    point D = (60 mm, 0 mm)
    point A = (0 mm, 15 mm)
    point B = (60 mm, 40 mm)
    ground base    { O, D }  layer -2
    link   arm     { O, A }  layer -1
    link   coupler { A, B }
    link   rocker  { B, D }
    hinge motor: base to arm       at O  layer -1
    hinge elbow: arm to coupler    at A  as crossed_leaves { size = 8 mm }
    hinge knee:  coupler to rocker at B  as crossed_leaves { size = 8 mm }
    hinge heel:  rocker to base    at D  into base toward D - (0 mm, 25 mm)  as crossed_leaves { size = 8 mm }
    mount xl330_m288 on base at O
    horn  xl330_m288 on arm  at O
    material petg
    print on fdm
    cycle 4 steps over 2 s
    drive motor from -5 deg to 5 deg with xl330_m288
    trace tip = B on rocker
    minimize { track(tip) }
    require max(error(tip)) <= 1 mm
    export stl
}
";

type Find = fn() -> Vec<String>;

/// Cases: code, and what finds all that there is.
pub fn cases() -> Vec<(&'static str, Find)> {
    let lazy = |find: Find| find;
    vec![
        ("E0465", lazy(|| with_solid("at P", 1))),
        ("E0655", lazy(|| with_solid("at P + (0 mm, 0 mm, 80 mm)", 0))),
        ("W0506", lazy(|| moved(&parallelogram("track(tip)", 11)))),
        ("W0507", lazy(|| moved(KITE))),
        ("E0612", lazy(|| at_start(&parallelogram("track(tip)", 12)))),
        ("E0613", lazy(|| at_start(SLIDING))),
        (
            "W0603",
            lazy(|| {
                moved(&CANTILEVER.replace("//LOAD", "load 4 * EI / L^2 * t along (-1, 0, 0) on tip at T"))
            }),
        ),
        ("W0620", lazy(|| moved(&FINGER.replace("cable at 0 mm", "cable at 2 mm")))),
        ("W0634", lazy(|| at_start(&on("clearance = 1 mm")))),
        ("W0636", lazy(|| moved(&hand()))),
        ("W0637", lazy(|| moved(TOGGLE))),
        ("W0640", lazy(|| at_start(&apart(30.0, "")))),
        ("E0641", lazy(|| at_start(&apart(0.0, "sharing base")))),
        ("W0642", lazy(|| at_start(&apart(4.7, "sharing base")))),
        ("W0644", lazy(|| at_start(WRIST))),
        ("W0650", lazy(|| at_start(&WRIST.replace("export stl", "export dxf")))),
        (
            "W0645",
            lazy(|| {
                at_start(&on(
                    "clearance = 0.4 mm\n    bed_width = 30 mm\n    bed_depth = 40 mm\n    bed_height = 50 mm",
                ))
            }),
        ),
        ("W0649", lazy(|| at_start(SEATED))),
        ("E0710", lazy(|| all(&built(&short(&[]), None, |r| r.frozen = true)))),
        (
            "W0711",
            lazy(|| {
                // A digit more.
                let digit = |l: &str| {
                    if l.starts_with("knee.thickness") { l.replacen(" mm", "1 mm", 1) } else { l.into() }
                };
                let by_hand: Vec<String> = lock().lines().map(digit).collect();
                all(&built(&short(&[]), Some(&format!("{}\n", by_hand.join("\n"))), |_| {}))
            }),
        ),
        ("W0712", lazy(|| all(&built(&short(&[]), Some(&lock()), |_| {})))),
        (
            "W0713",
            lazy(|| {
                let request = Request { source: "main.mech".into(), ..Request::default() };
                let (files, stopped) = (files(&short(&[])), AtomicBool::new(true));
                all(&pipeline::build(&request, &Compiler::default(), &files, &common::NoClock, &stopped))
            }),
        ),
        (
            "E0714",
            lazy(|| {
                let request = Request { source: "main.mech".into(), ..Request::default() };
                let (stages, files) = (Compiler::default(), files(&short(&[])));
                all(&pipeline::examine(&request, Values::Lock, Extent::Values, &stages, &files).outcome)
            }),
        ),
        ("E0721", lazy(|| at_start(&nodder(SWING, "").replace("over 2 s", "over 0.2 s")))),
        (
            "E0722",
            lazy(|| {
                let own = "motor own {\n    interface = \"pwm\"\n    stall = 177 N*mm\n    range = 180 deg\n    acceleration = 100 deg/s^2\n}\n";
                let text = nodder(&SWING.replace("sg90", "own"), "").replace("use std.motors.sg90\n", "");
                at_start(&format!("{text}\n{own}"))
            }),
        ),
        (
            "E0723",
            lazy(|| {
                at_start(&nodder(
                    "drive motor from -10 deg to 20 deg with sg90\n    rest motor at -170 deg",
                    "",
                ))
            }),
        ),
        ("E0724", lazy(|| at_start(&nodder("drive motor from 0 deg to 360 deg with sg90 continuous", "")))),
        (
            "E0725",
            lazy(|| {
                let folded = "workspace nod by motor from 0 deg to 360 deg in 40 steps";
                at_start(&nodder("drive motor from 0 deg to 360 deg with nema17", folded))
            }),
        ),
        (
            "E0726",
            lazy(|| {
                let loaded = "load 0.1 N * t along (0, -1, 0) on coupler at B\n    workspace nod by motor from -20 deg to 20 deg in 8 steps";
                at_start(&nodder(SWING, loaded))
            }),
        ),
        (
            "E0801",
            lazy(|| {
                at_start(&short(&[("    export stl", "    require max(error(tip)) <= 1 um\n    export stl")]))
            }),
        ),
    ]
}

const SWING: &str = "drive motor by 30 deg * sin(360 deg * t) with sg90";

/// The lock of the manual's first design where nothing was solved.
fn lock() -> String {
    built(&short(&[]), None, |_| {}).lock.unwrap()
}

/// The two wings this much from the mirror plane, without `removed`.
fn apart(by_mm: f64, removed: &str) -> String {
    let text = BUTTERFLY.replace("at (0 mm, 0 mm)", &format!("at ({by_mm} mm, 0 mm)"));
    if removed.is_empty() { text } else { text.replace(removed, "") }
}

/// A finger whose links all lie in one layer.
fn hand() -> String {
    let leaves = |line: &str| match [" mcp:", " pip:"].iter().any(|j| line.contains(j)) {
        true => format!("{line} as crossed_leaves\n"),
        false => format!("{line}\n"),
    };
    let text: String = include_str!("../kinematics/hand.mech").lines().map(leaves).collect();
    format!("use std.flexures.crossed_leaves\n{text}")
}
