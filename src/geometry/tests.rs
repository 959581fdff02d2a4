//! Primitives against closed forms, and the checker against meshes broken on purpose.

use super::check::{check_mesh, crossing_pairs};
use super::distance::separation;
use super::field::Field;
use super::link::{BodyPlan, Role};
use super::skeleton::connect;
use super::tidy::{SHORT_EDGE_MM, finished, without_short_edges};
use super::union::{BooleanError, subtract_all, union_all};
use super::wall::{Left, Wall};
use super::{Facets, Mesh, Probe, Slot};
use nalgebra::Vector3;
use std::f64::consts::PI;

const FINE: Facets = Facets { around: 256, edge: 48, piece_mm: 5.0 };

fn v(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

fn sphere(center: Vector3<f64>, radius: f64) -> Slot {
    Slot::capsule(center, center, radius)
}

#[test]
fn volumes_match_closed_forms() {
    let capsule = Slot::capsule(v(1.0, 2.0, 3.0), v(4.0, -2.0, 3.5), 2.0);
    let length = (capsule.end - capsule.start).norm();
    let cases = [
        (sphere(v(5.0, 0.0, 1.0), 3.0), 4.0 / 3.0 * PI * 27.0),
        (capsule, 4.0 / 3.0 * PI * 8.0 + PI * 4.0 * length),
        (Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), Vector3::z(), 4.0, 6.0, 0.0), PI * 16.0 * 12.0),
        (
            Slot::bar(v(0.0, 0.0, 0.0), v(7.0, 0.0, 0.0), Vector3::z(), 4.0, 6.0, 0.0),
            (PI * 16.0 + 56.0) * 12.0,
        ),
    ];
    for (slot, exact) in cases {
        assert!((slot.volume_mm3() / exact - 1.0).abs() < 1e-12, "{slot:?}");
        let meshed = slot.mesh(&FINE, 0.3).volume_mm3();
        assert!((meshed / exact - 1.0).abs() < 1e-3, "{slot:?}: {meshed} against {exact}");
    }
    // Rounded: against the formula, and the formula against the mesh's convergence.
    let rounded = Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 9.0, 0.0), Vector3::z(), 4.0, 6.0, 0.8);
    let error = |f: &Facets| rounded.mesh(f, 0.0).volume_mm3() / rounded.volume_mm3() - 1.0;
    let (coarse, fine) = (
        error(&Facets { around: 32, edge: 6, piece_mm: 5.0 }),
        error(&Facets { around: 64, edge: 12, piece_mm: 5.0 }),
    );
    assert!(coarse < 0.0 && (coarse / fine - 4.0).abs() < 0.1, "second order: {coarse} {fine}");
}

#[test]
fn every_primitive_is_a_sound_mesh() {
    let z = Vector3::z();
    let slots = [
        sphere(v(0.0, 0.0, 0.0), 2.0),
        Slot::capsule(v(0.0, 0.0, 0.0), v(20.0, 3.0, -7.0), 2.0),
        Slot::capsule(v(0.0, 0.0, 0.0), v(0.0, 0.0, 9.0), 2.0),
        Slot::bar(v(0.0, 0.0, 0.0), v(30.0, 3.0, 0.0), z, 4.2, 5.7, 0.8),
        Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), z, 4.2, 5.7, 0.8),
        Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), z, 4.2, 5.7, 0.0),
        Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), z, 4.2, 4.2, 4.2),
        Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 8.0, 0.0), z, 2.0, 5.0, 2.0),
        Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 8.0, 0.0), z, 5.0, 2.0, 2.0),
    ];
    for slot in slots {
        let facts = check_mesh(&slot.mesh(&Facets::default(), 0.4).rounded_to_f32());
        assert!(facts.is_printable(), "{slot:?}: {facts:?}");
        let (center, radius) = slot.bounding_sphere();
        let far = slot
            .mesh(&Facets::default(), 0.0)
            .vertices
            .iter()
            .map(|p| (p - center).norm())
            .fold(0.0, f64::max);
        assert!(far <= radius + 1e-9, "{slot:?}");
    }
}

#[test]
fn distances_match_closed_forms() {
    let s = separation(&sphere(v(0.0, 0.0, 0.0), 1.0), &sphere(v(3.0, 4.0, 0.0), 1.5));
    assert!((s.gap_mm - 2.5).abs() < 1e-9);
    // Crossed capsules, and parallel ones side by side.
    let along_x = Slot::capsule(v(-5.0, 0.0, 0.0), v(5.0, 0.0, 0.0), 0.5);
    let s = separation(&along_x, &Slot::capsule(v(1.0, -5.0, 3.0), v(1.0, 5.0, 3.0), 0.5));
    assert!((s.gap_mm - 2.0).abs() < 1e-9 && (s.at - v(1.0, 0.0, 1.5)).norm() < 1e-6, "{s:?}");
    let s = separation(&along_x, &Slot::capsule(v(-2.0, 4.0, 0.0), v(9.0, 4.0, 0.0), 0.5));
    assert!((s.gap_mm - 3.0).abs() < 1e-9, "{s:?}");
    // Discs side by side, on top of each other, and a bar beside a disc.
    let disc = |c| Slot::bar(c, c, Vector3::z(), 3.0, 2.0, 0.5);
    let s = separation(&disc(v(0.0, 0.0, 0.0)), &disc(v(6.0, 8.0, 1.0)));
    assert!((s.gap_mm - 4.0).abs() < 1e-6, "{s:?}");
    let s = separation(&disc(v(0.0, 0.0, 0.0)), &disc(v(0.7, 0.2, 4.4)));
    assert!((s.gap_mm - 0.4).abs() < 1e-9, "{s:?}");
    let bar = Slot::bar(v(-10.0, 7.0, 1.0), v(10.0, 7.0, 1.0), Vector3::z(), 2.0, 2.0, 0.4);
    let s = separation(&disc(v(0.0, 0.0, 0.0)), &bar);
    assert!((s.gap_mm - 2.0).abs() < 1e-6, "{s:?}");
    // Shallow overlap is measured exactly, deep overlap at least as the edges' radii.
    let s = separation(&disc(v(0.0, 0.0, 0.0)), &disc(v(5.4, 0.0, 0.0)));
    assert!((s.gap_mm + 0.6).abs() < 1e-6, "{s:?}");
    assert!(separation(&disc(v(0.0, 0.0, 0.0)), &disc(v(1.0, 0.0, 0.0))).gap_mm <= -1.0 + 1e-6);
}

#[test]
fn distance_agrees_with_sampled_surfaces() {
    // Against the vertices of fine meshes: the true gap is never larger than the least vertex gap
    // and not much smaller.
    let f = Facets { around: 96, edge: 8, piece_mm: 0.5 };
    for k in 0..20 {
        let t = k as f64;
        let turn = nalgebra::Rotation3::from_euler_angles(t, 0.7 * t, 1.3 * t);
        let a = Slot::bar(v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0), Vector3::z(), 2.0, 3.0, 0.6);
        let mut b = Slot::bar(v(0.0, 0.0, 0.0), turn * v(5.0, 0.0, 0.0), turn * Vector3::z(), 1.5, 2.0, 0.5);
        let shift = v(9.0 * (0.9 * t).cos(), 9.0 * (0.9 * t).sin(), 4.0 * (0.4 * t).sin() + 6.0);
        (b.start, b.end) = (b.start + shift, b.end + shift);
        let gap = separation(&a, &b).gap_mm;
        let (ma, mb) = (a.mesh(&f, 0.0), b.mesh(&f, 0.0));
        let sampled = ma
            .vertices
            .iter()
            .map(|p| mb.vertices.iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min));
        let sampled = sampled.fold(f64::INFINITY, f64::min);
        assert!(gap > 0.0 && gap <= sampled + 1e-6 && sampled < gap + 0.25, "{k}: {gap} against {sampled}");
    }
}

#[test]
fn a_union_of_two_balls_has_the_lens_once() {
    let (a, b) = (sphere(v(0.0, 0.0, 0.0), 2.0), sphere(v(2.0, 0.1, 0.3), 2.0));
    let meshes = [a.mesh(&FINE, 0.0), b.mesh(&FINE, 0.37)];
    let d = (b.start - a.start).norm();
    let lens = PI * (4.0 * 2.0 + d) * (2.0 * 2.0 - d).powi(2) / 12.0;
    let exact = 2.0 * a.volume_mm3() - lens;
    let union = union_all(&meshes).unwrap().rounded_to_f32();
    assert!((union.volume_mm3() / exact - 1.0).abs() < 2e-3);
    assert!(check_mesh(&union).is_printable());
    let left = subtract_all(&meshes[0], &meshes[1..]).unwrap().rounded_to_f32();
    assert!((left.volume_mm3() / (a.volume_mm3() - lens) - 1.0).abs() < 2e-3);
    assert!(check_mesh(&left).is_printable());
    assert_eq!(union_all(&[]), Err(BooleanError::Empty));
    let mut open = meshes[0].clone();
    open.triangles.pop();
    assert!(union_all(&[open, meshes[1].clone()]).is_err());
}

#[test]
fn the_checker_finds_what_is_broken() {
    let good = sphere(v(0.0, 0.0, 0.0), 5.0).mesh(&Facets::default(), 0.0);
    assert!(check_mesh(&good).is_printable());

    let mut hole = good.clone();
    hole.triangles.swap_remove(100);
    let facts = check_mesh(&hole);
    assert!(!facts.closed && facts.oriented && !facts.is_printable());

    let mut flipped = good.clone();
    flipped.triangles[100].swap(0, 1);
    let facts = check_mesh(&flipped);
    assert!(facts.closed && !facts.oriented);

    let mut inside_out = good.clone();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let facts = check_mesh(&inside_out);
    assert!(facts.closed && facts.oriented && facts.volume_mm3 < 0.0 && !facts.is_printable());

    // Two balls in one mesh, not united.
    let mut two = good.clone();
    two.append(&sphere(v(6.0, 1.0, 0.5), 5.0).mesh(&Facets::default(), 0.5));
    let facts = check_mesh(&two);
    assert!(facts.closed && facts.components == 2 && facts.self_intersections > 50, "{facts:?}");

    // One vertex pulled through the opposite side.
    let mut spike = good.clone();
    spike.vertices[200] = -1.4 * spike.vertices[200];
    assert!(check_mesh(&spike).self_intersections > 0);

    // A fold: a vertex moved across its neighbour's edge within the plane of a flat face.
    let mut flat = Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), Vector3::z(), 4.0, 2.0, 0.0)
        .mesh(&Facets::default(), 0.0);
    assert_eq!(crossing_pairs(&flat), vec![]);
    let center =
        flat.vertices.iter().position(|p| p.x.abs() < 1e-12 && p.y.abs() < 1e-12 && p.z > 0.0).unwrap();
    flat.vertices[center].x = 4.5;
    assert!(!crossing_pairs(&flat).is_empty());

    // The same by less than a hundredth of a micrometre: exact arithmetic still sees it.
    flat.vertices[center].x = 4.0 + 8e-6;
    let facts = check_mesh(&flat);
    assert!(facts.closed && facts.self_intersections > 0 && !facts.is_printable(), "{facts:?}");
    // On the rim's edge the fan has a triangle without an area.
    flat.vertices[center].x = 4.0;
    assert!(check_mesh(&flat).flat > 0);

    // Two balls that touch in one vertex: every edge is right, the vertex is not.
    let ball = Slot::capsule(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), 5.0).mesh(&Facets::default(), 0.0);
    let mut touching = ball.clone();
    touching.vertices.iter_mut().for_each(|p| p.z -= 5.0);
    let mut upper = ball;
    upper.vertices.iter_mut().for_each(|p| p.z += 5.0);
    touching.append(&upper);
    let facts = check_mesh(&touching);
    assert!(facts.closed && facts.oriented && facts.self_intersections == 0, "{facts:?}");
    assert_eq!((facts.pinched, facts.is_sound()), (1, false));

    assert!(!check_mesh(&Mesh::default()).closed);
    let out_of_range = Mesh { vertices: vec![v(0.0, 0.0, 0.0)], triangles: vec![[0, 1, 2]] };
    assert!(!check_mesh(&out_of_range).closed);
}

/// Near zero `f32` tells vertices apart that readers of STL take for one: the checker does as they do, and what is
/// written has none.
#[test]
fn vertices_that_readers_merge_are_merged() {
    let mut mesh = sphere(v(0.0, 0.0, 0.0), 5.0).mesh(&Facets::default(), 0.0);
    let j = mesh.vertices.iter().position(|p| p.x.abs() < 1e-9 && p.z.abs() < 4.0).unwrap();
    let ids = *mesh.triangles.iter().find(|t| t.contains(&j)).unwrap();
    let i = ids.into_iter().find(|i| *i != j).unwrap();
    mesh.vertices[i] = mesh.vertices[j] + v(1e-8, 0.0, 0.0);
    mesh.vertices[j].x = 0.0;
    // Two numbers in single precision.
    assert_ne!(mesh.vertices[i].x as f32, mesh.vertices[j].x as f32);
    let facts = check_mesh(&mesh);
    assert!(!facts.closed && facts.flat == 2, "{facts:?}");
    let written = mesh.rounded_to_f32();
    assert_eq!(written.triangles.len(), mesh.triangles.len() - 2);
    assert!(check_mesh(&written).is_printable());
}

#[test]
fn rounding_merges_and_stays_closed() {
    let mut mesh = sphere(v(100.0, 0.0, 0.0), 5.0).mesh(&Facets::default(), 0.0);
    // Two neighbours nearer to each other than f32 resolves at 100 mm.
    let [i, j, _] = mesh.triangles[300];
    mesh.vertices[i] = mesh.vertices[j] + v(1e-7, 0.0, 0.0);
    let before = mesh.triangles.len();
    let rounded = mesh.rounded_to_f32();
    assert_eq!(rounded.triangles.len(), before - 2);
    assert!(check_mesh(&rounded).is_printable());
    assert!(rounded.vertices.iter().all(|p| f64::from(p.x as f32) == p.x));
}

#[test]
fn rays_measure_a_tube() {
    let outer = Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), Vector3::z(), 4.0, 5.0, 0.0).mesh(&FINE, 0.0);
    let inner = Slot::bar(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.0), Vector3::z(), 1.5, 6.0, 0.0).mesh(&FINE, 0.3);
    let tube = subtract_all(&outer, &[inner]).unwrap();
    let probe = Probe::new(&tube);
    let d = v(0.31, 0.2, 0.01);
    assert!((probe.hollow_mm(&v(0.0, 0.0, 0.0), &d).unwrap() / 3.0 - 1.0).abs() < 1e-3);
    assert!((probe.thickness_mm(&(d.normalize() * 2.5), &d).unwrap() / 2.5 - 1.0).abs() < 1e-3);
    assert_eq!(probe.thickness_mm(&v(0.0, 0.0, 0.0), &d), None);
    assert_eq!(probe.hollow_mm(&(d.normalize() * 2.5), &d), None);
}

#[test]
fn hub_or_chain_whichever_is_shorter() {
    let free = |_: &Vector3<f64>, _: &Vector3<f64>| false;
    // A right angle saves too little by a hub… a regular triangle saves 13 %.
    let triangle: Vec<_> =
        (0..3).map(|k| 10.0 * v((2.1 * k as f64).cos(), (2.1 * k as f64).sin(), 0.0)).collect();
    let net = connect(&triangle, free);
    assert!(net.hub.is_some_and(|h| h.norm() < 0.5) && net.edges.len() == 3);
    let line = [v(0.0, 0.0, 0.0), v(20.0, 0.0, 0.0), v(10.0, 1.0, 0.0)];
    let net = connect(&line, free);
    assert_eq!((net.hub, net.edges), (None, vec![(0, 2), (2, 1)]));
    // The short way is blocked.
    let blocked = |p: &Vector3<f64>, q: &Vector3<f64>| (p.x - q.x).abs() < 15.0 && p.x.min(q.x) < 5.0;
    assert_eq!(connect(&line, blocked).edges, vec![(0, 1), (1, 2)]);
    assert_eq!(connect(&line[..1], free).edges, vec![]);
}

#[test]
fn signed_distances_agree_with_those_of_slots() {
    let slots = [
        Slot::capsule(v(0.0, 0.0, 0.0), v(6.0, 2.0, -3.0), 1.5),
        Slot::bar(v(0.0, 0.0, 0.0), v(7.0, 0.0, 0.0), Vector3::z(), 3.0, 2.0, 0.6),
        Slot::bar(v(1.0, 0.0, 0.0), v(1.0, 0.0, 0.0), Vector3::y(), 3.0, 4.0, 0.0),
    ];
    for slot in slots {
        for k in 0..60 {
            let t = k as f64;
            let p = v(9.0 * (0.9 * t).cos(), 9.0 * (0.7 * t).sin(), 8.0 * (0.4 * t).sin());
            let gap = separation(&slot, &sphere(p, 0.0)).gap_mm;
            let signed = slot.signed_distance(&p);
            if gap > 0.0 {
                assert!((signed - gap).abs() < 1e-6, "{slot:?} {p}: {signed} {gap}");
            } else {
                assert!(signed <= 1e-6, "{slot:?} {p}: {signed} {gap}");
            }
        }
        assert!(slot.signed_distance(&((slot.start + slot.end) / 2.0)) < -1.4);
    }
}

/// Surfaces of fields are sound whatever they bound, and lie where they should.
#[test]
fn a_field_has_a_closed_surface() {
    let capsule = Slot::capsule(v(0.3, 0.2, 0.1), v(8.0, 3.0, -2.0), 1.0);
    let mut field = Field::new(&v(-4.0, -4.0, -6.0), &v(12.0, 7.0, 4.0), 0.4, 1.0);
    field.add(&capsule, 0.5, 1.0);
    let mesh = field.surface();
    assert!(check_mesh(&mesh).is_printable());
    let grown = Slot { round_mm: 1.5, ..capsule };
    assert!((mesh.volume_mm3() / grown.volume_mm3() - 1.0).abs() < 0.02);
    for p in &mesh.vertices {
        assert!(grown.signed_distance(p).abs() < 0.05, "{}", grown.signed_distance(p));
    }
    // Sheets, two pieces, and a field cut off by the border of its grid.
    let sheet = Slot { half_height_mm: 3.0, ..Slot::capsule(v(0.0, 4.0, 1.0), v(6.0, 5.0, 1.0), 0.6) };
    field.add(&Slot { axis: v(0.0, 0.0, 1.0), ..sheet }, 0.2, 1.0);
    field.add(&sphere(v(-3.5, -3.5, -5.0), 2.0), 0.0, 1.0);
    let facts = check_mesh(&field.surface());
    assert!(
        facts.closed && facts.oriented && facts.self_intersections == 0 && facts.components == 3,
        "{facts:?}"
    );
    assert!((field.at(&v(4.0, 2.9, -1.0), 9.0) - grown.signed_distance(&v(4.0, 2.9, -1.0))).abs() < 0.05);
    assert_eq!(field.at(&v(40.0, 0.0, 0.0), 9.0), 9.0);
}

/// A bar 8 mm wide and 10 mm high, cut into from above: what is left of it, and when nothing is.
#[test]
fn the_least_wall_of_a_notched_bar() {
    let bar = Slot::bar(v(0.0, 0.0, 0.0), v(40.0, 0.0, 0.0), Vector3::z(), 4.0, 5.0, 0.5);
    let boss = |x: f64| Slot::bar(v(x, 0.0, 0.0), v(x, 0.0, 0.0), Vector3::z(), 4.5, 5.2, 0.5);
    let plan = BodyPlan {
        slots: vec![(Role::Bar, bar), (Role::Boss, boss(0.0)), (Role::Boss, boss(40.0))],
        ..BodyPlan::default()
    };
    let whole = Left::new(&plan).least_wall();
    assert!(matches!(whole, Wall::Least(w) if (w - 8.0).abs() < 0.4), "{whole:?}");
    for left in [4.0, 1.6, 1.0] {
        let mut notch = Field::new(&v(10.0, -8.0, -8.0), &v(30.0, 8.0, 12.0), 0.6, 1.0);
        let bottom = left - 5.0 + 1.5;
        let (start, end) = (v(20.0, -7.0, bottom), v(20.0, 7.0, bottom));
        // Everything above the bottom goes.
        for up in 0..8 {
            let lift = v(0.0, 0.0, up as f64);
            notch.add(&Slot::capsule(start + lift, end + lift, 1.5), 0.0, 1.2);
        }
        let wall = Left::new(&plan).without(0, &notch).least_wall();
        // Beyond 2 mm, where the notch's own field ends, it is only known to be as thick.
        let right = |w: f64| (w - left.min(2.2)).abs() < 0.3;
        assert!(matches!(wall, Wall::Least(w) if right(w)), "{left}: {wall:?}");
        // What else the body reaches, as a palm on a frame of a whole hand, makes its walls no harder to see.
        let mut large = plan.clone();
        let far = v(-150.0, 300.0, 250.0);
        large.slots.push((Role::Bar, Slot::capsule(v(0.0, 0.0, 0.0), far, 4.0)));
        large.slots.push((Role::Boss, Slot::capsule(far, far, 4.5)));
        let wall = Left::new(&large).without(0, &notch).least_wall();
        assert!(matches!(wall, Wall::Least(w) if right(w)), "{left}: {wall:?} in a large body");
    }
    let mut through = Field::new(&v(10.0, -8.0, -8.0), &v(30.0, 8.0, 8.0), 0.6, 1.0);
    for up in -7..8 {
        let lift = f64::from(up);
        through.add(&Slot::capsule(v(20.0, -7.0, lift), v(20.0, 7.0, lift), 1.0), 0.0, 1.2);
    }
    assert_eq!(Left::new(&plan).without(0, &through).least_wall(), Wall::Apart);
}

/// A box at 200 mm, turned, one edge of which has a vertex on one side of it only, so near to a corner and to the edge that the triangle between them
/// is a sliver that rounding can turn over.
fn split_edge(turn: f64) -> Mesh {
    let rotation = nalgebra::Rotation3::from_euler_angles(0.3 + turn, 0.7 * turn, 1.1 - turn);
    let corner = |x: f64, y: f64, z: f64| rotation * Vector3::new(x, y, z) + Vector3::new(170.0, 200.0, 60.0);
    let mut vertices: Vec<Vector3<f64>> = (0..8)
        .map(|k| corner(f64::from(k & 1) * 0.07, f64::from(k >> 1 & 1) * 3.0, f64::from(k >> 2) * 2.0))
        .collect();
    // On the edge from 0 to 4, longer than what is collapsed in any case.
    vertices.push(corner(1e-7, 1e-7, 1.05 * SHORT_EDGE_MM));
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [1, 3, 7, 5]];
    let mut triangles: Vec<[usize; 3]> =
        quads.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]).collect();
    // The side between 0, 4, 6, 2, and the sliver at its edge.
    triangles.extend([[0, 8, 2], [8, 4, 6], [8, 6, 2], [0, 4, 8]]);
    Mesh { vertices, triangles }
}

#[test]
fn crossings_that_come_from_rounding_are_mended() {
    let turned = |k: i32| split_edge(0.37 * f64::from(k));
    let rounded = (0..200).filter(|k| {
        let mesh = turned(*k);
        assert!(check_mesh(&mesh).closed && check_mesh(&mesh).oriented);
        !check_mesh(&without_short_edges(&mesh, SHORT_EDGE_MM).rounded_to_f32()).is_printable()
    });
    assert!(rounded.count() > 20);
    for k in 0..200 {
        let facts = check_mesh(&finished(&turned(k)));
        assert!(facts.is_printable(), "{k}: {facts:?}");
        assert!((facts.volume_mm3 - 0.42).abs() < 1e-3, "{facts:?}");
    }
}
