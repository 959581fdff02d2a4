//! From solved designs and their printed parts to the [`Scene`] that viewers show: every instance in its place.

use super::joined::{Printed, Solid};
use crate::emit::scene::{Bar, Frame, Ghost, Link, Mark, Outline, Ribbon, Scene, Trace};
use crate::equilibrium::{Cycle, Layout, Model};
use crate::geometry::skeleton::spanning_tree;
use crate::geometry::{FlexureSolid, parts_input};
use crate::ir::{Assembly, Design, Instance, Placement};
use crate::math::Pose;
use crate::rod::{SECTION_POINTS, SectionShape};
use nalgebra::{Matrix3, Vector3};

/// Radius of a ghost's bar as a part of a link's height: in a planar mechanism it lies before the links and is slender, in
/// space it surrounds their round bars.
const FLAT_GHOST: f64 = 0.1;
const ROUND_GHOST: f64 = 0.3;
/// How far a planar ghost stands before the links, as a part of their height.
const GHOST_BEFORE: f64 = 0.25;
/// Sine of the angle by which axes may differ in a planar mechanism.
const PARALLEL: f64 = 1e-6;

/// How a design moves, in its own coordinates.
pub struct Moving {
    /// Names of the bodies.
    names: Vec<String>,
    /// Centres of the bodies in the rest pose.
    centers: Vec<Vector3<f64>>,
    /// Pose of each body by state.
    poses: Vec<Vec<Pose>>,
    /// Flexures in the rest pose, with as many stations as in the states.
    pub rest: Vec<FlexureSolid>,
    /// Largest stress over the cycle by flexure, station and point.
    peaks_mpa: Vec<Vec<[f64; SECTION_POINTS]>>,
    /// Largest stress by flexure, state and station.
    stresses_mpa: Vec<Vec<Vec<f64>>>,
    /// Bars of the conventional bodies, their poses by state.
    ghosts: Vec<(usize, Vec<[Vector3<f64>; 2]>)>,
    ghost_radius_mm: f64,
    conventional: Vec<Vec<Pose>>,
    traces: Vec<Trace>,
    /// The common axis of all joints.
    flat: Option<Vector3<f64>>,
    marks: Vec<Mark>,
}

impl Moving {
    /// From a solved cycle.
    pub fn new(design: &Design, layout: &Layout, model: &Model, cycle: &Cycle) -> Self {
        let input = parts_input(design, layout, model);
        let all: Vec<Vec<Vec<[f64; SECTION_POINTS]>>> = (model.rods.iter().enumerate())
            .map(|(r, rod)| cycle.states.iter().map(|e| rod.rod.stresses(&e.strains[r])).collect())
            .collect();
        let largest = |row: &[f64; SECTION_POINTS]| row.iter().fold(0.0, |m: f64, s| m.max(*s));
        let mut peaks: Vec<Vec<[f64; SECTION_POINTS]>> =
            input.flexures.iter().map(|f| vec![[0.0; SECTION_POINTS]; f.centreline.len()]).collect();
        for (peaks, states) in peaks.iter_mut().zip(&all) {
            for rows in states {
                for (peak, row) in peaks.iter_mut().zip(rows) {
                    peak.iter_mut().zip(row).for_each(|(p, s)| *p = p.max(*s));
                }
            }
        }
        let axis = Vector3::from(design.layers.axis);
        let flat = design.joints.iter().all(|j| Vector3::from(j.axis).cross(&axis).norm() < PARALLEL);
        let height = input.height_mm;
        let levels = input.bodies.iter().filter_map(|b| Some(b.axis?.dot(&axis) * b.level_mm));
        let top = levels.fold(f64::NEG_INFINITY, f64::max) + height * (0.5 + GHOST_BEFORE);
        let values = design.exprs.values(&model.p);
        let ghosts = design.bodies.iter().enumerate().filter_map(|(b, body)| {
            let drawn =
                body.skeleton.iter().map(|p| Vector3::from(p.position.map(|id| values[id.0 as usize])));
            let placed = drawn.map(|p| {
                let p = layout.rest_poses[b].point(&p);
                if flat && top.is_finite() { p + axis * (top - p.dot(&axis)) } else { p }
            });
            let bars = bars(&placed.collect::<Vec<_>>());
            (!bars.is_empty()).then_some((b, bars))
        });
        let traces = design.traces.iter().zip(&layout.traces).map(|(told, t)| Trace {
            name: told.name.clone(),
            path: cycle.states.iter().map(|e| e.state.poses[t.body].point(&t.rest)).collect(),
            target: if t.has_target { t.curve.clone() } else { Vec::new() },
        });
        let bores = input.bodies.iter().flat_map(|b| &b.eyes);
        let bores: Vec<(usize, Option<f64>)> = bores.map(|e| (e.joint, e.bore.diameter_mm())).collect();
        let mark = |(j, joint): (usize, &crate::ir::Joint)| {
            let body = joint.bodies.first().copied().unwrap_or_default();
            Mark {
                name: joint.name.clone(),
                at: layout.rest_poses[body].point(&layout.joint_points[j]),
                flexible: joint.is_compliant(),
                bore_mm: bores.iter().filter(|b| b.0 == j).filter_map(|b| b.1).reduce(f64::max),
            }
        };
        Self {
            marks: design.joints.iter().enumerate().map(mark).collect(),
            flat: flat.then_some(axis),
            names: design.bodies.iter().map(|b| b.name.clone()).collect(),
            centers: layout.bodies.iter().map(|b| b.center).collect(),
            poses: cycle.states.iter().map(|e| e.state.poses.clone()).collect(),
            rest: input.flexures,
            peaks_mpa: peaks,
            stresses_mpa: all
                .iter()
                .map(|states| states.iter().map(|rows| rows.iter().map(largest).collect()).collect())
                .collect(),
            ghosts: ghosts.collect(),
            ghost_radius_mm: height * if flat { FLAT_GHOST } else { ROUND_GHOST },
            conventional: layout.conventional.clone(),
            traces: traces.collect(),
        }
    }
}

/// The bars by which a body's points are shown: a triangle, else the shortest tree.
fn bars(points: &[Vector3<f64>]) -> Vec<[Vector3<f64>; 2]> {
    let mut distinct: Vec<Vector3<f64>> = Vec::new();
    for p in points {
        if distinct.iter().all(|q| (p - q).norm() > 1e-6) {
            distinct.push(*p);
        }
    }
    let between = |i: usize, j: usize| (distinct[i] - distinct[j]).norm();
    let mut edges = spanning_tree(distinct.len(), &between);
    if let [a, b, c] = distinct.as_slice()
        && (b - a).cross(&(c - a)).norm() > 1e-3 * (b - a).norm() * (c - a).norm()
    {
        edges = vec![(0, 1), (1, 2), (2, 0)];
    }
    edges.iter().map(|(i, j)| [distinct[*i], distinct[*j]]).collect()
}

/// The whole assembly. `moving` and `solids` are those of each design.
pub fn scene(assembly: &Assembly, moving: &[Moving], solids: &[Solid], printed: &[Printed]) -> Scene {
    let of = |i: usize| {
        let instance = assembly.instances.get(i)?;
        Some((instance, moving.get(instance.design)?))
    };
    let steps = assembly.designs.first().map_or(0, |d| d.cycle.steps);
    let duration_s = assembly.designs.first().map_or(0.0, |d| d.cycle.duration_s);
    let mut out = Scene {
        name: assembly.name.clone(),
        times_s: (0..=steps).map(|s| duration_s * s as f64 / steps.max(1) as f64).collect(),
        full_stress_mpa: full_stress(assembly, moving),
        ..Scene::default()
    };
    for (part, printed) in printed.iter().enumerate() {
        for ((i, b), mesh) in &printed.links {
            let Some((instance, m)) = of(*i) else { continue };
            let (Some(name), Some(center)) = (m.names.get(*b), m.centers.get(*b)) else { continue };
            out.links.push(Link {
                name: instance.of(name),
                part,
                mesh: mesh.clone(),
                center: instance.placement.point(center),
                states: frames(instance, &m.poses, *b, center),
            });
        }
        for (i, f) in &printed.flexures {
            let Some((instance, m)) = of(*i) else { continue };
            let Some(solid) = solids.get(instance.design) else { continue };
            out.ribbons.extend(ribbon(instance, m, solid, *f).map(|r| Ribbon { part, ..r }));
        }
    }
    out.flat = flat(assembly, moving);
    for (i, instance) in assembly.instances.iter().enumerate() {
        let Some((_, m)) = of(i) else { continue };
        let p = &instance.placement;
        out.marks.extend(m.marks.iter().map(|mark| Mark {
            name: instance.of(&mark.name),
            at: p.point(&mark.at),
            ..mark.clone()
        }));
        let plans = solids.get(instance.design).map_or(&[][..], |s| s.parts.plans.as_slice());
        let bodies = assembly.designs.get(instance.design).map_or(&[][..], |d| d.bodies.as_slice());
        out.outlines.extend(bodies.iter().zip(plans).map(|(body, plan)| {
            Outline {
                name: instance.of(&body.name),
                ground: body.ground,
                bars: plan
                    .slots
                    .iter()
                    .map(|(_, s)| Bar {
                        ends: [p.point(&s.start), p.point(&s.end)],
                        radius_mm: s.disc_radius_mm + s.round_mm,
                    })
                    .collect(),
            }
        }));
        out.ghosts.extend(m.ghosts.iter().filter_map(|(b, bars)| {
            let center = m.centers.get(*b)?;
            Some(Ghost {
                name: m.names.get(*b).map(|n| instance.of(n)).unwrap_or_default(),
                bars: bars.iter().map(|bar| bar.map(|x| p.point(&x))).collect(),
                radius_mm: m.ghost_radius_mm,
                center: p.point(center),
                states: frames(instance, &m.conventional, *b, center),
            })
        }));
        out.traces.extend(m.traces.iter().map(|t| Trace {
            name: instance.of(&t.name),
            path: ordered(instance, &t.path).map(|x| p.point(x)).collect(),
            target: t.target.iter().map(|x| p.point(x)).collect(),
        }));
    }
    out
}

/// The axis that all joints of all instances have in common.
fn flat(assembly: &Assembly, moving: &[Moving]) -> Option<Vector3<f64>> {
    let axis = |i: &Instance| Some(i.placement.direction(&moving.get(i.design)?.flat?));
    let axes: Option<Vec<Vector3<f64>>> = assembly.instances.iter().map(axis).collect();
    let axes = axes?;
    let first = *axes.first()?;
    axes.iter().all(|a| a.cross(&first).norm() < PARALLEL).then_some(first)
}

/// The least strength that a material states, else the largest stress.
fn full_stress(assembly: &Assembly, moving: &[Moving]) -> f64 {
    let stated = assembly.designs.iter().filter_map(|d| d.material.strength_mpa).reduce(f64::min);
    let peaks = moving.iter().flat_map(|m| m.peaks_mpa.iter().flatten().flatten());
    stated.unwrap_or_else(|| peaks.fold(0.0, |m, s| m.max(*s)))
}

/// What an instance has of a design's states, in its own order.
fn ordered<'a, T>(instance: &'a Instance, states: &'a [T]) -> impl Iterator<Item = &'a T> {
    (0..states.len()).filter_map(|s| states.get(instance.state(s)))
}

/// Where a body's centre is and how it is turned, in the assembly.
fn frames(instance: &Instance, poses: &[Vec<Pose>], body: usize, center: &Vector3<f64>) -> Vec<Frame> {
    let turn = instance.placement.matrix();
    // The pose's own centre may be another one: that of the conventional motion is the origin.
    let frame = |pose: &Pose| Frame {
        origin: instance.placement.point(&pose.point(center)),
        rotation: turn * pose.rotation * turn.transpose(),
    };
    ordered(instance, poses).filter_map(|state| state.get(body)).map(frame).collect()
}

fn ribbon(instance: &Instance, moving: &Moving, solid: &Solid, flexure: usize) -> Option<Ribbon> {
    let (rest, p) = (moving.rest.get(flexure)?, &instance.placement);
    let stations = |f: &FlexureSolid| -> Vec<Frame> {
        let axes = f.m1.iter().zip(&f.m2);
        f.centreline.iter().zip(axes).map(|(x, (m1, m2))| station(p, x, m1, m2)).collect()
    };
    let states = ordered(instance, &solid.states).filter_map(|s| s.flexures.get(flexure));
    let mut peaks = moving.peaks_mpa.get(flexure)?.clone();
    if p.is_mirrored() {
        // There m₁ points the other way: what was at x is at −x.
        let order: [usize; SECTION_POINTS] = std::array::from_fn(|k| opposite(rest.section, k));
        peaks.iter_mut().for_each(|row| *row = order.map(|k| row[k]));
    }
    Some(Ribbon {
        name: instance.of(&rest.path),
        part: 0,
        section: rest.section,
        half_widths_mm: rest.a_mm.iter().zip(&rest.b_mm).map(|(a, b)| [*a, *b]).collect(),
        rest: stations(rest),
        states: states.map(stations).collect(),
        peaks_mpa: peaks,
        stresses_mpa: ordered(instance, moving.stresses_mpa.get(flexure)?).cloned().collect(),
    })
}

/// A station's frame in the assembly; a mirror image turns m₁, so that the frame stays right-handed.
fn station(p: &Placement, center: &Vector3<f64>, m1: &Vector3<f64>, m2: &Vector3<f64>) -> Frame {
    let (x, y) = (p.direction(m1) * p.handedness(), p.direction(m2));
    Frame { origin: p.point(center), rotation: Matrix3::from_columns(&[x, y, x.cross(&y)]) }
}

/// The boundary point at (−x, y).
fn opposite(section: SectionShape, point: usize) -> usize {
    let (x, y) = section.boundary(point);
    let apart = |k: &usize| {
        let (u, v) = section.boundary(*k);
        (u + x).abs() + (v - y).abs()
    };
    (0..SECTION_POINTS).min_by(|i, j| apart(i).total_cmp(&apart(j))).unwrap_or(point)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_joined_without_crossing() {
        let p = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        assert_eq!(bars(&[p(0.0, 0.0), p(0.0, 0.0)]).len(), 0);
        assert_eq!(bars(&[p(0.0, 0.0), p(4.0, 0.0), p(2.0, 0.0)]).len(), 2, "in a line");
        assert_eq!(bars(&[p(0.0, 0.0), p(4.0, 0.0), p(2.0, 1.0)]).len(), 3, "a triangle");
    }

    #[test]
    fn mirrored_points_are_points() {
        for section in [SectionShape::Ellipse, SectionShape::Rectangle] {
            for k in 0..SECTION_POINTS {
                let ((x, y), (u, v)) = (section.boundary(k), section.boundary(opposite(section, k)));
                assert!((u + x).abs() < 1e-12 && (v - y).abs() < 1e-12, "{section:?} {k}");
            }
        }
    }
}
