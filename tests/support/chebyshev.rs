//! Chebyshev's lambda linkage in its rest pose as the geometry stage gets it, with leaves of a
//! stated shape instead of solved ones.

use flexura::geometry::{BodySolid, Bore, Eye, Facets, FlexureSolid, PartsInput};
use flexura::math::Pose;
use flexura::rod::SectionShape;
use nalgebra::{Rotation3, Vector3};

/// Height of a layer, mm.
pub const HEIGHT: f64 = 12.0;
/// Clearance, mm.
pub const CLEARANCE: f64 = 0.4;
/// Radius of the crank, mm.
pub const CRANK: f64 = 20.0;
/// Full thickness of the leaves at the knee and the heel, mm.
pub const THICK: [f64; 2] = [0.8, 0.7];

/// Indices of the bodies.
pub const BASE: usize = 0;
pub const CRANK_BODY: usize = 1;
pub const COUPLER: usize = 2;
pub const ROCKER: usize = 3;

fn polar(r: f64, deg: f64) -> Vector3<f64> {
    Vector3::new(r * deg.to_radians().cos(), r * deg.to_radians().sin(), 0.0)
}

/// Points O, D, A, B, P at a crank angle in degrees from +x.
pub fn points(crank_deg: f64) -> [Vector3<f64>; 5] {
    let (o, d) = (Vector3::zeros(), Vector3::new(2.0 * CRANK, 0.0, 0.0));
    let a = o + polar(CRANK, crank_deg);
    let half = (d - a) / 2.0;
    let left = Vector3::new(-half.y, half.x, 0.0).normalize();
    let b = a + half + left * ((2.5 * CRANK).powi(2) - half.norm_squared()).sqrt();
    [o, d, a, b, a + (b - a) * 2.0]
}

/// Pose of each body at a crank angle; flexures are taken as ideal hinges.
pub fn poses(crank_deg: f64) -> Vec<Pose> {
    let (rest, now) = (points(120.0), points(crank_deg));
    let turn = |i: usize, j: usize| {
        let (r, n) = (rest[j] - rest[i], now[j] - now[i]);
        n.y.atan2(n.x) - r.y.atan2(r.x)
    };
    let pose = |i: usize, j: usize| Pose {
        rotation: *Rotation3::from_axis_angle(&Vector3::z_axis(), turn(i, j)).matrix(),
        translation: now[i] - rest[i],
        center: rest[i],
    };
    vec![Pose::rest(Vector3::zeros()), pose(0, 2), pose(2, 3), pose(1, 3)]
}

/// One leaf between two points of the plane, with Hermite derivatives there.
#[allow(clippy::too_many_arguments)]
fn leaf(
    path: &str,
    joint: usize,
    joint_point: Vector3<f64>,
    bodies: (usize, usize),
    ends: [Vector3<f64>; 2],
    slopes: [Vector3<f64>; 2],
    lift: f64,
    thick: f64,
) -> FlexureSolid {
    let n = 24;
    let (mut centreline, mut m1) = (Vec::new(), Vec::new());
    for k in 0..=n {
        let u = k as f64 / n as f64;
        let (u2, u3) = (u * u, u * u * u);
        let p = ends[0] * (2.0 * u3 - 3.0 * u2 + 1.0)
            + slopes[0] * (u3 - 2.0 * u2 + u)
            + ends[1] * (3.0 * u2 - 2.0 * u3)
            + slopes[1] * (u3 - u2);
        let t = (ends[0] * (6.0 * u2 - 6.0 * u)
            + slopes[0] * (3.0 * u2 - 4.0 * u + 1.0)
            + ends[1] * (6.0 * u - 6.0 * u2)
            + slopes[1] * (3.0 * u2 - 2.0 * u))
            .normalize();
        centreline.push(p + Vector3::z() * lift);
        m1.push(Vector3::z().cross(&t));
    }
    let wide = (HEIGHT - CLEARANCE) / 2.0;
    FlexureSolid {
        fillets: [None; 2],
        path: path.into(),
        joint,
        joint_point,
        bodies,
        section: SectionShape::Ellipse,
        m2: vec![Vector3::z(); n + 1],
        a_mm: vec![thick / 2.0; n + 1],
        b_mm: vec![wide / 2.0; n + 1],
        centreline,
        m1,
    }
}

/// Crossed leaves at a joint: directions into the two bodies (degrees), half angle and radius of
/// the attachments, bulge of the leaves (0: straight).
#[allow(clippy::too_many_arguments)]
pub fn crossed_leaves(
    name: &str,
    joint: usize,
    at: Vector3<f64>,
    bodies: (usize, usize),
    into_deg: [f64; 2],
    half_deg: f64,
    size: f64,
    bulge_deg: f64,
    thick: f64,
) -> Vec<FlexureSolid> {
    let lift = (HEIGHT + CLEARANCE) / 4.0;
    [("upper", 1.0), ("lower", -1.0)]
        .into_iter()
        .map(|(rod, sign)| {
            let from = at + polar(size, into_deg[0] + sign * half_deg);
            let to = at + polar(size, into_deg[1] + sign * half_deg);
            let chord = to - from;
            let turn = |deg: f64| Rotation3::from_axis_angle(&Vector3::z_axis(), deg.to_radians()) * chord;
            let slopes = [turn(sign * bulge_deg), turn(-0.7 * sign * bulge_deg)];
            leaf(&format!("{name}.{rod}"), joint, at, bodies, [from, to], slopes, sign * lift, thick)
        })
        .collect()
}

/// The whole mechanism, at rest with the crank at 120° (drive value 30°).
pub fn chebyshev(bulge_deg: f64, facets: Facets) -> PartsInput {
    let pitch = HEIGHT + CLEARANCE;
    let [o, d, a, b, p] = points(120.0);
    let up = |q: Vector3<f64>, layer: f64| q + Vector3::z() * (layer * pitch);
    let body = |name: &str, layer: f64, skeleton: Vec<Vector3<f64>>, eyes: Vec<Eye>| BodySolid {
        name: name.into(),
        axis: Some(Vector3::z()),
        level_mm: layer * pitch,
        skeleton,
        eyes,
        ..BodySolid::default()
    };
    let eye = |joint: usize, point: Vector3<f64>, bore: Bore, slot: usize| Eye {
        joint,
        point,
        axis: Vector3::z(),
        bore,
        slot: (slot, 2),
    };
    let (motor, pin) = (up(o, -1.0), up(a, -1.0));
    let bodies = vec![
        body("base", -2.0, vec![o], vec![eye(0, motor, Bore::Through { diameter_mm: 5.8 }, 0)]),
        body(
            "crank",
            -1.0,
            vec![o, a],
            vec![
                eye(0, motor, Bore::Through { diameter_mm: 5.4 }, 1),
                eye(1, pin, Bore::Blind { diameter_mm: 3.4 }, 0),
            ],
        ),
        body("coupler", 0.0, vec![a, p], vec![eye(1, pin, Bore::Blind { diameter_mm: 3.4 }, 1)]),
        body("rocker", 0.0, vec![], vec![]),
    ];
    let towards = |q: Vector3<f64>| q.y.atan2(q.x).to_degrees();
    let mut flexures = crossed_leaves(
        "knee",
        2,
        b,
        (COUPLER, ROCKER),
        [towards(b - d), towards(d - b)],
        38.0,
        13.0,
        bulge_deg,
        THICK[0],
    );
    flexures.extend(crossed_leaves(
        "heel",
        3,
        d,
        (ROCKER, BASE),
        [towards(b - d), 270.0],
        36.0,
        14.5,
        bulge_deg,
        THICK[1],
    ));
    PartsInput {
        height_mm: HEIGHT,
        clearance_mm: CLEARANCE,
        least_wall_mm: 0.6,
        bodies,
        flexures,
        motion: Vec::new(),
        facets,
    }
}
