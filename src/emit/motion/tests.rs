//! Angles are those of the design, closed exactly, and tables invert what they were made of.

use super::*;
use crate::ir::MotorMotion;
use proptest::prelude::*;
use std::f64::consts::PI;
use std::sync::LazyLock;

fn motor(interface: MotorInterface, motion: MotorMotion) -> Motor {
    Motor { name: "m".into(), interface, stall_n_mm: 100.0, shaft_diameter_mm: None, motion }
}

fn raw(profile: Profile, motor: Option<Motor>) -> Raw {
    Raw {
        axis: Axis {
            name: "crank".into(),
            motor,
            continuous: false,
            unit: DriveUnit::Rad,
            drum_radius_mm: None,
            rest: 0.0,
            values: Vec::new(),
            shaft_mdeg: Vec::new(),
            between_rad: 0.0,
            closed: false,
            origin: Origin::default(),
        },
        source: Source { profile, sign: 1.0, states: Vec::new() },
    }
}

fn servo(speed_deg_s: f64) -> Motor {
    let motion = MotorMotion { speed_rad_s: Some(speed_deg_s.to_radians()), ..MotorMotion::default() };
    motor(MotorInterface::Pwm { range_rad: PI }, motion)
}

/// 0, 35°, −35°, 0.
fn swing() -> Profile {
    let keys = [(0.0, 0.0), (0.25, 35.0), (0.75, -35.0), (1.0, 0.0)];
    Profile::Keys {
        smooth: false,
        keys: keys.map(|(t, v): (f64, f64)| (t, v.to_radians())).to_vec(),
        closed: true,
    }
}

#[test]
fn a_servo_that_is_asked_for_too_much_says_how_much() {
    let of =
        |speed: f64| Motion::sample("m", &[raw(swing(), Some(servo(speed)))], 60, 1.0).unwrap().refusals();
    assert_eq!(of(141.0), []);
    // 35 deg in a quarter of a second.
    let [Refusal::Beyond { limit: Limit::Speed, asked, least_duration_s: Some(least), .. }] = &of(100.0)[..]
    else {
        panic!("140 deg/s is too fast")
    };
    assert!((asked - 140.0).abs() < 1e-9 && (least - 1.4).abs() < 1e-9, "{asked} {least}");
}

#[test]
fn acceleration_counts_where_a_swing_turns_back() {
    let limited = |a: f64| {
        let motion = MotorMotion { acceleration_rad_s2: Some(a.to_radians()), ..MotorMotion::default() };
        let m = motor(MotorInterface::Pwm { range_rad: PI }, motion);
        let line = Profile::Range { from: 0.0, to: 1.0_f64.to_radians() };
        Motion::sample("m", &[raw(line, Some(m))], 10, 1.0).unwrap().refusals()
    };
    // 1 deg/s forth, 1 deg/s back, a tenth of a second between: 20 deg/s².
    assert_eq!(limited(20.1), []);
    assert!(matches!(limited(19.9)[..], [Refusal::Beyond { limit: Limit::Acceleration, .. }]));
}

#[test]
fn the_rest_pose_is_within_the_range_and_in_its_middle_where_it_can_be() {
    let rest = |from: f64, to: f64| {
        let line = Profile::Range { from: from.to_radians(), to: to.to_radians() };
        let motion = Motion::sample("m", &[raw(line, Some(servo(1e6)))], 10, 1.0).unwrap();
        (motion.axes[0].servo_rest_rad().unwrap().to_degrees(), motion.refusals().len())
    };
    for (ends, want) in [((-20.0, 50.0), 90.0), ((0.0, 150.0), 30.0), ((-170.0, 10.0), 170.0)] {
        let (at, refused) = rest(ends.0, ends.1);
        assert!((at - want).abs() < 1e-9 && refused == 0, "{ends:?} {at}");
    }
    // 100 to 200 deg is 100 deg of motion, but 200 from the rest pose at 0.
    assert_eq!(rest(100.0, 200.0).1, 1);
}

#[test]
fn a_servo_does_not_turn_on_and_a_full_bus_servo_does() {
    let turning = |interface| {
        let full = Profile::Range { from: 0.0, to: TAU };
        let mut r = raw(full, Some(motor(interface, MotorMotion::default())));
        r.axis.continuous = true;
        let motion = Motion::sample("m", &[r], 60, 2.0).unwrap();
        assert_eq!(motion.axes[0].cycle_mdeg(), 360_000);
        motion.refusals()
    };
    assert!(matches!(turning(MotorInterface::Pwm { range_rad: PI })[..], [Refusal::Endless { .. }]));
    assert!(matches!(turning(MotorInterface::Dynamixel { range_rad: 5.0 })[..], [Refusal::Endless { .. }]));
    assert_eq!(turning(MotorInterface::Dynamixel { range_rad: TAU }), []);
}

#[test]
fn a_drum_turns_by_length_over_radius() {
    let mut r = raw(Profile::Range { from: 0.0, to: 5.0 }, Some(servo(1e6)));
    (r.axis.unit, r.axis.drum_radius_mm, r.axis.rest) = (DriveUnit::Mm, Some(4.0), 1.0);
    let motion = Motion::sample("m", &[r], 4, 1.0).unwrap();
    let want: Vec<i32> =
        [-1.0, 0.25, 1.5, 2.75, 4.0_f64].map(|mm| ((mm / 4.0).to_degrees() * 1e3).round() as i32).into();
    assert_eq!(motion.axes[0].shaft_mdeg, want);
    assert!(!motion.closed);
}

#[test]
fn states_in_another_order_with_the_sign_reversed_are_the_motor_s_own() {
    let n = 60;
    let original = raw(swing(), Some(servo(1e6)));
    let mut image = original.clone();
    // v(state(s)) = −v(s): half a cycle later.
    image.source.states = (0..=n).map(|s| (s + n / 2) % n).collect();
    image.source.sign = -1.0;
    let motion = Motion::sample("m", &[original, image], n, 4.0).unwrap();
    assert!(motion.axes[0].shaft_mdeg.iter().any(|m| *m > 30_000));
    assert_eq!(motion.axes[0].shaft_mdeg, motion.axes[1].shaft_mdeg);
}

/// A grid over two drives from −1 to 1 (degrees), with outputs by a function.
fn grid(n: usize, refine: usize, f: impl Fn(f64, f64) -> [f64; 2]) -> Grid {
    let places: Vec<f64> = (0..=n * refine).map(|k| k as f64 * 2.0 / (n * refine) as f64 - 1.0).collect();
    let axis = |axis: usize, name: &str| GridAxis {
        axis,
        name: name.into(),
        shaft_deg: places.clone(),
        value: places.clone(),
        unit: "deg",
        resolution_deg: 0.1,
    };
    let at = |o: usize| {
        places.iter().flat_map(|a| places.iter().map(|b| f(*a, *b)[o]).collect::<Vec<_>>()).collect()
    };
    Grid {
        name: "g".into(),
        wanted: vec![("x".into(), OutputUnit::Mm), ("y".into(), OutputUnit::Mm)],
        axes: vec![axis(0, "a"), axis(1, "b")],
        refine,
        outputs: vec![at(0), at(1)],
        part: false,
    }
}

static BENT: LazyLock<Result<AimTable, AimError>> = LazyLock::new(|| AimTable::new(&grid(12, 4, bent)));

fn bent(a: f64, b: f64) -> [f64; 2] {
    [10.0 * a + 2.0 * b * b + a * b, 8.0 * b + 3.0 * (a * 1.5).sin()]
}

proptest! {
    #[test]
    fn a_grid_is_inverted_within_its_stated_error(a in -0.95..0.95_f64, b in -0.95..0.95_f64) {
        let table = BENT.as_ref().unwrap();
        let want = bent(a, b);
        let found = table.solve(&want).unwrap();
        let got = bent(found[0], found[1]);
        let off = (got[0] - want[0]).hypot(got[1] - want[1]);
        prop_assert!(off <= table.error, "{off} {}", table.error);
        prop_assert!(table.error < 0.05, "{}", table.error);
    }

    #[test]
    fn a_stretch_is_inverted_within_its_stated_error(a in -1.0..1.0_f64, down in any::<bool>()) {
        let sign = if down { -1.0 } else { 1.0 };
        let f = |a: f64| sign * (20.0 * a + 6.0 * a * a);
        let mut g = grid(16, 4, |_, _| [0.0; 2]);
        g.axes.truncate(1);
        g.wanted.truncate(1);
        g.outputs = vec![g.axes[0].value.iter().map(|v| f(*v)).collect()];
        let table = AimTable::new(&g).unwrap();
        let found = table.solve(&[f(a)]).unwrap();
        prop_assert!((f(found[0]) - f(a)).abs() <= table.error, "{} {}", f(found[0]) - f(a), table.error);
        prop_assert!(table.error < 0.2);
        prop_assert!(table.solve(&[30.0]).is_none() && table.solve(&[-30.0]).is_none());
    }
}

#[test]
fn what_cannot_be_inverted_is_named() {
    let AimError::Folds { region } = AimTable::new(&grid(8, 2, |a, b| [a * a, b])).unwrap_err() else {
        panic!()
    };
    assert_eq!(region, "a 0.00 to 0.25 deg, b -1.00 to -0.75 deg");
    // Turned once round and over itself, never back.
    let round = |a: f64, b: f64| [(3.0 + b) * (4.0 * a).cos(), (3.0 + b) * (4.0 * a).sin()];
    assert!(matches!(AimTable::new(&grid(24, 1, round)), Err(AimError::Folds { .. })));
    assert_eq!(AimTable::new(&grid(8, 2, |_, _| [0.0, 0.0])), Err(AimError::Flat));
    let mut g = grid(8, 2, |_, _| [0.0; 2]);
    g.axes.truncate(1);
    g.outputs = vec![g.axes[0].value.iter().map(|v| (v - 0.5).powi(2)).collect()];
    assert!(matches!(AimTable::new(&g), Err(AimError::Folds { .. })));
    // The longest stretch that goes one way is from −1 to 0.5.
    g.part = true;
    let table = AimTable::new(&g).unwrap();
    assert_eq!(table.region, "a -1.00 to 0.50 deg");
    assert!((table.solve(&[1.0]).unwrap()[0] + 0.5).abs() < 0.02);
}
