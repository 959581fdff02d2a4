//! The sketch on a simulated Arduino Uno: compiled without a warning by avr-gcc, run by simavr for ten
//! turns, every step pulse counted and timed. Without these tools the test says so and passes, unless
//! `FLEXURA_EXTERNAL=1` demands them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flexura::emit::arduino::Sketch;
use std::path::{Path, PathBuf};
use std::process::Command;

/// CPU cycles a microsecond.
const CYCLES_PER_US: f64 = 16.0;
/// `micros()` counts in 4 µs and a 6 µs interrupt may come between: pulses may be this late, never more.
const JITTER_US: f64 = 25.0;

fn have_tools() -> bool {
    let found = |tool: &str| Command::new(tool).arg("--version").output().is_ok_and(|o| o.status.success());
    let all = found("avr-g++")
        && found("cc")
        && Path::new("/usr/include/simavr/sim_avr.h").exists()
        && Path::new("/usr/share/arduino/hardware/arduino/avr/cores/arduino/Arduino.h").exists();
    if !all {
        assert!(
            std::env::var_os("FLEXURA_EXTERNAL").is_none(),
            "FLEXURA_EXTERNAL is set: install gcc-avr avr-libc arduino-core-avr simavr libsimavr-dev"
        );
        println!("skipped: needs gcc-avr, arduino-core-avr and libsimavr-dev");
    }
    all
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}\n{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Time (µs) and direction of every pulse in the first `seconds`.
fn pulses(sketch: &Sketch, seconds: f64) -> Vec<(f64, i64)> {
    let scripts = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/external");
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str| dir.path().join(name);
    std::fs::write(file("sketch.ino"), sketch.render().unwrap()).unwrap();
    run(Command::new(scripts.join("compile_sketch.sh")).arg(file("sketch.ino")).arg(file("sketch.elf")));
    run(Command::new("cc")
        .args(["-O2", "-Wall", "-Wextra", "-o"])
        .arg(file("count"))
        .arg(scripts.join("count_pulses.c"))
        .args(["-lsimavr"]));
    let trace = run(Command::new(file("count")).arg(file("sketch.elf")).arg(seconds.to_string()));
    let parse = |line: &str| {
        let (cycles, direction) = line.split_once(' ')?;
        let sign = if direction == "1" { 1 } else { -1 };
        Some((cycles.parse::<f64>().ok()? / CYCLES_PER_US, sign))
    };
    // simavr itself reports on standard output too; its lines do not parse.
    trace.lines().filter_map(parse).collect()
}

fn crank(closed: bool) -> Sketch {
    let degrees_a_step = if closed { 6.0 } else { 1.0 };
    Sketch {
        mechanism: "chebyshev_lambda".into(),
        drive: "motor".into(),
        steps_per_turn: 200,
        microsteps: 16,
        angles_rad: (0..=60).map(|k| (f64::from(k) * degrees_a_step - 30.0).to_radians()).collect(),
        duration_s: 2.0,
        closed,
        rest_rad: 30_f64.to_radians(),
        acceleration_rad_s2: None,
    }
}

#[test]
fn ten_turns_are_exact_in_count_and_time() {
    if !have_tools() {
        return;
    }
    let pulses = pulses(&crank(true), 5.5 + 20.1);
    let turns: Vec<f64> = pulses.iter().skip(3199).step_by(3200).map(|p| p.0).collect();
    assert!(turns.len() >= 10, "{} pulses", pulses.len());
    for (k, time) in turns.iter().enumerate() {
        let late = time - turns[0] - 2e6 * k as f64;
        assert!(late.abs() <= JITTER_US, "turn {k}: {late} us off");
    }
    assert!(pulses.iter().all(|(_, sign)| *sign == 1), "the crank never turns back");
    // Within a turn every pulse is where the table's straight lines put it: 53 or 54 pulses in 33.3 ms.
    let gaps: Vec<f64> = pulses.windows(2).map(|w| w[1].0 - w[0].0).collect();
    // It starts from rest: 4 turns/s² from the first pulse on, and is at speed after an eighth of a second.
    let (start, gaps) = gaps.split_at(200);
    assert!(
        start[0] > 4000.0 && start[20] > 1200.0 && start[20] < start[0] && start[60] < start[20],
        "{start:?}"
    );
    let began = pulses[0].0 - (2.0 * 625.0 * 126_563.0_f64).sqrt();
    let at_speed = pulses.iter().position(|p| p.0 - began > 126_563.0).unwrap();
    assert!((95..=107).contains(&at_speed), "half as far as at full speed: {at_speed}");
    let widest = gaps.iter().copied().fold(0.0, f64::max);
    let least = gaps.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(widest < 2e6 / 3200.0 * 1.02 + JITTER_US, "widest gap {widest} us");
    assert!(least > 2e6 / 3200.0 * 0.98 - JITTER_US, "least gap {least} us");
    println!("{} turns, gaps {least:.1} to {widest:.1} us", turns.len());
}

#[test]
fn a_swing_comes_back_to_where_it_began() {
    if !have_tools() {
        return;
    }
    let pulses = pulses(&crank(false), 5.5 + 13.1);
    let mut position = 0;
    let mut least = 0;
    let mut most = 0;
    for (_, sign) in &pulses {
        position += sign;
        least = least.min(position);
        most = most.max(position);
    }
    // −30° … +30° at 3200 microsteps a turn: ±266.67, rounded.
    assert_eq!((least, most), (-267, 267));
}

#[test]
fn the_fastest_allowed_motion_loses_no_pulse() {
    if !have_tools() {
        return;
    }
    // 16000 pulses a turn at 50 us each: 0.8 s a turn.
    let fast = Sketch { steps_per_turn: 500, microsteps: 32, duration_s: 0.802, ..crank(true) };
    let pulses = pulses(&fast, 5.5 + 8.1);
    let turns: Vec<f64> = pulses.iter().skip(15999).step_by(16000).map(|p| p.0).collect();
    assert!(turns.len() >= 9, "{} pulses", pulses.len());
    for (k, time) in turns.iter().enumerate() {
        let late = time - turns[0] - 0.802e6 * k as f64;
        assert!(late.abs() <= JITTER_US, "turn {k}: {late} us off");
    }
}
