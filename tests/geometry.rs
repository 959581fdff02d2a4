//! Printed parts of Chebyshev's linkage, measured on the finished meshes.

#[path = "support/chebyshev.rs"]
mod chebyshev;

use chebyshev::{BASE, CLEARANCE, COUPLER, CRANK_BODY, HEIGHT, ROCKER, THICK, chebyshev as input, poses};
use flexura::geometry::link::Role;
use flexura::geometry::{
    Bore, Facets, FlexureSolid, Member, MovedState, Parts, PartsInput, Probe, build_parts, check_mesh,
    cycle_gaps, plan_bodies,
};
use flexura::math::Pose;
use flexura::rod::SectionShape;
use nalgebra::Vector3;

#[allow(clippy::unwrap_used)]
fn build(bulge_deg: f64) -> (PartsInput, Parts) {
    let input = input(bulge_deg, Facets::default());
    let parts = build_parts(&input).unwrap();
    // For the eye: set to a folder to look at what the tests measure.
    if let Ok(dir) = std::env::var("FLEXURA_STL_DIR") {
        for part in &parts.parts {
            let bytes = flexura::emit::stl::stl_bytes(&part.mesh).unwrap();
            std::fs::write(format!("{dir}/{}_{bulge_deg}.stl", part.name), bytes).unwrap();
        }
    }
    (input, parts)
}

#[test]
fn parts_are_sound_for_straight_and_curved_leaves() {
    for bulge in [0.0, 12.0, 25.0] {
        let (input, parts) = build(bulge);
        assert_eq!(parts.fusions, vec![], "bulge {bulge}");
        let bodies: Vec<_> = parts.parts.iter().map(|p| p.bodies.clone()).collect();
        assert_eq!(bodies, [vec![BASE, COUPLER, ROCKER], vec![CRANK_BODY]]);
        for part in &parts.parts {
            let facts = check_mesh(&part.mesh);
            assert!(facts.is_printable(), "{} at bulge {bulge}: {facts:?}", part.name);
        }
        // Links stay inside their layers: nothing above layer 0, nothing below layer -2.
        let pitch = input.height_mm + input.clearance_mm;
        let (least, largest) = parts.parts[0].mesh.bounding_box().unwrap();
        assert!(largest.z <= HEIGHT / 2.0 + 1e-5, "{}", largest.z);
        assert!(least.z >= -2.0 * pitch - HEIGHT / 2.0 - 1e-5, "{}", least.z);
        let (least, largest) = parts.parts[1].mesh.bounding_box().unwrap();
        assert!((largest.z + pitch).abs() <= HEIGHT / 2.0 && (least.z + pitch).abs() <= HEIGHT / 2.0);
    }
}

#[test]
fn volume_agrees_with_a_finer_mesh() {
    let fine = Facets { around: 160, edge: 12, piece_mm: 4.0 };
    let coarse = build(25.0).1;
    let fine = build_parts(&input(25.0, fine)).unwrap();
    for (c, f) in coarse.parts.iter().zip(&fine.parts) {
        let (c, f) = (c.mesh.volume_mm3(), f.mesh.volume_mm3());
        assert!((c / f - 1.0).abs() < 0.005, "{c} against {f} mm³");
    }
}

#[test]
fn flexures_are_as_thick_as_designed() {
    for bulge in [0.0, 25.0] {
        let (input, parts) = build(bulge);
        let probe = Probe::new(&parts.parts[0].mesh);
        for flexure in &input.flexures {
            let thick = if flexure.path.starts_with("knee") { THICK[0] } else { THICK[1] };
            // Clear of the stubs at both ends, at every station.
            for k in 1..flexure.centreline.len() - 1 {
                // Off a facet's edge by a hair, so that the ray does not run along it.
                let point = flexure.centreline[k] + flexure.m2[k] * 1e-4;
                let measured = probe.thickness_mm(&point, &flexure.m1[k]).unwrap();
                let error = measured / thick - 1.0;
                assert!(error.abs() < 0.003, "{} at station {k}: {measured} mm, not {thick}", flexure.path);
                let wide =
                    probe.thickness_mm(&(flexure.centreline[k] + flexure.m1[k] * 1e-4), &flexure.m2[k]);
                let error = wide.unwrap() / (2.0 * flexure.b_mm[k]) - 1.0;
                assert!(error.abs() < 0.003, "{} at station {k}: {wide:?} mm wide", flexure.path);
            }
        }
    }
}

/// A rectangular flexure is as large as stated everywhere between its roots, and the fan of capsules that
/// stands for it in distances holds it.
#[test]
fn rectangular_flexures_are_boxes() {
    let (input, _) = build(0.0);
    let flexure = FlexureSolid { section: SectionShape::Rectangle, ..input.flexures[0].clone() };
    let mesh = flexure.mesh(64).rounded_to_f32();
    assert!(check_mesh(&mesh).is_printable());
    let probe = Probe::new(&mesh);
    let (a, b) = flexure.end_axes(false);
    for k in 1..flexure.centreline.len() - 1 {
        for side in [-0.95, 0.0, 0.95] {
            let at = flexure.centreline[k] + flexure.m2[k] * (side * b) + flexure.m1[k] * 1e-3;
            let thick = probe.thickness_mm(&at, &flexure.m1[k]).unwrap();
            assert!((thick / (2.0 * a) - 1.0).abs() < 0.003, "{thick}");
        }
    }
    let slots = flexure.slots();
    for (slot, k) in slots.iter().zip(0..) {
        let corner = flexure.centreline[k] + flexure.m1[k] * a + flexure.m2[k] * b;
        let axial = (corner - slot.start).dot(&slot.axis).clamp(-slot.half_height_mm, slot.half_height_mm);
        assert!((corner - slot.start - slot.axis * axial).norm() <= slot.round_mm + 1e-9);
    }
}

#[test]
fn flexures_are_clamped_where_the_design_says() {
    let (input, parts) = build(0.0);
    let probe = Probe::new(&parts.parts[0].mesh);
    for flexure in &input.flexures {
        for at_end in [false, true] {
            let (p, out) = (flexure.end_point(at_end), flexure.outward(at_end));
            let side = Vector3::z().cross(&out);
            let thick = 2.0 * flexure.a_mm[0];
            let before = probe.thickness_mm(&(p - out * 0.2), &side).unwrap();
            assert!((before / thick - 1.0).abs() < 0.003, "{}: {before} before the stub", flexure.path);
            let behind = probe.thickness_mm(&(p + out * 0.5), &side).unwrap();
            assert!(behind > 2.5 * thick, "{}: {behind} in the stub", flexure.path);
        }
    }
}

#[test]
fn bores_have_the_stated_diameter_and_end_where_they_should() {
    let (input, parts) = build(0.0);
    let pitch = input.height_mm + input.clearance_mm;
    for part in &parts.parts {
        let probe = Probe::new(&part.mesh);
        for body in &part.bodies {
            for eye in &input.bodies[*body].eyes {
                let share = (HEIGHT - CLEARANCE) / 2.0;
                let middle = if eye.slot.0 == 0 { -HEIGHT + share } else { HEIGHT - share } / 2.0;
                let center = eye.point + Vector3::z() * middle;
                let diameter = eye.bore.diameter_mm().unwrap();
                for k in 0..16 {
                    let angle = 0.1 + 0.196 * k as f64;
                    let measured =
                        probe.hollow_mm(&center, &Vector3::new(angle.cos(), angle.sin(), 0.0)).unwrap();
                    assert!(
                        measured >= diameter - 1e-5 && measured < 1.003 * diameter,
                        "{measured} for {diameter}"
                    );
                }
                let up = probe.hits(&center, &Vector3::new(1e-3, 2e-3, 1.0), 60.0);
                let down = probe.hits(&center, &Vector3::new(1e-3, 2e-3, -1.0), 60.0);
                match eye.bore {
                    // Closed towards the neighbouring layer, with a floor.
                    Bore::Blind { .. } => {
                        let floor = if eye.slot.0 == 0 { &down } else { &up };
                        let depth = floor[0].0;
                        assert!((depth + middle.abs() - (HEIGHT / 2.0 - 1.2)).abs() < 1e-3, "{depth}");
                    }
                    Bore::Through { .. } => assert!(down.is_empty(), "the shaft's hole is blocked: {down:?}"),
                    Bore::Solid => unreachable!(),
                }
            }
        }
    }
    assert!(pitch > HEIGHT);
}

#[test]
fn an_eye_without_a_stated_pin_stays_solid_and_says_so() {
    let mut input = input(0.0, Facets::default());
    input.bodies[CRANK_BODY].eyes[1].bore = Bore::Solid;
    let parts = build_parts(&input).unwrap();
    let eye = &input.bodies[CRANK_BODY].eyes[1];
    let probe = Probe::new(&parts.parts[1].mesh);
    assert!(
        probe.thickness_mm(&(eye.point - Vector3::z() * 3.0), &Vector3::new(1.0, 0.3, 0.0)).unwrap() > 8.0
    );
    assert!(parts.parts[1].notes.iter().any(|n| n.contains("no pin diameter")), "{:?}", parts.parts[1].notes);
}

/// The mechanism in 60 states, without its flexures.
fn turns() -> Vec<MovedState> {
    (0..60).map(|k| MovedState { poses: poses(120.0 + 6.0 * k as f64), flexures: Vec::new() }).collect()
}

/// Only the crank counts: the other bodies meet each other in flexures.
fn without_crank(a: Member, b: Member) -> bool {
    ![a, b].contains(&Member::Body(CRANK_BODY))
}

/// A leaf bent into its own link, and into another body, is found at the state where it happens; where it is
/// attached it may touch.
#[test]
fn a_leaf_that_rubs_is_found() {
    let input = input(25.0, Facets::default());
    let plans = plan_bodies(&input).unwrap();
    let rest: Vec<Pose> = poses(120.0).iter().map(|p| Pose::rest(p.center)).collect();
    let still = MovedState { poses: rest, flexures: input.flexures.clone() };
    let only_leaves = |a: Member, b: Member| matches!((a, b), (Member::Body(_), Member::Body(_)));
    let gaps = cycle_gaps(&plans, std::slice::from_ref(&still), only_leaves);
    assert_eq!(gaps.overlaps, []);
    assert!(gaps.least[0].unwrap().gap_mm > 0.0);
    // The middle of one leaf is pushed onto its own link's nearest slot.
    let mut bent = still.clone();
    let leaf = &mut bent.flexures[0];
    let owner = leaf.bodies.0;
    let bars = plans[owner].slots.iter().filter(|(r, _)| *r == Role::Bar).map(|(_, s)| *s);
    let middle = leaf.centreline.len() / 2;
    let onto = bars.map(|s| (s.start + s.end) / 2.0).next().unwrap();
    let shift = onto - leaf.centreline[middle];
    let last = (leaf.centreline.len() - 1) as f64;
    for (k, p) in leaf.centreline.iter_mut().enumerate() {
        *p += shift * (std::f64::consts::PI * k as f64 / last).sin();
    }
    let gaps = cycle_gaps(&plans, &[still, bent], only_leaves);
    let own = gaps.overlaps.iter().find(|o| (o.a, o.b) == (Member::Body(owner), Member::Flexure(0))).unwrap();
    assert!(own.state == 1 && own.gap_mm < 0.0, "{own:?}");
    assert!(gaps.least[1].unwrap().gap_mm <= own.gap_mm);
}

#[test]
fn the_crank_turns_fully_with_the_clearance_kept() {
    let input = input(25.0, Facets::default());
    let plans = plan_bodies(&input).unwrap();
    let states = turns();
    let gaps = cycle_gaps(&plans, &states, without_crank);
    assert_eq!(gaps.overlaps, []);
    let gaps = gaps.least;
    assert_eq!(gaps.len(), 60);
    for gap in gaps {
        let gap = gap.unwrap();
        assert!(gap.gap_mm >= CLEARANCE, "{gap:?}");
        assert!(gap.gap_mm < 5.0, "the crank's neighbours are near: {gap:?}");
    }
}

#[test]
fn a_body_in_the_cranks_way_is_found_at_the_right_state() {
    let mut input = input(0.0, Facets::default());
    // A post of the base in the crank's layer, 20 mm right of the shaft.
    input.bodies[BASE].eyes.push(flexura::geometry::Eye {
        joint: 9,
        point: Vector3::new(20.0, 0.0, -HEIGHT - CLEARANCE),
        axis: Vector3::z(),
        bore: Bore::Solid,
        slot: (0, 1),
    });
    let plans = plan_bodies(&input).unwrap();
    let found = cycle_gaps(&plans, &turns(), without_crank);
    let gaps: Vec<f64> = found.least.iter().map(|g| g.unwrap().gap_mm).collect();
    let pairs: Vec<_> = found.overlaps.iter().map(|o| (o.a, o.b)).collect();
    assert_eq!(pairs, [(Member::Body(BASE), Member::Body(CRANK_BODY))]);
    assert_eq!(found.overlaps[0].gap_mm, gaps.iter().copied().fold(f64::INFINITY, f64::min));
    let worst = gaps.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    assert!(*worst.1 < -1.0 && worst.0.abs_diff(40) <= 4, "{worst:?}");
    assert!(gaps[10] >= CLEARANCE, "{}", gaps[10]);
}

#[test]
fn bodies_that_would_grow_together_are_reported() {
    let mut input = input(0.0, Facets::default());
    // The rocker gets a point on the coupler's free end.
    let on_coupler = input.bodies[COUPLER].skeleton[1] - Vector3::new(10.0, 8.0, 0.0);
    input.bodies[ROCKER].skeleton.push(on_coupler);
    let parts = build_parts(&input).unwrap();
    let pair = (Member::Body(COUPLER), Member::Body(ROCKER));
    let fusion = parts.fusions.iter().find(|f| (f.a, f.b) == pair).unwrap();
    assert!(fusion.same_part && fusion.depth_mm > 0.0, "{fusion:?}");
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let parts = build(25.0).1;
            parts
                .parts
                .iter()
                .flat_map(|p| flexura::emit::stl::stl_bytes(&p.mesh).unwrap())
                .collect::<Vec<u8>>()
        })
    };
    let one = bytes(1);
    assert!(one.len() > 1_000_000);
    assert!(one == bytes(2) && one == bytes(3));
}

#[test]
fn stl_reads_back_closed() {
    let (_, parts) = build(0.0);
    for part in &parts.parts {
        let bytes = flexura::emit::stl::stl_bytes(&part.mesh).unwrap();
        let read = stl_io::read_stl(&mut std::io::Cursor::new(&bytes)).unwrap();
        assert_eq!(read.faces.len(), part.mesh.triangles.len());
        // Vertices the reader merges by their coordinates are exactly ours.
        assert_eq!(read.vertices.len(), part.mesh.vertices.len());
    }
}

#[test]
fn meaningless_input_is_an_error() {
    let good = input(0.0, Facets::default());
    let broken: [fn(&mut PartsInput); 6] = [
        |i| i.bodies[0].axis = Some(Vector3::new(0.0, 0.0, 2.0)),
        |i| i.height_mm = f64::NAN,
        |i| i.bodies[0].skeleton[0].x = f64::INFINITY,
        |i| i.bodies[0].eyes[0].slot = (2, 2),
        |i| i.flexures[0].m1.truncate(3),
        |i| i.flexures[0].bodies.1 = 17,
    ];
    for breaks in broken {
        let mut input = good.clone();
        breaks(&mut input);
        assert!(build_parts(&input).is_err());
    }
    let mut lonely = good;
    lonely.flexures.clear();
    assert!(
        matches!(build_parts(&lonely), Err(flexura::geometry::GeometryError::NoSkeleton(name)) if name == "rocker")
    );
}
