//! Solids of bodies that are no planar stack, of sliders, of ways into other layers, and of links that make way for
//! their own flexures, measured on meshes and over the cycle.
#![allow(clippy::unwrap_used)]

#[path = "support/chebyshev.rs"]
#[allow(dead_code)]
mod chebyshev;

use chebyshev::{BASE, COUPLER, CRANK_BODY, crossed_leaves, points, poses};
use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model};
use flexura::geometry::distance::separation;
use flexura::geometry::link::{BodyPlan, Role};
use flexura::geometry::{
    BodySolid, Bore, Facets, FlexureSolid, Member, MovedState, PartsInput, Probe, Slot, build_carved_parts,
    build_parts, carved_cycle_gaps, check_mesh, parts_input, plan_bodies, skeleton_capsules,
};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::math::Pose;
use flexura::rod::SectionShape;
use nalgebra::{Rotation3, Vector3};
use std::collections::BTreeMap;

/// Edges of the rods.
const EDGES: usize = 20;
/// Rounding of distances, mm.
const ROUNDING_MM: f64 = 1e-6;

/// A text as the geometry stage gets it, at its start.
fn input(text: &str, steps: usize) -> (Design, Layout, PartsInput) {
    let files = BTreeMap::from([("main.mech".to_string(), text.to_string())]);
    let found = elaborate("main.mech", &files, &Options { steps: Some(steps), ..Options::default() });
    assert_eq!(found.diagnostics, []);
    let design = found.design.unwrap();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let motion = solve_motion(&design, &start).unwrap();
    let layout = Layout::new(&design, &motion, &start);
    let model = Model::new(&design, &layout, &start, EDGES, false).unwrap();
    let input = parts_input(&design, &layout, &model);
    (design, layout, input)
}

const HEAD: &str = "use std.materials.rigur\nuse std.processes.polyjet\nuse std.flexures.crossed_leaves\n";
const TAIL: &str = "material rigur\nprint on polyjet\nlinks height 8 mm\n}\n";

/// A spherical four-bar linkage: all axes meet in the origin.
fn wrist() -> String {
    format!(
        "{HEAD}mechanism wrist {{
        point Z = (0 mm, 0 mm, 40 mm)
        point A = (22 mm, 0 mm, 33 mm)
        point B = (26 mm, 26 mm, 16 mm)
        point C = (0 mm, 36 mm, 18 mm)
        ground base    {{ Z, C }}
        link   crank   {{ Z, A }}
        link   coupler {{ A, B }}
        link   rocker  {{ B, C }}
        hinge motor: base to crank     at Z axis (0, 0, 1)
        hinge pin:   crank to coupler  at A axis (22, 0, 33) pin 3 mm
        hinge knee:  coupler to rocker at B axis (26, 26, 16) as crossed_leaves {{ height = 6 mm, size = 7 mm }}
        hinge heel:  rocker to base    at C axis (0, 36, 18) pin 3 mm
        cycle 12 steps over 2 s
        drive motor by 15 deg * sin(360 deg * t)
        trace tip = B on coupler
        {TAIL}"
    )
}

#[test]
fn hinges_that_point_different_ways() {
    let (design, layout, input) = input(&wrist(), 12);
    assert!(input.bodies.iter().all(|b| b.axis.is_none()));
    let parts = build_parts(&input).unwrap();
    assert_eq!(parts.fusions, []);
    let bodies: Vec<_> = parts.parts.iter().map(|p| p.bodies.clone()).collect();
    assert_eq!(bodies, [vec![0], vec![1], vec![2, 3]]);
    for part in &parts.parts {
        let facts = check_mesh(&part.mesh);
        assert!(facts.is_printable(), "{}: {facts:?}", part.name);
        // Bores run along the tilted axes and are as wide as stated.
        let probe = Probe::new(&part.mesh);
        for eye in part.bodies.iter().flat_map(|b| &input.bodies[*b].eyes) {
            let Bore::Blind { diameter_mm } = eye.bore else { continue };
            let share = (input.height_mm - input.clearance_mm) / 2.0;
            let middle =
                if eye.slot.0 == 0 { share - input.height_mm } else { input.height_mm - share } / 2.0;
            let center = eye.point + eye.axis * middle;
            let across = eye.axis.cross(&Vector3::x()).normalize();
            for k in 0..8 {
                let turn = 0.1 + 0.39 * k as f64;
                let d = across * turn.cos() + eye.axis.cross(&across) * turn.sin();
                let wide = probe.hollow_mm(&center, &d).unwrap();
                assert!(wide > diameter_mm - 1e-5 && wide < 1.003 * diameter_mm, "{wide} for {diameter_mm}");
            }
        }
    }
    // Eyes of one joint turn in each other: no two bodies of a joint come nearer than the clearance in any state.
    for joint in &design.joints {
        let [a, b] = joint.bodies[..] else { continue };
        if !joint.is_compliant() {
            for poses in &layout.conventional {
                let gap = gap(&parts.plans[a], &poses[a], &parts.plans[b], &poses[b]);
                assert!(gap > input.clearance_mm - ROUNDING_MM, "{}: {gap}", joint.name);
            }
        }
    }
}

/// A rod on a gimbal; `base` and `plate` are further points of the two bodies.
fn gimbal(base: &str, plate: &str) -> String {
    format!(
        "use std.materials.rigur\nuse std.processes.polyjet\nuse std.flexures.universal_leaves
        mechanism gimbal {{
        point C = (0 mm, 0 mm, 0 mm)
        point M = (0 mm, 0 mm, -45 mm)
        point Q = (0 mm, 0 mm, 45 mm)
        point F = (0 mm, 0 mm, -25 mm)
        point G = (0 mm, 0 mm, 25 mm)
        ground base  {{ C, {base} M }}
        link   plate {{ C, {plate} Q }}
        universal cross: base to plate at C axis y and x into plate toward Q into base toward M as universal_leaves
        load 0.1 N * t along (1, 0, 0) on plate at Q
        cycle in 2 steps
        trace tip = Q on plate
        {TAIL}"
    )
}

/// The ring of a gimbal goes between two forks: it is as small as the ends it joins, and the forks go round it, through
/// points of their own where they have any.
#[test]
fn a_ring_between_two_forks() {
    // Without the points the forks' legs meet in a hub, with them at the points, though straight across is shorter.
    for (base, plate) in [("", ""), ("F,", "G,")] {
        let text = gimbal(base, plate);
        let (design, layout, input) = input(&text, 2);
        let parts = build_parts(&input).unwrap();
        // The ring's bar beside its own strips is carved later.
        let bodies = |m: Member| matches!(m, Member::Body(_));
        let fused = parts.fusions.iter().find(|f| bodies(f.a) && bodies(f.b));
        assert_eq!(fused, None, "{text}");
        let body = |name: &str| design.bodies.iter().position(|b| b.name == name).unwrap();
        let ring = body("cross.ring");
        let pose = |b: usize| &layout.rest_poses[b];
        for other in [body("base"), body("plate")] {
            let gap = gap(&parts.plans[ring], pose(ring), &parts.plans[other], pose(other));
            assert!(gap > input.clearance_mm, "{gap}");
        }
        // From the attachment planes outwards: a little more than the ball itself.
        let z = |p: &Vector3<f64>| p.z.abs();
        let plane = input.flexures.iter().flat_map(|f| &f.centreline).map(z).fold(0.0, f64::max);
        let ball =
            |(role, slot): &(Role, Slot)| (*role == Role::Boss).then(|| (z(&slot.start), slot.radius_mm()));
        for (at, radius) in parts.plans[ring].slots.iter().filter_map(ball) {
            let room = at - radius - plane;
            assert!(room > 0.0 && room < 0.5, "{room}");
        }
    }
}

fn gap(a: &BodyPlan, pa: &Pose, b: &BodyPlan, pb: &Pose) -> f64 {
    let slots =
        |plan: &BodyPlan, pose: &Pose| plan.slots.iter().map(|(_, s)| s.moved(pose)).collect::<Vec<_>>();
    let (first, second) = (slots(a, pa), slots(b, pb));
    let pairs = first.iter().flat_map(|s| second.iter().map(move |t| separation(s, t).gap_mm));
    pairs.fold(f64::INFINITY, f64::min)
}

/// Links in space follow the parameters: derivatives against differences.
#[test]
fn links_in_space_follow_every_parameter() {
    let files = BTreeMap::from([("main.mech".to_string(), wrist())]);
    let design = elaborate("main.mech", &files, &Options::default()).design.unwrap();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let motion = solve_motion(&design, &start).unwrap();
    let layout = Layout::new(&design, &motion, &start);
    let at = |p: &[f64]| {
        let model = Model::new(&design, &layout, p, EDGES, true).unwrap();
        skeleton_capsules(
            &design,
            &plan_bodies(&parts_input(&design, &layout, &model).unfilleted()).unwrap(),
            &model,
        )
    };
    let here = at(&start);
    let mut moving = 0;
    for (i, free) in design.free.iter().enumerate() {
        let h = 1e-5 * (free.upper - free.lower);
        let shifted = |by: f64| {
            let mut q = start.clone();
            q[i] += by;
            at(&q)
        };
        let (more, less) = (shifted(h), shifted(-h));
        for ((c, more), less) in here.iter().zip(&more).zip(&less) {
            for k in 0..2 {
                let difference = (more.ends[k] - less.ends[k]) / (2.0 * h);
                let exact = c.d_ends_dp[k].column(i);
                moving += usize::from(exact.norm() > 0.0);
                let scale = exact.norm().max(1.0);
                assert!(
                    (difference - exact).norm() < 1e-6 * scale,
                    "{} {:?}: {exact} {difference}",
                    free.path,
                    c.role
                );
            }
            let sizes = [
                (more.radius_mm - less.radius_mm, c.d_radius_dp[i]),
                (more.spread_mm - less.spread_mm, c.d_spread_dp[i]),
            ];
            for (difference, exact) in sizes {
                assert!((difference / (2.0 * h) - exact).abs() < 1e-6, "{}: {exact}", free.path);
            }
        }
    }
    assert!(moving > 50, "{moving}");
}

/// A wire from `from` to `to`, leaving along `along` at both ends.
fn wire(
    path: &str,
    bodies: (usize, usize),
    ends: [Vector3<f64>; 2],
    along: Vector3<f64>,
    thick: f64,
) -> FlexureSolid {
    let n = 24;
    let (mut centreline, mut m1, mut m2) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..=n {
        let u = k as f64 / n as f64;
        let (u2, u3) = (u * u, u * u * u);
        let (p, q) = (ends[0], ends[1]);
        centreline.push(
            p * (2.0 * u3 - 3.0 * u2 + 1.0) + q * (3.0 * u2 - 2.0 * u3) + along * (2.0 * u3 - 3.0 * u2 + u),
        );
        let t = ((q - p) * (6.0 * u - 6.0 * u2) + along * (6.0 * u2 - 6.0 * u + 1.0)).normalize();
        let side = t.cross(&Vector3::new(0.3, 0.9, 0.1)).normalize();
        m1.push(side);
        m2.push(t.cross(&side));
    }
    FlexureSolid {
        fillets: [None; 2],
        path: path.into(),
        joint: 0,
        joint_point: (ends[0] + ends[1]) / 2.0,
        bodies,
        section: SectionShape::Ellipse,
        a_mm: vec![thick / 2.0; n + 1],
        b_mm: vec![thick / 2.0; n + 1],
        m1,
        m2,
        centreline,
    }
}

/// Three bodies that have nothing but the ends of wires, in any direction: one sound part, the wires as thick as designed.
#[test]
fn wires_between_bodies_of_nothing_else() {
    let v = Vector3::new;
    let body = |name: &str| BodySolid { name: name.into(), ..BodySolid::default() };
    let wires = [
        (0, 1, v(0.0, 0.0, 0.0), v(3.0, 4.0, 16.0), v(2.0, 9.0, 20.0)),
        (0, 1, v(14.0, 2.0, -1.0), v(15.0, 9.0, 15.0), v(-6.0, 2.0, 24.0)),
        (1, 2, v(6.0, 21.0, 20.0), v(2.0, 38.0, 12.0), v(-5.0, 20.0, -3.0)),
    ];
    let flexures = wires.iter().enumerate().map(|(i, (a, b, p, q, along))| FlexureSolid {
        fillets: [None; 2],
        joint: i,
        ..wire(&format!("wire{i}"), (*a, *b), [*p, *q], *along, 1.4)
    });
    let mut input = PartsInput {
        height_mm: 12.0,
        clearance_mm: 0.4,
        least_wall_mm: 0.6,
        bodies: vec![body("base"), body("middle"), body("end")],
        flexures: flexures.collect(),
        motion: Vec::new(),
        facets: Facets::default(),
    };
    input.bodies[2].skeleton.push(v(0.0, 60.0, 30.0));
    let parts = build_parts(&input).unwrap();
    assert_eq!((parts.parts.len(), parts.fusions.len()), (1, 0), "{:?}", parts.fusions);
    let facts = check_mesh(&parts.parts[0].mesh);
    assert!(facts.is_printable(), "{facts:?}");
    let probe = Probe::new(&parts.parts[0].mesh);
    for f in &input.flexures {
        for k in 2..f.centreline.len() - 2 {
            for turn in [0.2, 1.1, 2.0] {
                let d = f.m1[k] * f64::cos(turn) + f.m2[k] * f64::sin(turn);
                let thick = probe.thickness_mm(&f.centreline[k], &d).unwrap();
                assert!((thick / 1.4 - 1.0).abs() < 0.005, "{} at {k}: {thick}", f.path);
            }
        }
    }
}

/// A crank drives a carriage on a slider of a layer; the wrist is a flexure one layer above the carriage.
fn press(layer: i32) -> String {
    format!(
        "{HEAD}mechanism press {{
        point O = (0 mm, 0 mm)
        point A = (10 mm, 0 mm)
        point S = (60 mm, 0 mm)
        point W = (100 mm, 0 mm)
        ground palm     {{ O, S }} layer -2
        link   crank    {{ O, A }} layer -1
        link   rod      {{ A, S }} layer 1
        link   carriage {{ S, W }}
        hinge  motor: palm to crank    at O layer -1
        hinge  pin:   crank to rod     at A layer 0 pin 3 mm
        hinge  wrist: rod to carriage  at S layer 1 into carriage toward W as crossed_leaves {{ size = 28 mm }}
        slider guide: palm to carriage at S axis x layer {layer}
        cycle 24 steps over 2 s
        drive motor from 0 deg to 360 deg
        rest motor at 90 deg
        trace tip = W on carriage
        {TAIL}"
    )
}

/// The point at which a slider is drawn is no node of its bodies, in whatever layer the slider is: what ended there
/// would stand in the bar's way.
#[test]
fn nothing_ends_where_a_slider_is_drawn() {
    for layer in [-2, 0] {
        let (_, _, input) = input(&press(layer), 24);
        let s = Vector3::new(60.0, 0.0, 0.0);
        let palm = plan_bodies(&input).unwrap().swap_remove(0);
        let ends = palm.slots.iter().filter(|(r, _)| !matches!(r, Role::Guide(_)));
        let nearest = ends.flat_map(|(_, t)| [t.start, t.end]).map(|p| (p - s).xy().norm());
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        // The sleeve is held at its side.
        let half = input.height_mm / 2.0;
        assert!(nearest > half, "{nearest} mm from the middle of a sleeve {half} mm wide to each side");
    }
}

#[test]
fn a_bar_slides_in_its_sleeve() {
    let (_, layout, input) = input(&press(0), 24);
    let (palm, carriage) = (0, 3);
    let guide = &input.bodies[palm].guides[0];
    assert!(guide.sleeve && !input.bodies[carriage].guides[0].sleeve);
    assert!((guide.travel_mm.1 - guide.travel_mm.0 - 20.0).abs() < 1e-9, "{:?}", guide.travel_mm);
    let parts = build_parts(&input).unwrap();
    for part in &parts.parts {
        let facts = check_mesh(&part.mesh);
        assert!(facts.is_printable(), "{}: {facts:?}", part.name);
    }
    // Faces keep the clearance all the way, and nothing but bar and sleeve is as near.
    let of = |body: usize, pose: &Pose, guided: bool| -> Vec<Slot> {
        let slots = parts.plans[body].slots.iter();
        slots.filter(|(r, _)| matches!(r, Role::Guide(_)) == guided).map(|(_, s)| s.moved(pose)).collect()
    };
    let least = |a: &[Slot], b: &[Slot]| {
        a.iter().flat_map(|s| b.iter().map(move |t| separation(s, t).gap_mm)).fold(f64::INFINITY, f64::min)
    };
    for poses in &layout.conventional {
        let (p, c) = (&poses[palm], &poses[carriage]);
        let faces = least(&of(palm, p, true), &of(carriage, c, true));
        assert!((faces - input.clearance_mm).abs() < ROUNDING_MM, "{faces}");
        for (first, second) in [(true, false), (false, true), (false, false)] {
            let others = least(&of(palm, p, first), &of(carriage, c, second));
            assert!(others >= input.clearance_mm, "{first} {second}: {others}");
        }
    }
    // Measured on the part: the hollow of the sleeve, and its walls.
    let sleeve = Probe::new(&parts.parts[0].mesh);
    let wide = sleeve.hollow_mm(&(guide.point + Vector3::new(0.1, 0.05, 0.02)), &Vector3::y()).unwrap();
    let bar = of(carriage, &Pose::rest(Vector3::zeros()), true)[0].radius_mm();
    assert!((wide - 2.0 * (bar + input.clearance_mm)).abs() < 1e-4, "{wide} round a bar of {}", 2.0 * bar);
}

/// Three bodies on one pin share its layer, each in an eye of its own.
#[test]
fn three_bodies_on_one_pin() {
    let mut input = chebyshev::chebyshev(0.0, Facets::default());
    let [_, _, a, b, _] = points(120.0);
    let tail = BodySolid {
        name: "tail".into(),
        axis: Some(Vector3::z()),
        skeleton: vec![a, a - (b - a).normalize() * 40.0],
        eyes: vec![input.bodies[COUPLER].eyes[0].clone()],
        ..BodySolid::default()
    };
    input.bodies.push(tail);
    let owners = [(CRANK_BODY, 1), (COUPLER, 0), (4, 0)];
    for (k, (body, eye)) in owners.into_iter().enumerate() {
        // The pin's layer is the coupler's own; the crank reaches it from below.
        let eye = &mut input.bodies[body].eyes[eye];
        (eye.point, eye.slot) = (a, (k, 3));
    }
    let parts = build_parts(&input).unwrap();
    assert_eq!(parts.parts.len(), 3);
    for part in &parts.parts {
        let facts = check_mesh(&part.mesh);
        assert!(facts.is_printable(), "{}: {facts:?}", part.name);
    }
    let rest = Pose::rest(Vector3::zeros());
    for (i, (p, _)) in owners.iter().enumerate() {
        for (q, _) in &owners[i + 1..] {
            let gap = gap(&parts.plans[*p], &rest, &parts.plans[*q], &rest);
            assert!(gap >= input.clearance_mm - ROUNDING_MM, "{p} {q}: {gap}");
        }
    }
    // The middle eye is bored through, the outer ones keep a floor.
    let depth = |body: usize, part: usize, d: f64| {
        let plan = &parts.plans[body];
        let eye = plan.slots.iter().find(|(r, _)| *r == Role::Eye(1)).unwrap().1;
        let probe = Probe::new(&parts.parts[part].mesh);
        let at = Vector3::new(a.x, a.y, if body == CRANK_BODY { a.z - 4.1 } else { eye.start.z });
        probe.hits(&at, &Vector3::new(1e-3, 2e-3, d), 6.0).first().map(|h| h.0)
    };
    assert!(
        depth(COUPLER, 0, 1.0).is_none_or(|d| d > 3.0) && depth(COUPLER, 0, -1.0).is_none_or(|d| d > 3.0)
    );
    assert!(depth(CRANK_BODY, 1, -1.0).is_some_and(|d| d < 2.0), "{:?}", depth(CRANK_BODY, 1, -1.0));
    assert!(depth(4, 2, 1.0).is_some_and(|d| d < 2.0), "{:?}", depth(4, 2, 1.0));
}

/// Chebyshev's coupler with a further body on leaves that cross in its pin, one layer above it.
fn pin_below_leaves() -> PartsInput {
    let mut input = chebyshev::chebyshev(0.0, Facets::default());
    let pitch = Vector3::z() * (input.height_mm + input.clearance_mm);
    // Base and crank, and the motor between them, go one layer down: there the crank turns.
    for body in [BASE, CRANK_BODY] {
        input.bodies[body].level_mm -= pitch.z;
        input.bodies[body].eyes[0].point -= pitch;
    }
    let [_, _, a, b, _] = points(120.0);
    let coupler = &mut input.bodies[COUPLER];
    coupler.skeleton.retain(|p| (p - a).norm() > 1.0);
    let towards = (b - a).y.atan2((b - a).x).to_degrees();
    let tail = input.bodies.len();
    let skeleton = vec![a - (b - a).normalize() * 40.0];
    input.bodies.push(BodySolid {
        name: "tail".into(),
        axis: Some(Vector3::z()),
        skeleton,
        ..BodySolid::default()
    });
    let leaves =
        crossed_leaves("wrist", 9, a, (COUPLER, tail), [towards, towards + 180.0], 38.0, 13.0, 0.0, 0.8);
    input.flexures.extend(leaves);
    input.motion = (0..60)
        .map(|k| {
            let mut state = poses(120.0 + 6.0 * f64::from(k));
            let swing = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.3 * (0.105 * f64::from(k)).sin());
            let coupler = state[COUPLER];
            let rotation = coupler.rotation * swing.matrix();
            state.push(Pose { rotation, translation: coupler.point(&a) - a, center: a });
            state
        })
        .collect();
    input
}

#[test]
fn a_pin_below_a_flexure_is_reached_from_beside() {
    let input = pin_below_leaves();
    let plans = plan_bodies(&input).unwrap();
    let plan = &plans[COUPLER];
    assert_eq!(plan.slots.len(), plan.follows.len());
    let eye = &input.bodies[COUPLER].eyes[0];
    let away = |p: &Vector3<f64>| (p - eye.point).xy().norm();
    let of = |role: Role| plan.slots.iter().filter(move |(r, _)| *r == role).map(|(_, s)| *s);
    let heights = |s: &Slot| {
        let half = s.half_height_mm + s.round_mm;
        (s.start.z - half, s.start.z + half)
    };
    // One riser, beside the pin, through both layers; the eye and the arm to the riser stay in the eye's layer.
    let risers: Vec<Slot> = of(Role::Riser).collect();
    assert_eq!(risers.len(), 1);
    let riser = risers[0];
    assert!(away(&riser.start) > 4.0, "{riser:?}");
    let top = eye.point.z + input.height_mm / 2.0;
    assert!(heights(&riser).0 < top - 2.0 && heights(&riser).1 > input.bodies[COUPLER].level_mm, "{riser:?}");
    let pin = of(Role::Eye(eye.joint)).next().unwrap();
    let arm = of(Role::Bar).find(|s| (s.start - pin.start).norm() < 1e-9).unwrap();
    assert!((arm.end - riser.start).xy().norm() < 1e-9);
    assert!(heights(&pin).1 < top && heights(&arm).1 < top);
    // They keep clear of the leaves above the pin, and of crank and base all the way round.
    let leaves = input.flexures.iter().filter(|f| f.path.starts_with("wrist")).map(FlexureSolid::slots);
    for leaf in leaves.flat_map(|slots| slots[1..slots.len() - 1].to_vec()) {
        for own in [&riser, &arm, &pin] {
            assert!(separation(&leaf, own).gap_mm >= input.clearance_mm, "{own:?}");
        }
    }
    for state in &input.motion {
        for other in [BASE, CRANK_BODY] {
            for own in [&riser, &arm] {
                for (role, slot) in &plans[other].slots {
                    let gap = separation(&slot.moved(&state[other]), &own.moved(&state[COUPLER])).gap_mm;
                    assert!(gap >= input.clearance_mm, "{role:?} of {other}: {gap}");
                }
            }
        }
    }
    let parts = build_parts(&input).unwrap();
    for part in &parts.parts {
        let facts = check_mesh(&part.mesh);
        assert!(facts.is_printable(), "{}: {facts:?}", part.name);
    }
    // Without the leaves the pin is reached straight.
    let mut plain = input.clone();
    plain.flexures.retain(|f| !f.path.starts_with("wrist"));
    let plan = &plan_bodies(&plain).unwrap()[COUPLER];
    assert!(!plan.slots.iter().any(|(r, _)| *r == Role::Riser));
}

/// The knee's upper leaf bent by `depth_mm` into its own link, at state 1 of two.
fn rubbing(depth_mm: f64) -> (PartsInput, Vec<MovedState>, usize) {
    let input = chebyshev::chebyshev(25.0, Facets::default());
    let plans = plan_bodies(&input).unwrap();
    let still = MovedState {
        poses: (0..4).map(|_| Pose::rest(Vector3::zeros())).collect(),
        flexures: input.flexures.clone(),
    };
    let mut bent = still.clone();
    let leaf = &mut bent.flexures[0];
    let owner = leaf.bodies.0;
    let (middle, last) = (leaf.centreline.len() / 2, (leaf.centreline.len() - 1) as f64);
    let piece = leaf.slots()[middle];
    let bars = plans[owner].slots.iter().filter(|(r, _)| *r == Role::Bar).map(|(_, s)| separation(&piece, s));
    let near = bars.min_by(|a, b| a.gap_mm.total_cmp(&b.gap_mm)).unwrap();
    let way = near.at - (piece.start + piece.end) / 2.0;
    let way = Vector3::new(way.x, way.y, 0.0).normalize() * (near.gap_mm + depth_mm);
    for (k, p) in leaf.centreline.iter_mut().enumerate() {
        *p += way * (std::f64::consts::PI * k as f64 / last).sin().powi(2);
    }
    (input, vec![still, bent], owner)
}

/// The link gives way to its own leaf: what is left is one sound part, as far from the bent leaf as the process needs, and
/// as thick as is stated.
#[test]
fn a_link_makes_way_for_its_own_leaf() {
    let (input, states, owner) = rubbing(1.5);
    let whole = build_parts(&input).unwrap();
    let parts = build_carved_parts(&input, &states).unwrap();
    let cut = parts.carving.cuts.iter().find(|c| (c.body, c.flexure) == (owner, 0)).unwrap();
    assert!(cut.made && cut.state == Some(1) && cut.depth_mm > 0.5, "{cut:?}");
    for part in &parts.parts {
        let facts = check_mesh(&part.mesh);
        assert!(facts.is_printable(), "{}: {facts:?}", part.name);
    }
    let part = &parts.parts[0];
    assert!(part.mesh.volume_mm3() < whole.parts[0].mesh.volume_mm3() - 20.0);
    // The gap, measured on the carved solid in every state.
    let only_own = |a: Member, b: Member| (a, b) != (Member::Body(owner), Member::Flexure(0));
    let gaps = carved_cycle_gaps(&parts.plans, &states, &parts.carving, input.clearance_mm, only_own);
    assert_eq!(gaps.overlaps, []);
    let bent = gaps.least[1].unwrap().gap_mm;
    assert!(bent >= input.clearance_mm && bent < input.clearance_mm + 0.25, "{bent}");
    // The same by rays from the bent leaf (the printed part holds the leaf at rest, too).
    let probe = Probe::new(&parts.carving.links[&owner]);
    let leaf = &states[1].flexures[0];
    let mut nearest = f64::INFINITY;
    for k in 6..leaf.centreline.len() - 6 {
        let at = |offset: f64| leaf.centreline[k] + leaf.m2[k] * (offset * leaf.b_mm[k]) + leaf.m1[k] * 1e-3;
        for (offset, sign) in [(-0.8, 1.0), (0.0, 1.0), (0.8, 1.0), (-0.8, -1.0), (0.0, -1.0), (0.8, -1.0)] {
            if let Some((way, leaves)) = probe.hits(&at(offset), &(leaf.m1[k] * sign), 3.0).first() {
                assert!(!leaves, "the bent leaf is inside of the link");
                nearest = nearest.min(*way);
            }
        }
    }
    assert!(nearest >= input.clearance_mm && nearest < 3.0, "{nearest}");
    // Enough is left, and as much as was said.
    let wall = cut.wall_mm.unwrap();
    assert!(wall >= input.least_wall_mm, "{wall}");
}

#[test]
fn a_link_that_would_be_cut_apart_is_left_and_named() {
    // A link no wider than the leaf's way: everything would go.
    let (mut input, mut states, owner) = rubbing(1.5);
    for f in input.flexures.iter_mut().chain(states.iter_mut().flat_map(|s| &mut s.flexures)) {
        // The leaf fills the whole layer.
        if f.path == "knee.upper" {
            f.b_mm.iter_mut().for_each(|b| *b *= 4.0);
        }
    }
    let leaf = &mut states[1].flexures[0];
    let last = (leaf.centreline.len() - 1) as f64;
    let way = (leaf.centreline[12] - input.flexures[0].centreline[12]).normalize() * 10.0;
    for (k, p) in leaf.centreline.iter_mut().enumerate() {
        *p += way * (std::f64::consts::PI * k as f64 / last).sin().powi(2);
    }
    let parts = build_carved_parts(&input, &states).unwrap();
    let cut = parts.carving.cuts.iter().find(|c| (c.body, c.flexure) == (owner, 0)).unwrap();
    assert!(!cut.made && cut.wall_mm.is_none_or(|w| w < input.least_wall_mm), "{cut:?}");
    assert!(!parts.carving.made(owner, 0));
    let facts = check_mesh(&parts.parts[0].mesh);
    assert!(facts.closed && facts.oriented && facts.components == 1, "{facts:?}");
}
