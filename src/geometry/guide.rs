//! Conventional sliders: a square bar in a sleeve of four plates, the clearance between all faces. The first body holds
//! the sleeve, the second the bar, which ends in stops wider than the sleeve.

use super::anchor::Anchor;
use super::distance::separation;
use super::link::{BOSS_BELOW_MM, BOSS_EXTRA_MM, Builder, Role, SPREAD_MM, spread};
use super::parts::{GeometryError, Guide};
use super::slot::Slot;
use nalgebra::Vector3;

/// Length of the sleeve as a part of the links' height.
const SLEEVE_PER_HEIGHT: f64 = 1.25;
/// Wall of the sleeve as a part of the links' height.
const WALL_PER_HEIGHT: f64 = 0.15;
/// Way left between a stop and the sleeve at the ends of the travel, beyond the clearance, mm.
const STOP_MM: f64 = 1.0;
/// How deep a boss reaches into the sleeve's wall is the wall less this, mm.
const NOT_THROUGH_MM: f64 = 0.4;
/// Rounding of the bar's edges, mm.
const EDGE_MM: f64 = 0.4;
/// Side plates are thinner than the others by this, so that no faces coincide, mm.
const THINNER_MM: f64 = 0.05;

/// Sizes of a guide, mm.
struct Sizes {
    wall: f64,
    /// Half the outer width and the inner width of the sleeve, half the width of the bar.
    outer: f64,
    inner: f64,
    bar: f64,
    /// Half the length of the sleeve.
    half: f64,
}

impl Builder<'_> {
    fn guide_sizes(&self) -> Sizes {
        let height = self.input.height_mm;
        let wall = (WALL_PER_HEIGHT * height).max(self.input.least_wall_mm);
        let outer = self.half() - BOSS_BELOW_MM;
        let inner = outer - wall;
        Sizes {
            wall,
            outer,
            inner,
            bar: inner - self.input.clearance_mm,
            half: SLEEVE_PER_HEIGHT * height / 2.0,
        }
    }

    /// Radius of what the bar ends in, and of what holds the sleeve.
    fn stop_radius(&self, in_space: bool) -> f64 {
        // In space a ball must not pass the sleeve either.
        if in_space {
            self.ball_radius().max(self.guide_sizes().inner + BOSS_EXTRA_MM)
        } else {
            self.boss_radius()
        }
    }

    /// Where the bar ends, along its direction from the sleeve's middle.
    fn bar_ends(&self, guide: &Guide, in_space: bool) -> (f64, f64) {
        let (low, high) = guide.travel_mm;
        let reach = self.guide_sizes().half + self.input.clearance_mm + STOP_MM + self.stop_radius(in_space);
        (-reach - high, reach - low)
    }

    /// A body's share of a slider, and the node from which the rest of the body is reached.
    pub(super) fn add_guide(&mut self, guide: &Guide, in_space: bool) -> Result<(), GeometryError> {
        let sizes = self.guide_sizes();
        if sizes.bar < self.input.least_wall_mm {
            let name = self.input.bodies.get(self.index).map(|b| b.name.clone()).unwrap_or_default();
            return Err(GeometryError::Input(format!("the links are too low for the slider of `{name}`")));
        }
        let (s, n) = (guide.direction, guide.normal);
        let side = n.cross(&s);
        let known: Vec<Vector3<f64>> = self.nodes.iter().map(|n| n.at).collect();
        let body = self.input.bodies.get(self.index);
        let others = body.into_iter().flat_map(|b| &b.skeleton).copied().chain(known);
        let others: Vec<Vector3<f64>> = others.filter(|p| (p - guide.point).norm() > 1e-6).collect();
        let way = |p: &Vector3<f64>| others.iter().map(|q| (p - q).norm()).sum::<f64>();
        let nearest = |places: &[Vector3<f64>]| {
            places.iter().copied().min_by(|p, q| way(p).total_cmp(&way(q))).unwrap_or(guide.point)
        };
        let role = Role::Guide(guide.joint);
        let radius = self.stop_radius(in_space);
        if guide.sleeve {
            for slot in self.sleeve(guide, -sizes.half, sizes.half) {
                self.push(role, slot);
            }
            let out = sizes.inner + NOT_THROUGH_MM + radius;
            let mut places = vec![guide.point + side * out, guide.point - side * out];
            if in_space {
                places.extend([guide.point + n * out, guide.point - n * out]);
            }
            self.guide_node(guide, &nearest(&places), radius, in_space, true);
        } else {
            let (low, high) = self.bar_ends(guide, in_space);
            let ends = [guide.point + s * low, guide.point + s * high];
            self.push(role, Slot::bar(ends[0], ends[1], n, sizes.bar, sizes.bar, EDGE_MM));
            let at = nearest(&ends);
            for end in ends {
                self.guide_node(guide, &end, radius, in_space, end == at);
            }
        }
        Ok(())
    }

    /// What ends at a guide, in the body's own layer if it has one.
    fn guide_node(&mut self, guide: &Guide, at: &Vector3<f64>, radius: f64, in_space: bool, is_node: bool) {
        if in_space {
            let ball = radius + 0.5 * SPREAD_MM * spread(self.plan.slots.len());
            self.push(Role::Boss, Slot::capsule(*at, *at, ball));
            if is_node {
                self.node_in_space(*at, Anchor::Fixed);
            }
            return;
        }
        let level = guide.point.dot(&self.axis());
        if (level - self.level).abs() < self.half() {
            let on_level = self.at_level(at, self.level);
            self.boss(on_level, radius, &Anchor::Fixed);
        } else {
            let half = self.half() - BOSS_BELOW_MM - SPREAD_MM * spread(self.plan.slots.len());
            self.column(Role::Riser, at, (level - half, level + half), radius, &Anchor::Fixed);
        }
        if is_node {
            self.node(*at, None, Anchor::Fixed);
        }
    }

    /// The four plates of a sleeve between two places along its direction.
    fn sleeve(&self, guide: &Guide, from: f64, to: f64) -> [Slot; 4] {
        let sizes = self.guide_sizes();
        let (s, n) = (guide.direction, guide.normal);
        let side = n.cross(&s);
        let plate = |middle: Vector3<f64>, axis: Vector3<f64>, core: f64, thick: f64, less: f64| Slot {
            start: middle + s * (from + less + thick / 2.0),
            end: middle + s * (to - less - thick / 2.0),
            axis,
            disc_radius_mm: 0.0,
            half_height_mm: core,
            round_mm: thick / 2.0,
        };
        let thin = sizes.wall - THINNER_MM;
        let flat = |sign: f64| {
            let middle = guide.point + n * (sign * (sizes.outer - sizes.wall / 2.0));
            plate(middle, side, sizes.outer - sizes.wall / 2.0, sizes.wall, 0.0)
        };
        let upright = |sign: f64| {
            let middle = guide.point + side * (sign * (sizes.inner + thin / 2.0));
            plate(middle, n, sizes.outer - sizes.wall, thin, 2.0 * THINNER_MM)
        };
        [flat(1.0), flat(-1.0), upright(1.0), upright(-1.0)]
    }

    /// Whether a bar of this body would stand in the way of one of its own sliders.
    pub(super) fn in_guide(&self, bar: &Slot, in_space: bool) -> bool {
        let sizes = self.guide_sizes();
        let Some(body) = self.input.bodies.get(self.index) else { return false };
        body.guides.iter().any(|g| {
            let (low, high) = g.travel_mm;
            if g.sleeve {
                // The way of the bar through the sleeve.
                let (first, last) = self.bar_ends(g, in_space);
                let (start, end) =
                    (g.point + g.direction * (first + low), g.point + g.direction * (last + high));
                let room = Slot::bar(start, end, g.normal, sizes.inner, sizes.inner, EDGE_MM);
                return separation(bar, &room).gap_mm < 0.0;
            }
            // The way of the sleeve along the bar.
            let room = self.sleeve(g, -sizes.half - high, sizes.half - low);
            room.iter().any(|plate| separation(bar, plate).gap_mm < self.input.clearance_mm)
        })
    }
}
