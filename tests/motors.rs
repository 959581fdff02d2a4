//! Motor code: what it says is what the design does. Sketches run on a simulated Uno, the MicroPython module under
//! MicroPython, the C header behind a C compiler; tables of `aim` are held against the solver. Without these tools the
//! tests say so and pass, unless `FLEXURA_EXTERNAL=1` demands them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use flexura::diagnostic::Diagnostic;
use flexura::pipeline::{self, Compiler, Request};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;

/// A pulse may differ from the design's angle by this, us.
const PULSE_US: f64 = 5.0;
/// Tables are in thousandths of a degree.
const TABLE_DEG: f64 = 1.01e-3;

/// A four-bar that nods; `DRIVE`, `MORE` and `EXPORTS` are put in.
const NODDER: &str = include_str!("motors/nodder.mech");

fn nodder(motor: &str, drive: &str, more: &str, exports: &str) -> String {
    let text = NODDER.replace("MOTOR", motor).replace("DRIVE", drive).replace("MORE", more);
    text.replace("EXPORTS", exports)
}

/// Artefacts by name, and findings.
fn build(text: &str, lock: Option<String>) -> (BTreeMap<String, String>, Vec<Diagnostic>) {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let lock = lock.map(|l| ("main.lock".to_string(), l));
    let request = Request { source: "main.mech".into(), lock, ..Request::default() };
    let out =
        pipeline::build(&request, &Compiler::default(), &files, &common::NoClock, &AtomicBool::new(false));
    let text = |b: &[u8]| String::from_utf8(b.to_vec()).unwrap();
    (out.artefacts.iter().map(|a| (a.name.clone(), text(&a.bytes))).collect(), out.diagnostics)
}

fn built(text: &str) -> BTreeMap<String, String> {
    let (artefacts, found) = build(text, None);
    let errors: Vec<&Diagnostic> = found.iter().filter(|d| d.is_error()).collect();
    assert!(errors.is_empty() && !artefacts.is_empty(), "{errors:?}");
    artefacts
}

fn scripts() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/external")
}

fn have(tools: &[&str], files: &[&str], what: &str) -> bool {
    let found = |tool: &&str| Command::new(tool).arg("--version").output().is_ok_and(|o| o.status.success());
    let all = tools.iter().all(found) && files.iter().all(|f| Path::new(f).exists());
    if !all {
        assert!(std::env::var_os("FLEXURA_EXTERNAL").is_none(), "FLEXURA_EXTERNAL is set: install {what}");
        println!("skipped: needs {what}");
    }
    all
}

fn have_avr() -> bool {
    let core = "/usr/share/arduino/hardware/arduino/avr/cores/arduino/Arduino.h";
    let files = ["/usr/include/simavr/sim_avr.h", core];
    have(&["avr-g++", "cc"], &files, "gcc-avr avr-libc arduino-core-avr simavr libsimavr-dev")
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}\n{errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn compile(folder: &Path, sketch: &str) -> PathBuf {
    std::fs::write(folder.join("sketch.ino"), sketch).unwrap();
    let elf = folder.join("sketch.elf");
    let flags = format!("-I{} -DDXL_SERIAL=Serial", scripts().join("dynamixel").display());
    run(Command::new(scripts().join("compile_sketch.sh"))
        .arg(folder.join("sketch.ino"))
        .arg(&elf)
        .env("SKETCH_FLAGS", flags));
    elf
}

/// Changes of every signal of a VCD file: time (us) and value.
fn vcd(text: &str) -> BTreeMap<String, Vec<(f64, u32)>> {
    assert!(text.contains("$timescale 10ns"), "the trace counts in 10 ns");
    let (mut names, mut out) = (BTreeMap::new(), BTreeMap::<String, Vec<(f64, u32)>>::new());
    let mut time_us = 0.0;
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["$var", _, _, id, name, "$end"] => {
                names.insert(id.to_string(), name.to_string());
            }
            [time] if time.starts_with('#') => time_us = time[1..].parse::<f64>().unwrap() / 100.0,
            [bits, id] if bits.starts_with('b') && !bits.contains('x') => {
                let value = u32::from_str_radix(&bits[1..], 2).unwrap();
                out.entry(names[*id].clone()).or_default().push((time_us, value));
            }
            [bit] if bit.len() == 2 && (bit.starts_with('0') || bit.starts_with('1')) => {
                let value = u32::from(bit.starts_with('1'));
                out.entry(names[&bit[1..]].clone()).or_default().push((time_us, value));
            }
            _ => {}
        }
    }
    out
}

#[test]
fn servo_pulses_are_the_design_s_angles() {
    if !have_avr() {
        return;
    }
    let drive = "drive motor by 30 deg * sin(360 deg * t) with sg90";
    let artefacts = built(&nodder("sg90", drive, "", "arduino(motor)"));
    let dir = tempfile::tempdir().unwrap();
    let elf = compile(dir.path(), &artefacts["nodder_motor/nodder_motor.ino"]);
    let (runner, trace) = (dir.path().join("run"), dir.path().join("trace.vcd"));
    run(Command::new("cc")
        .args(["-O2", "-o"])
        .arg(&runner)
        .arg(scripts().join("run_sketch.c"))
        .arg("-lsimavr"));
    // Two seconds in the rest pose, a cycle and a half, then 10 deg.
    run(Command::new(&runner).arg(&elf).arg("6").arg(&trace).args(["5.0", "p 10"]));
    let signals = vcd(&std::fs::read_to_string(&trace).unwrap());
    let pulse_us = |deg: f64| 500.0 + 1900.0 * (deg + 90.0) / 180.0;

    // The pin itself: a pulse every 20 ms, of the rest pose's width, and this is the register's value.
    let pin = &signals["oc1a"];
    let rises: Vec<f64> = pin.iter().filter(|c| c.1 == 1).map(|c| c.0).collect();
    assert!(
        rises.len() > 250 && rises.windows(2).all(|w| (w[1] - w[0] - 20_000.0).abs() < 1.0),
        "{}",
        rises.len()
    );
    let first = pin.iter().position(|c| c.1 == 1).unwrap();
    let width = pin[first + 1].0 - pin[first].0;
    assert!((width - pulse_us(0.0)).abs() < PULSE_US, "{width}");

    let registers = &signals["ocr1a"];
    let width_at = |time: f64| {
        let value = registers.iter().rev().find(|c| c.0 <= time).unwrap().1;
        (f64::from(value) + 1.0) / 2.0
    };
    assert!((width_at(1e6) - width).abs() < 0.2);
    // The first change is the first frame of the cycle.
    let start = registers.iter().find(|c| c.0 > 1e6).unwrap().0;
    let mut worst = 0.0_f64;
    for k in 1..=145 {
        let t = k as f64 * 0.02 / 2.0;
        let want = pulse_us(30.0 * (std::f64::consts::TAU * t).sin());
        let got = width_at(start + (k as f64 - 1.0) * 20_000.0 + 10_000.0);
        worst = worst.max((got - want).abs());
    }
    println!("start {:.3} s, worst {worst:.2} us", start / 1e6);
    assert!((1.9e6..2.2e6).contains(&start) && worst < PULSE_US, "{start} {worst}");
    let last = registers.last().unwrap().1;
    assert!(((f64::from(last) + 1.0) / 2.0 - pulse_us(10.0)).abs() < PULSE_US, "{last}");
}

#[test]
fn sketches_of_all_motors_compile() {
    if !have_avr() {
        return;
    }
    let swing = |motor: &str| format!("drive motor by 30 deg * sin(360 deg * t) with {motor}");
    let full = "drive motor from 0 deg to 360 deg with xl330_m288 continuous";
    for (motor, drive) in [
        ("xl320", swing("xl320")),
        ("xl330_m077", swing("xl330_m077")),
        ("xl330_m288", full.to_string()),
        ("mg90s", swing("mg90s")),
        ("mg996r", swing("mg996r")),
        ("nema17", swing("nema17")),
    ] {
        let artefacts = built(&nodder(motor, &drive, "", "arduino"));
        let (name, sketch) = artefacts.iter().next().unwrap();
        let dir = tempfile::tempdir().unwrap();
        compile(dir.path(), sketch);
        println!("{motor}: {name}");
    }
}

/// What C and MicroPython are asked: positions all over the cycle and beyond, and aims.
fn questions() -> (Vec<u32>, Vec<f64>) {
    ((0..=500).map(|k| k * 8_137).collect(), (0..60).map(|k| -20.0 + 0.6 * f64::from(k)).collect())
}

/// Answers by the JSON artefact: shaft angle at each time, mdeg, and what each aim gives, -1 out of reach.
fn answers(json: &Value, times_us: &[u32], aims: &[f64]) -> Vec<f64> {
    let list = |v: &Value| v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<f64>>();
    let shaft = list(&json["drives"][0]["shaft_deg"]);
    let cycle = json["duration_s"].as_f64().unwrap() * 1e6;
    let n = shaft.len() - 1;
    let at = |t: &u32| {
        let x = f64::from(*t).rem_euclid(cycle) / cycle * n as f64;
        let k = (x.floor() as usize).min(n - 1);
        1e3 * (shaft[k] + (x - k as f64) * (shaft[k + 1] - shaft[k]))
    };
    let (nodes, angles) =
        (list(&json["aims"][0]["outputs"][0]["values"]), list(&json["aims"][0]["drives"][0]["shaft_deg"]));
    let aim = |x: &f64| {
        let k = nodes.windows(2).position(|w| (w[0]..=w[1]).contains(x));
        k.map_or(-1.0, |k| {
            1e3 * (angles[k] + (x - nodes[k]) / (nodes[k + 1] - nodes[k]) * (angles[k + 1] - angles[k]))
        })
    };
    times_us.iter().map(at).chain(aims.iter().map(aim)).collect()
}

fn numbers(text: &str) -> Vec<f64> {
    text.lines().filter_map(|l| l.trim().parse().ok()).collect()
}

fn agree(got: &[f64], want: &[f64], what: &str) {
    assert_eq!(got.len(), want.len(), "{what}");
    let off = got.iter().zip(want).map(|(g, w)| (g - w).abs()).fold(0.0, f64::max);
    println!("{what}: {off:.2} thousandths of a degree");
    // Two roundings, and single precision in the aims.
    assert!(off <= 2.5, "{what}: {off}");
    assert!(want.contains(&-1.0) && want.iter().filter(|w| w.abs() > 1e3).count() > 100);
}

#[test]
fn c_and_micropython_say_what_the_table_says() {
    let drive = "drive motor by 30 deg * sin(360 deg * t) with sg90";
    let artefacts = built(&nodder("sg90", drive, "", "c, micropython, json, csv, ros2"));
    let json: Value = serde_json::from_str(&artefacts["nodder_motion.json"]).unwrap();
    let (times, aims) = questions();
    let want = answers(&json, &times, &aims);
    let dir = tempfile::tempdir().unwrap();
    for (name, text) in &artefacts {
        std::fs::write(dir.path().join(name), text).unwrap();
    }
    let list = |v: &[f64]| v.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", ");
    let list_us = times.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    if have(&["gcc"], &[], "gcc") {
        let main = format!(
            "#include \"nodder_motion.h\"\n#include <stdio.h>\n\
             static const unsigned times[] = {{{list_us}}};\nstatic const double aims[] = {{{}}};\n\
             int main(void) {{\n  unsigned i;\n  for (i = 0; i < sizeof times / sizeof *times; ++i)\n\
             printf(\"%ld\\n\", (long)nodder_position_mdeg(0, times[i]));\n\
             for (i = 0; i < sizeof aims / sizeof *aims; ++i) {{\n    int32_t shaft[NODDER_AXES] = {{0}};\n\
             printf(\"%ld\\n\", nodder_aim_nod((float)aims[i], shaft) ? (long)shaft[0] : -1L);\n  }}\n  return 0;\n}}\n",
            list(&aims)
        );
        std::fs::write(dir.path().join("main.c"), main).unwrap();
        let program = dir.path().join("main");
        let strict = ["-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic", "-o"];
        run(Command::new("gcc").args(strict).arg(&program).arg(dir.path().join("main.c")));
        agree(&numbers(&run(&mut Command::new(program))), &want, "C");
    }
    let micropython = std::env::var("MICROPYTHON").unwrap_or_default();
    let module = format!("{micropython}/micropython.mjs");
    if have(
        &["node"],
        &[&module],
        "node and npm's @micropython/micropython-webassembly-pyscript (MICROPYTHON)",
    ) {
        let program = dir.path().join("ask.txt");
        let text = format!(
            "import nodder as m\nfor t in ({list_us},):\n    print(m.position_mdeg(0, t))\nfor x in ({},):\n    \
             s = m.aim_nod(x)\n    print(-1 if s is None else s[0])\np = m.Player(lambda s: None, lambda us: None)\n\
             p.cycle(2)\nassert p.now == [m.position_mdeg(0, 0)], p.now\np.go_to([10])\n\
             assert abs(m.value(0, p.now[0]) - 10) < 0.002\nassert m.pulse_ns(0, 0) == 1450000\n",
            list(&aims)
        );
        std::fs::write(&program, text).unwrap();
        let out = run(Command::new("node")
            .arg(scripts().join("run_micropython.mjs"))
            .arg(dir.path())
            .arg(&program)
            .env("MICROPYTHON", micropython));
        agree(&numbers(&out), &want, "MicroPython");
    }
}

#[test]
fn keyframes_are_the_design_s_values() {
    let drive = "drive motor from -20 deg to 25 deg with sg90\n    rest motor at 5 deg";
    let artefacts = built(&nodder("sg90", drive, "", "csv, json, ros2"));
    let (header, rows) = common::table(&artefacts["nodder_motion.csv"]);
    assert_eq!(header, ["t_s", "motor_deg", "motor.shaft_deg"]);
    assert_eq!(rows.len(), 41);
    for (k, row) in rows.iter().enumerate() {
        let deg = -20.0 + 45.0 * k as f64 / 40.0;
        let want = [2.0 * k as f64 / 40.0, deg, deg - 5.0];
        assert!(row.iter().zip(want).all(|(a, b)| (a - b).abs() < TABLE_DEG), "{row:?}");
    }
    let yaml = &artefacts["nodder_trajectory.yaml"];
    assert!(yaml.contains("joint_names: [motor]\n"));
    let positions: Vec<f64> = yaml
        .lines()
        .filter_map(|l| l.strip_prefix("  - positions: [")?.strip_suffix(']')?.parse().ok())
        .collect();
    assert_eq!(positions.len(), 41);
    assert!((positions[40].to_degrees() - 25.0).abs() < 1e-6, "{}", positions[40]);
    assert!(yaml.ends_with("time_from_start: {sec: 2, nanosec: 0}\n"));
}

fn code_of(text: &str, code: &str) -> Diagnostic {
    let (_, found) = build(text, None);
    found.iter().find(|d| d.code == code).unwrap_or_else(|| panic!("{code}: {found:?}")).clone()
}

#[test]
fn limits_and_what_cannot_be_inverted_are_told_with_their_place() {
    let swing = |deg: f64, motor: &str| format!("drive motor by {deg} deg * sin(360 deg * t) with {motor}");
    let fast = nodder("sg90", &swing(30.0, "sg90"), "", "c").replace("over 2 s", "over 0.2 s");
    let d = code_of(&fast, "E0721");
    assert!(
        d.message.starts_with("`motor` would have to turn at 9") && d.message.contains("600 deg/s"),
        "{d:?}"
    );
    assert!(fast[d.labels[0].at.start as usize..].starts_with("drive motor"));
    let beyond =
        nodder("sg90", "drive motor from -10 deg to 20 deg with sg90\n    rest motor at -170 deg", "", "c");
    // The elaborated range is that of the motion alone; a servo must also reach its rest pose.
    let (_, found) = build(&beyond, None);
    assert!(found.iter().any(|d| d.code == "E0723" || d.is_error()), "{found:?}");
    let endless = nodder("sg90", "drive motor from 0 deg to 360 deg with sg90 continuous", "", "c");
    assert!(code_of(&endless, "E0724").message.contains("turns on without end"));
    // A crank's rocker turns back at both dead points.
    let full = "drive motor from 0 deg to 360 deg with nema17";
    let folded = nodder("nema17", full, "workspace nod by motor from 0 deg to 360 deg in 40 steps", "c");
    let d = code_of(&folded, "E0725");
    assert!(d.message.contains("turns back at motor ") && d.message.ends_with(" deg"), "{d:?}");
    assert!(folded[d.labels[0].at.start as usize..].starts_with("workspace nod"));
    let moved = nodder(
        "sg90",
        &swing(30.0, "sg90"),
        "load 0.1 N * t along (0, -1, 0) on coupler at B\n    workspace nod by motor from -20 deg to 20 deg",
        "c",
    );
    assert!(code_of(&moved, "E0726").message.contains("loads that do not change"));
    let steady = moved.replace("N * t", "N").replace("20 deg\n", "20 deg in 8 steps\n");
    assert!(built(&steady)["nodder_motion.h"].contains("nodder_aim_nod"));
    let odd =
        nodder("sg90", &swing(30.0, "sg90"), "workspace nod, tip.x by motor from -20 deg to 20 deg", "c");
    assert_eq!(code_of(&odd, "E0452").labels[0].text, "2 and 1");
}

/// Random numbers in 0..1, the same every time.
fn random(seed: u64, n: usize) -> Vec<f64> {
    common::noise(seed, n).iter().map(|x| (x + 1.0) / 2.0).collect()
}

/// The design by itself with more statements, its lock's values, and what its motion table says.
fn locked(folder: &str, name: &str, mechanism: &str, more: &str, exports: &str) -> (String, String) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples").join(folder);
    let text = std::fs::read_to_string(path.join(format!("{name}.mech"))).unwrap();
    let lock = std::fs::read_to_string(path.join(format!("{name}.lock"))).unwrap();
    let head = format!("mechanism {mechanism} {{\n");
    assert!(text.contains(&head) && text.contains("    export stl"));
    let text = text.replace(&head, &format!("{head}{more}\n"));
    let line = |l: &str| match l.trim_start().starts_with("export ") {
        true => format!("    export {exports}\n"),
        false => format!("{l}\n"),
    };
    (text.lines().map(line).collect(), lock)
}

/// Aims at a hundred random targets through the JSON table and asks the solver where the mechanism is then.
fn aims_hit(text: &str, lock: String, table: usize) {
    use flexura::elaborate::{Options, elaborate};
    use flexura::emit::lock::Lock;
    use flexura::pipeline::Stages;
    let (artefacts, found) = build(text, Some(lock.clone()));
    assert!(!found.iter().any(|d| d.code == "E0725" || d.code == "E0726"), "{found:?}");
    let json: Value = serde_json::from_str(artefacts.values().next().unwrap()).unwrap();
    let aim = &json["aims"][table];
    let list = |v: &Value| v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<f64>>();
    let stated = aim["error"].as_f64().unwrap();
    let outputs: Vec<Vec<f64>> =
        aim["outputs"].as_array().unwrap().iter().map(|o| list(&o["values"])).collect();
    let shafts: Vec<Vec<f64>> =
        aim["drives"].as_array().unwrap().iter().map(|o| list(&o["shaft_deg"])).collect();
    let made = flexura::emit::motion::AimTable {
        name: String::new(),
        wanted: Vec::new(),
        axes: (0..shafts.len()).collect(),
        shaft_mdeg: shafts.iter().map(|s| s.iter().map(|d| (d * 1e3).round() as i32).collect()).collect(),
        outputs: outputs.iter().map(|o| o.iter().map(|v| *v as f32).collect()).collect(),
        error: stated,
        resolution: 0.0,
        region: String::new(),
    };
    // Targets: any that are reached, within the least and largest outputs.
    let ends = |o: &[f64]| {
        (o.iter().copied().fold(f64::INFINITY, f64::min), o.iter().copied().fold(f64::NEG_INFINITY, f64::max))
    };
    let dice = random(7, 2000);
    let mut targets = Vec::new();
    for pair in dice.chunks(2) {
        let target: Vec<f64> =
            outputs.iter().zip(pair).map(|(o, r)| ends(o).0 + r * (ends(o).1 - ends(o).0)).collect();
        if let Some(shaft) = made.solve(&target).filter(|_| targets.len() < 100) {
            targets.push((target, shaft));
        }
    }
    assert_eq!(targets.len(), 100);
    // Near ones after each other: the solver follows.
    targets.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let assembly = elaborate("main.mech", &files, &Options::default()).assembly.unwrap();
    let design = &assembly.designs[0];
    let lock = Lock::parse(&lock, 0).unwrap();
    let values = lock.start_values(design);
    let rest: Vec<f64> = design.drives.iter().map(|d| d.rest).collect();
    let places: Vec<Vec<f64>> =
        targets.iter().map(|(_, s)| s.iter().zip(&rest).map(|(s, r)| s.to_radians() + r).collect()).collect();
    let there = Compiler::default().respond(design, &values, &places).unwrap();
    let mut worst = 0.0_f64;
    for (k, (target, _)) in targets.iter().enumerate() {
        let got = match target.len() {
            1 => vec![there.angles_rad[0][k].to_degrees()],
            _ => there.traces_mm[0][k][..2].to_vec(),
        };
        let off = got.iter().zip(target).map(|(g, t)| (g - t).powi(2)).sum::<f64>().sqrt();
        worst = worst.max(off);
    }
    println!("worst {worst:.4} of 100, stated {stated:.4}");
    assert!(worst <= stated && stated < 0.3, "{worst} {stated}");
}

#[test]
fn the_car_s_wheels_and_the_eye_s_gaze_are_where_they_are_aimed() {
    if common::skipped() {
        return;
    }
    let (car, lock) = locked("car", "car", "half_steering", "", "json");
    aims_hit(&car, lock, 0);
    let more = "    workspace gaze.x, gaze.y by yaw from -25 deg to 25 deg, pitch from -20 deg to 20 deg";
    let (eye, lock) = locked("eye", "eye", "eye", more, "json");
    aims_hit(&eye, lock, 0);
}
