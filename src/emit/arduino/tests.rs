//! Positions are exact whatever the motor and the profile, and no name can escape its comment.

use super::*;
use proptest::prelude::*;

/// The crank of Chebyshev's linkage: one turn in two seconds, printed at 30°.
pub(crate) fn crank() -> Sketch {
    Sketch {
        mechanism: "chebyshev_lambda".into(),
        drive: "motor".into(),
        steps_per_turn: 200,
        microsteps: 16,
        angles_rad: (0..=60).map(|k| (f64::from(k) * 6.0 - 30.0).to_radians()).collect(),
        duration_s: 2.0,
        closed: true,
        rest_rad: 30_f64.to_radians(),
        acceleration_rad_s2: None,
    }
}

#[test]
fn the_sketch_of_a_turning_crank() {
    insta::assert_snapshot!(crank().render().unwrap());
}

#[test]
fn the_sketch_of_a_swinging_drive() {
    let swing = Sketch {
        angles_rad: (0..=10).map(|k| (f64::from(k) * 4.0 - 10.5).to_radians()).collect(),
        closed: false,
        ..crank()
    };
    insta::assert_snapshot!(swing.render().unwrap());
}

#[test]
fn starts_where_the_part_rests() {
    let table = crank().table().unwrap();
    assert_eq!(table.start_state, 5);
    assert_eq!(table.targets[5], 0);
    assert_eq!(table.targets[60] - table.targets[0], 3200);
}

#[test]
fn names_cannot_leave_their_comment() {
    let nasty = Sketch { mechanism: "a\nint x; \\".into(), drive: "é*/ \"b\" ??/".into(), ..crank() };
    let text = nasty.render().unwrap();
    assert_eq!(
        text.lines().next(),
        Some("// a_int x_ _: drives \"___ _b_ ___\" with a stepper motor behind a step/direction driver")
    );
    assert!(nasty.name().chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
    assert_eq!(text.lines().count(), crank().render().unwrap().lines().count());
}

#[test]
fn says_why_there_is_no_sketch() {
    let error = |s: Sketch| s.table().unwrap_err();
    assert_eq!(error(Sketch { microsteps: 0, ..crank() }), SketchError::Resolution);
    assert_eq!(error(Sketch { angles_rad: vec![0.0], ..crank() }), SketchError::States { states: 0 });
    assert_eq!(
        error(Sketch { angles_rad: vec![0.0; MOST_STATES + 2], ..crank() }),
        SketchError::States { states: MOST_STATES + 1 }
    );
    assert_eq!(
        error(Sketch { angles_rad: vec![0.0, f64::NAN], ..crank() }),
        SketchError::Position { state: 1 }
    );
    assert_eq!(error(Sketch { angles_rad: vec![0.0, 1.0], ..crank() }), SketchError::NotClosed);
    assert!(error(Sketch { duration_s: f64::NAN, ..crank() }).to_string().contains("NaN"));
    assert!(matches!(error(Sketch { duration_s: 1e9, ..crank() }), SketchError::Duration { .. }));
    let SketchError::TooFast { least_duration_s, .. } = error(Sketch { duration_s: 0.1, ..crank() }) else {
        panic!("100 ms a turn is too fast");
    };
    assert!(Sketch { duration_s: least_duration_s, ..crank() }.table().is_ok());
}

proptest! {
    #[test]
    fn a_closed_cycle_is_exactly_whole_turns(
        steps in 1u32..1000, micro in 1u32..257, turns in -5i32..=5, rest in -7.0..7.0f64,
        wobble in prop::collection::vec(-1.0..1.0f64, 1..200),
    ) {
        let n = wobble.len();
        let mut angles: Vec<f64> =
            (0..=n).map(|k| f64::from(turns) * TAU * k as f64 / n as f64 - rest).collect();
        for (a, w) in angles.iter_mut().skip(1).zip(wobble.iter().take(n - 1)) {
            *a += w;
        }
        let sketch = Sketch {
            steps_per_turn: steps, microsteps: micro, angles_rad: angles.clone(), duration_s: 1799.0, ..crank()
        };
        let table = match sketch.table() {
            Err(SketchError::TooFast { .. }) => return Ok(()),
            other => other.unwrap(),
        };
        let pulses: i64 = table.targets.windows(2).map(|w| i64::from(w[1]) - i64::from(w[0])).sum();
        prop_assert_eq!(pulses, i64::from(turns) * i64::from(steps) * i64::from(micro));
        // No state is off by more than the rounding of one position.
        for (target, angle) in table.targets.iter().zip(&angles).take(n) {
            let ideal = angle / TAU * f64::from(steps * micro);
            prop_assert!((f64::from(*target) - ideal).abs() <= 0.5 + 1e-9 * ideal.abs());
        }
    }
}
