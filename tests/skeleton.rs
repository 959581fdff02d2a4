//! Link geometry that follows the flexures: capsules against their plans, derivatives against differences.
#![allow(clippy::unwrap_used)]

use flexura::elaborate::{Options, elaborate};
use flexura::equilibrium::{Layout, Model};
use flexura::geometry::skeleton::{connect, median_derivative};
use flexura::geometry::{SkeletonCapsule, parts_input, plan_bodies, skeleton_capsules};
use flexura::ir::Design;
use flexura::kinematics::solve_motion;
use nalgebra::Vector3;

mod common;

const EDGES: usize = 12;
/// Step of central differences, relative to a variable's bounds.
const STEP: f64 = 1e-5;
/// Agreement of derivatives, relative to the largest.
const TOLERANCE: f64 = 1e-6;

fn example() -> (Design, Layout) {
    let options = Options { steps: Some(4), ..Options::default() };
    let design = elaborate("chebyshev.mech", &common::ExampleFiles, &options).design.unwrap();
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let motion = solve_motion(&design, &start).unwrap();
    let layout = Layout::new(&design, &motion, &start);
    (design, layout)
}

fn capsules(design: &Design, layout: &Layout, p: &[f64]) -> Vec<SkeletonCapsule> {
    let model = Model::new(design, layout, p, EDGES, true).unwrap();
    let plans = plan_bodies(&parts_input(design, layout, &model).unfilleted()).unwrap();
    for plan in &plans {
        assert_eq!(plan.slots.len(), plan.follows.len());
    }
    skeleton_capsules(design, &plans, &model)
}

fn numbers(c: &SkeletonCapsule) -> Vec<f64> {
    // A fan of no width has no direction.
    let vectors = [c.ends[0], c.ends[1], c.fan * c.spread_mm];
    let mut all: Vec<f64> = vectors.iter().flat_map(|v| v.iter().copied()).collect();
    all.extend([c.spread_mm, c.radius_mm]);
    all
}

fn derivatives(c: &SkeletonCapsule, column: usize) -> Vec<f64> {
    let fan = &c.d_fan_dp * c.spread_mm + c.fan * &c.d_spread_dp;
    let columns = [&c.d_ends_dp[0], &c.d_ends_dp[1], &fan];
    let mut all: Vec<f64> =
        columns.iter().flat_map(|m| m.column(column).iter().copied().collect::<Vec<_>>()).collect();
    all.extend([c.d_spread_dp[column], c.d_radius_dp[column]]);
    all
}

#[test]
fn capsules_follow_every_parameter() {
    let (design, layout) = example();
    follow(&design, &layout, &[2, 5, 9], 200);
}

/// A mechanism of `tests/mechanisms`, its text changed by `edit`.
fn mechanism(name: &str, edit: impl Fn(String) -> String) -> (Design, Layout) {
    let path = format!("{}/tests/mechanisms/{name}.mech", env!("CARGO_MANIFEST_DIR"));
    let design = common::gradient::design(&edit(std::fs::read_to_string(path).unwrap()), 4);
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let layout = common::gradient::layout(&design, &start);
    (design, layout)
}

/// Bodies in space: nets of round bars, stubs upright along the leaves' wide directions.
#[test]
fn capsules_in_space_follow_every_parameter() {
    for name in ["car", "dragon", "eye"] {
        let (design, layout) = mechanism(name, |text| text);
        follow(&design, &layout, &[2, 5], 400);
    }
    // Thick wires: the stubs' radius follows.
    let thick =
        |text: String| text.replace("as wire", "as wire { diameter = free 4 mm in 3.5 mm .. 4.5 mm }");
    let (design, layout) = mechanism("dragon", thick);
    follow(&design, &layout, &[3], 400);
}

/// Derivatives of all capsules against differences; at least `least` numbers must move.
fn follow(design: &Design, layout: &Layout, seeds: &[u64], least: usize) {
    let mut moving = 0;
    for seed in seeds.iter().copied() {
        let p = common::shaken(design, seed);
        let at = capsules(design, layout, &p);
        for (i, free) in design.free.iter().enumerate() {
            let h = STEP * (free.upper - free.lower);
            let shifted = |by: f64| {
                let mut q = p.clone();
                q[i] += by;
                capsules(design, layout, &q)
            };
            let (more, less) = (shifted(h), shifted(-h));
            assert_eq!((at.len(), at.len()), (more.len(), less.len()), "the net of nodes stays");
            for ((c, more), less) in at.iter().zip(&more).zip(&less) {
                let exact = derivatives(c, i);
                let largest = exact.iter().fold(1.0f64, |m, v| m.max(v.abs()));
                moving += exact.iter().filter(|v| **v != 0.0).count();
                for (k, ((a, b), exact)) in numbers(more).iter().zip(numbers(less)).zip(&exact).enumerate() {
                    let difference = (a - b) / (2.0 * h);
                    assert!(
                        (difference - exact).abs() < TOLERANCE * largest,
                        "seed {seed}, {} of {:?}, number {k}: {exact} {difference}",
                        free.path,
                        c.role
                    );
                }
            }
        }
    }
    assert!(moving > least, "{moving}");
}

/// Every capsule of a fan lies inside its slot and reaches its faces.
#[test]
fn fans_fill_their_slots() {
    let (design, layout) = example();
    let p: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let model = Model::new(&design, &layout, &p, EDGES, true).unwrap();
    let plans = plan_bodies(&parts_input(&design, &layout, &model).unfilleted()).unwrap();
    let axis = Vector3::from(design.layers.axis);
    let all = skeleton_capsules(&design, &plans, &model);
    for (body, plan) in plans.iter().enumerate() {
        let of_body: Vec<_> = all.iter().filter(|c| c.body == body).collect();
        for (role, slot) in &plan.slots {
            let fans: Vec<_> = of_body.iter().filter(|c| c.role == *role).collect();
            assert!(!fans.is_empty());
            let side = axis.cross(&(slot.end - slot.start)).try_normalize(1e-9).unwrap_or_else(Vector3::x);
            for direction in [axis, -axis, side, -side] {
                let slot_reach = slot.support(&direction).dot(&direction) + slot.round_mm;
                let reach = |c: &&SkeletonCapsule| {
                    let fan = c.fan.dot(&direction).abs() * c.spread_mm;
                    c.ends.iter().map(|e| e.dot(&direction)).fold(f64::MIN, f64::max) + fan + c.radius_mm
                };
                let most = fans.iter().map(|c| reach(c)).fold(f64::MIN, f64::max);
                // Another slot of the same role may reach further.
                assert!(most > slot_reach - 0.15, "{role:?}: {most} {slot_reach}");
            }
        }
        for c in &of_body {
            for s in [-1.0, 1.0] {
                for end in c.ends {
                    let center = end + c.fan * (s * c.spread_mm);
                    let inside = plan.slots.iter().any(|(_, slot)| {
                        [axis, -axis, c.fan, -c.fan].iter().all(|d| {
                            center.dot(d) + c.radius_mm < slot.support(d).dot(d) + slot.round_mm + 1e-9
                        })
                    });
                    assert!(inside, "{:?} {center}", c.role);
                }
            }
        }
    }
}

/// The median of three points in space against differences.
#[test]
fn a_hub_follows_its_nodes() {
    let points =
        [(0.0, 0.0, 0.0), (40.0, 3.0, 1.0), (18.0, 30.0, -2.0)].map(|(x, y, z)| Vector3::new(x, y, z));
    let hub = |points: &[Vector3<f64>]| connect(points, |_, _| false).hub.unwrap();
    let at = hub(&points);
    let exact = median_derivative(&points, &at);
    for (i, by) in exact.iter().enumerate() {
        for c in 0..3 {
            let shifted = |h: f64| {
                let mut moved = points;
                moved[i][c] += h;
                hub(&moved)
            };
            let difference = (shifted(1e-4) - shifted(-1e-4)) / 2e-4;
            assert!((difference - by.column(c)).norm() < TOLERANCE, "{i} {c}: {difference} {by}");
        }
    }
}
