//! What is promised of the printed parts of every example, measured on the meshes: the volume of a finer mesh, flexures as
//! thick as designed, and the clearance between bent flexures and their own links in every state of the cycle. Distances
//! are taken from point to triangle over a grid of cells, which shares nothing with how links are carved or gaps found.
#![allow(clippy::unwrap_used)]

mod common;

use common::folder::Folder;
use flexura::elaborate::{Options, elaborate};
use flexura::emit::lock::Lock;
use flexura::equilibrium::{Equilibrium, Layout, Model, sweep};
use flexura::geometry::{
    Carving, Facets, FlexureSolid, Mesh, MovedState, Parts, PartsInput, Probe, build_carved_parts,
    build_planned, carve, check_mesh, flexure_solid, has_gravity, parts_input, plan_bodies, weigh,
};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use flexura::rod::SectionShape;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Edges of a rod in the sweep, and in the mesh.
const EDGES: usize = 20;
const MESH_EDGES: usize = 48;
/// Volume against that of a mesh with twice the facets. Measured: see the table in docs/performance.md.
const VOLUME: f64 = 0.005;
/// Thickness against the design's, relative. Measured: 1e-4 at most.
const THICKNESS: f64 = 0.002;
/// A flexure's chords lie inside of its curve, mm.
const CHORD_MM: f64 = 0.02;
/// Beside its attachment a flexure cannot keep the clearance, mm: from its stub's nose, and from a link that it was not
/// carved out of (`NEAR_MM` of the gaps that are reported).
const ROOT_MM: f64 = 0.6;
const NEAR_MM: f64 = 4.0;
/// Points round a bent flexure, and along each of its edges.
const AROUND: u32 = 16;
const PER_EDGE: u32 = 4;

/// A design of an example, solved, over its cycle.
struct Solved {
    name: String,
    input: PartsInput,
    states: Vec<MovedState>,
}

/// An example from its lock, or as it starts.
fn solved(folder: &str, name: &str, locked: bool) -> Vec<Solved> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("examples").join(folder);
    let out = elaborate(&format!("{name}.mech"), &Folder(folder.clone()), &Options::default());
    let designs = out.assembly.unwrap().designs;
    let lock = std::fs::read_to_string(folder.join(format!("{name}.lock"))).unwrap();
    let lock = Lock::parse(&lock, 0).unwrap();
    let values = |d: &Design| match designs.len() {
        _ if !locked => d.free.iter().map(|f| f.start).collect(),
        1 => lock.start_values(d),
        _ => lock.part(&d.name).start_values(d),
    };
    designs.iter().map(|d| moved(d, &values(d))).collect()
}

fn moved(design: &Design, values: &[f64]) -> Solved {
    let mut design = design.clone();
    if has_gravity(&design) {
        let weights = weigh(&design, values).unwrap();
        design.bodies.iter_mut().zip(weights).for_each(|(b, w)| b.printed = Some(w));
    }
    let motion = solve_motion(&design, values).unwrap();
    let layout = Layout::new(&design, &motion, values);
    let model = Model::new(&design, &layout, values, EDGES, false).unwrap();
    let fine = Model::new(&design, &layout, values, MESH_EDGES, false).unwrap();
    let state = |e: &Equilibrium| {
        let poses = e.state.poses.clone();
        let flexure = |(r, state): (usize, _)| {
            let (rod, q) = (&design.rods[r], model.rods[r].rod.parameters());
            let ends = [poses[rod.from.body].point(&q.position_a), poses[rod.to.body].point(&q.position_b)];
            flexure_solid(&design, &layout, &model, r, state, ends)
        };
        MovedState { flexures: e.state.rods.iter().enumerate().map(flexure).collect(), poses }
    };
    Solved {
        name: design.name.clone(),
        input: parts_input(&design, &layout, &fine),
        states: sweep(&model).unwrap().states.iter().map(state).collect(),
    }
}

/// The parts, and those with as little taken out of finer ones.
fn built(solved: &Solved) -> [Parts; 2] {
    let Solved { input, states, .. } = solved;
    let plans = plan_bodies(input).unwrap();
    let coarse = Facets::default();
    let fine = Facets { around: 2 * coarse.around, edge: 2 * coarse.edge, ..coarse };
    let with = |facets| {
        let input = PartsInput { facets, ..input.clone() };
        let carving = carve(&input, &plans, states).unwrap();
        build_planned(&input, plans.clone(), carving, &|_| true).unwrap()
    };
    let (a, b) = rayon::join(|| with(coarse), || with(fine));
    [a, b]
}

/// Largest relative difference of volumes.
fn volumes([coarse, fine]: &[Parts; 2]) -> f64 {
    let apart = |(c, f): (&flexura::geometry::Part, &flexura::geometry::Part)| {
        assert!(check_mesh(&c.mesh).is_printable(), "{}", c.name);
        (c.mesh.volume_mm3() / f.mesh.volume_mm3() - 1.0).abs()
    };
    coarse.parts.iter().zip(&fine.parts).map(apart).fold(0.0, f64::max)
}

/// Largest relative difference between a flexure's least thickness on the mesh and in the design.
fn thicknesses(input: &PartsInput, parts: &Parts) -> f64 {
    let probes: Vec<Probe<'_>> = parts.parts.par_iter().map(|p| Probe::new(&p.mesh)).collect();
    let apart = |f: &FlexureSolid| {
        let part = parts.parts.iter().position(|p| p.bodies.contains(&f.bodies.0)).unwrap();
        let ends = [f.end_point(false), f.end_point(true)];
        let (mut measured, mut designed) = (f64::INFINITY, f64::INFINITY);
        for (k, p) in f.centreline.iter().enumerate() {
            if ends.iter().any(|e| (e - p).norm() < 2.0 * ROOT_MM) {
                continue;
            }
            // Beside the very middle, where a ray meets no vertex.
            let at = p + f.m2[k] * (1e-3 * f.b_mm[k]);
            measured = measured.min(probes[part].thickness_mm(&at, &f.m1[k]).unwrap());
            designed = designed.min(2.0 * f.a_mm[k]);
        }
        assert!(designed.is_finite(), "{}", f.path);
        (measured / designed - 1.0).abs()
    };
    input.flexures.par_iter().map(apart).reduce(|| 0.0, f64::max)
}

/// Triangles of a link by the cells of a grid as wide as what is looked for.
struct Cells<'m> {
    link: &'m Mesh,
    size: f64,
    cells: HashMap<[i64; 3], Vec<usize>>,
}

impl<'m> Cells<'m> {
    fn new(link: &'m Mesh, size: f64) -> Self {
        let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
        for t in 0..link.triangles.len() {
            let [a, b, c] = link.corners(t);
            let [low, high] =
                [a.inf(&b).inf(&c), a.sup(&b).sup(&c)].map(|p| p.map(|x| (x / size).floor() as i64));
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        cells.entry([x, y, z]).or_default().push(t);
                    }
                }
            }
        }
        Self { link, size, cells }
    }

    /// Distance from the surface, if it is below the size of a cell.
    fn distance(&self, p: &Vector3<f64>) -> f64 {
        let at = p.map(|x| (x / self.size).floor() as i64);
        let mut least = f64::INFINITY;
        for k in 0..27 {
            let cell = [at.x + k % 3 - 1, at.y + k / 3 % 3 - 1, at.z + k / 9 - 1];
            for t in self.cells.get(&cell).into_iter().flatten() {
                least = least.min(from_triangle(p, &self.link.corners(*t)));
            }
        }
        least
    }
}

/// Distance of a point from a triangle: from its plane where the foot is inside, else from an edge.
fn from_triangle(p: &Vector3<f64>, [a, b, c]: &[Vector3<f64>; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(q, r)| (*r - *q).cross(&(p - *q)).dot(&normal) >= 0.0);
    if inside && normal.norm() > 0.0 {
        return (p - a).dot(&normal).abs() / normal.norm();
    }
    let edge = |q: &Vector3<f64>, r: &Vector3<f64>| {
        let d = r - q;
        let u = ((p - q).dot(&d) / d.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p - q - d * u).norm()
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

/// Points on a flexure, each with its way from the first end, mm.
fn surface(f: &FlexureSolid) -> Vec<(f64, Vector3<f64>)> {
    let (mut out, mut way) = (Vec::new(), 0.0);
    for k in 1..f.centreline.len() {
        let length = (f.centreline[k] - f.centreline[k - 1]).norm();
        for part in 0..PER_EDGE {
            let u = f64::from(part) / f64::from(PER_EDGE);
            let between = |v: &[Vector3<f64>]| v[k - 1].lerp(&v[k], u);
            let size = |v: &[f64]| v[k - 1] + (v[k] - v[k - 1]) * u;
            for turn in 0..AROUND {
                let (sin, cos) = (TAU * f64::from(turn) / f64::from(AROUND)).sin_cos();
                // Along the border of a rectangle, or of the ellipse within it.
                let reach = match f.section {
                    SectionShape::Ellipse => 1.0,
                    SectionShape::Rectangle => 1.0 / cos.abs().max(sin.abs()),
                };
                let off = between(&f.m1) * (cos * reach * size(&f.a_mm))
                    + between(&f.m2) * (sin * reach * size(&f.b_mm));
                out.push((way + u * length, between(&f.centreline) + off));
            }
        }
        way += length;
    }
    out
}

/// Least distance between a bent flexure and its own links over all states, and how many such pairs were looked at: those
/// that were carved from where the stub is farther than the clearance, others beyond their roots. Infinite where nothing is
/// nearer than a cell.
fn clearances(solved: &Solved, parts: &Parts, carving: &Carving) -> (f64, usize) {
    let Solved { input, states, .. } = solved;
    let links: Vec<(usize, &Mesh)> =
        parts.parts.iter().flat_map(|p| p.bodies.iter().copied().zip(&p.links)).collect();
    let cells: Vec<(usize, Cells<'_>)> =
        links.par_iter().map(|(b, m)| (*b, Cells::new(m, 2.0 * input.clearance_mm))).collect();
    let mut pairs = Vec::new();
    for (f, flexure) in input.flexures.iter().enumerate() {
        for body in [flexure.bodies.0, flexure.bodies.1] {
            let cut = carving.cuts.iter().find(|c| (c.body, c.flexure) == (body, f));
            // What could not be carved is told (W0637).
            if cut.is_none_or(|c| c.made) {
                pairs.push((f, body, cut.is_some()));
            }
        }
    }
    let least = pairs.par_iter().map(|(f, body, carved)| {
        let cells = &cells.iter().find(|(b, _)| b == body).unwrap().1;
        let in_state = |state: &MovedState| {
            let (bent, pose) = (&state.flexures[*f], &state.poses[*body]);
            let ends = [bent.bodies.0 == *body, bent.bodies.1 == *body];
            let (thick, _) = bent.end_axes(ends[1]);
            let root = if *carved { ROOT_MM + input.clearance_mm + 2.0 * thick } else { NEAR_MM };
            let points = surface(bent);
            let length = points.last().map_or(0.0, |(way, _)| *way);
            let beyond = |way: f64| (!ends[0] || way > root) && (!ends[1] || length - way > root);
            let free = points.iter().filter(|(way, _)| beyond(*way));
            free.map(|(_, p)| cells.distance(&pose.back(p))).fold(f64::INFINITY, f64::min)
        };
        states.iter().map(in_state).fold(f64::INFINITY, f64::min)
    });
    (least.reduce(|| f64::INFINITY, f64::min), pairs.len())
}

fn proved(folder: &str, name: &str) {
    for design in solved(folder, name, true) {
        let parts = built(&design);
        let volume = volumes(&parts);
        let thickness = thicknesses(&design.input, &parts[0]);
        let (gap, pairs) = clearances(&design, &parts[0], &parts[0].carving);
        let carved = parts[0].carving.cuts.iter().filter(|c| c.made).count();
        println!(
            "{name} {}: volume {:.3} %, thickness {thickness:.1e}, least gap {gap:.3} of {} mm in {pairs} pairs, {carved} carved",
            design.name,
            100.0 * volume,
            design.input.clearance_mm,
        );
        assert!(volume < VOLUME, "{name}: volume {volume}");
        assert!(thickness < THICKNESS, "{name}: thickness {thickness}");
        assert!(gap >= design.input.clearance_mm - CHORD_MM, "{name}: gap {gap}");
    }
}

#[test]
fn chebyshev_s_parts_are_what_is_promised() {
    proved("chebyshev", "chebyshev");
}

/// As it starts, one of Chebyshev's leaves is bent too near to its link, which makes way. The measurement sees it where leaves come
/// 0.3 mm nearer than they do.
#[test]
fn links_that_make_way_keep_the_clearance() {
    const NEARER_MM: f64 = 0.3;
    let mut design = solved("chebyshev", "chebyshev", false).remove(0);
    let carved = build_carved_parts(&design.input, &design.states).unwrap();
    assert!(carved.carving.cuts.iter().any(|c| c.made), "{:?}", carved.carving.cuts);
    let states = design.states.clone();
    let mut shifted = |by: Vector3<f64>| {
        design.states.clone_from(&states);
        let flexures = design.states.iter_mut().flat_map(|s| &mut s.flexures);
        flexures.flat_map(|f| &mut f.centreline).for_each(|p| *p += by);
        clearances(&design, &carved, &carved.carving).0
    };
    let kept = shifted(Vector3::zeros());
    let turn = |k: u32| Vector3::new(f64::from(k).cos(), f64::from(k).sin(), 0.0) * NEARER_MM;
    let nearer = (0..6).map(|k| shifted(turn(k))).fold(f64::INFINITY, f64::min);
    println!("least gap {kept:.3} mm, {nearer:.3} mm where leaves are shifted");
    let clearance = design.input.clearance_mm;
    assert!((clearance - CHORD_MM..clearance + 0.3).contains(&kept), "{kept}");
    assert!(nearer < clearance - CHORD_MM, "{nearer}");
}

#[test]
fn the_parts_of_every_example_are() {
    if common::skipped() {
        return;
    }
    for (folder, name) in [
        ("chebyshev", "chebyshev_all_terms"),
        ("jansen", "jansen"),
        ("klann", "klann"),
        ("car", "car"),
        ("dragon", "dragon"),
        ("eye", "eye"),
        ("hand", "hand"),
    ] {
        proved(folder, name);
    }
}
