//! Seats of motors, of three kinds, after what is known of the motor:
//!
//! - screws within its box go into its face: a ring round the shaft, and an arm to each screw;
//! - screws beside its box go through flanges: a window for the box in a frame that carries the flanges;
//! - no screws: a frame with walls round the box, and a lip on which its face rests.
//!
//! All are put on from behind, where the box stands, and screwed from where a driver can reach.

use super::distance::separation;
use super::fitted::{FitFault, FitFaultKind, MountSolid, Pocket};
use super::link::{BAR_BELOW_MM, BORE_WALL_MM, BoreCut, Builder, FLAT, ROUND_MM, Role, SPREAD_MM, spread};
use super::parts::BodySolid;
use super::slot::Slot;
use crate::ir::MotorScrews;
use nalgebra::Vector3;

/// How far cuts go beyond faces, mm.
const BEYOND_MM: f64 = 0.5;
/// How far a frame reaches into what is then cut out of it, mm.
const OVERLAP_MM: f64 = 0.3;
/// The lip on which a motor without screws rests: how far it reaches under the box, mm.
const LIP_MM: f64 = 1.5;
/// Diameter of a screw's head, or of its nut over the corners, and room round it, as a part of the screw's.
pub(super) const HEAD: f64 = 2.4;
/// Width of the ring round an opening, in walls: what is less leaves slits beside the arms.
const RING: f64 = 1.5;
/// Room that a screw and its driver need over the seat, mm.
const DRIVER_MM: f64 = 60.0;
/// Radius of the edges of a motor's box as what moves sees it, mm.
const EDGE_MM: f64 = 0.3;
/// Widest bar of which such a box is made, mm: a corner is missed by 0.4 of its half.
const TILE_MM: f64 = 2.0;

/// A seat in its own coordinates: x along the box, z along the shaft from the face behind.
struct Frame {
    origin: Vector3<f64>,
    axes: [Vector3<f64>; 3],
}

impl Frame {
    fn at(&self, x: f64, y: f64, z: f64) -> Vector3<f64> {
        self.origin + self.axes[0] * x + self.axes[1] * y + self.axes[2] * z
    }

    fn pocket(&self, [x0, x1]: [f64; 2], y: f64, [z0, z1]: [f64; 2]) -> Pocket {
        Pocket {
            center: self.at((x0 + x1) / 2.0, 0.0, (z0 + z1) / 2.0),
            edges: self.axes,
            half_mm: [(x1 - x0) / 2.0, y, (z1 - z0) / 2.0],
        }
    }
}

/// Heights above the face behind, mm.
#[derive(Clone, Copy)]
struct Heights {
    /// Of the seat.
    seat: f64,
    /// Of all that the body has there.
    all: f64,
}

impl Builder<'_> {
    /// Adds the seat of a motor; where the rest of the body is to be joined to it.
    pub(super) fn add_mount(&mut self, m: &MountSolid, layered: bool) -> Vector3<f64> {
        let flat = layered && m.axis.cross(&self.axis()).norm() < FLAT;
        let room = 2.0 * self.half();
        let wanted = m.thick_mm;
        let (origin, heights) = if flat {
            let level = self.at_level(&m.point, self.level);
            (level - m.axis * self.half(), Heights { seat: wanted.min(room), all: room })
        } else {
            // Behind what the motor turns, whose eye fills the joint's layer.
            let off = if m.bears { self.half() + self.input.clearance_mm } else { 0.0 };
            (m.point - m.axis * (off + wanted), Heights { seat: wanted, all: wanted })
        };
        let frame = Frame { origin, axes: [m.forward, m.axis.cross(&m.forward), m.axis] };
        let first = self.plan.slots.len();
        let out = match m.motor.screws {
            Some(screws) if m.motor.has_flanges() => self.flanges(m, &frame, heights, screws),
            Some(screws) => self.face(m, &frame, heights, screws),
            None => self.walls(m, &frame, heights),
        };
        debug_assert!(self.plan.slots.len() > first);
        let middle = if flat { heights.all } else { heights.seat } / 2.0;
        out + m.axis * middle
    }

    fn wall(&self) -> f64 {
        BORE_WALL_MM.max(self.input.least_wall_mm)
    }

    /// A bar of the seat; like faces are kept apart.
    fn seat_bar(&mut self, frame: &Frame, from: [f64; 2], to: [f64; 2], radius: f64, height: f64) {
        let less = SPREAD_MM * spread(self.plan.slots.len());
        let [start, end] = [from, to].map(|[x, y]| frame.at(x, y, height / 2.0));
        let slot = Slot::bar(start, end, frame.axes[2], radius - less, height / 2.0 - less / 2.0, ROUND_MM);
        self.push(Role::Mount, slot);
    }

    fn screw_holes(&mut self, m: &MountSolid, frame: &Frame, heights: Heights, screws: MotorScrews) {
        for [x, y] in places(m, &screws) {
            let bore = |from: f64, to: f64, diameter_mm: f64| BoreCut {
                joint: None,
                start: frame.at(x, y, from),
                end: frame.at(x, y, to),
                diameter_mm,
            };
            let hole = screws.diameter_mm + m.clearance_mm;
            self.plan.bores.push(bore(-BEYOND_MM, heights.seat + BEYOND_MM, hole));
            if heights.all > heights.seat + BAR_BELOW_MM {
                // Heads, or nuts, sit on the seat.
                let head = HEAD * screws.diameter_mm + m.clearance_mm;
                self.plan.bores.push(bore(heights.seat, heights.all + BEYOND_MM, head));
            }
        }
    }

    fn fault_of_wall(&mut self, m: &MountSolid, wall_mm: f64, at: Vector3<f64>) {
        if wall_mm < self.input.least_wall_mm - 1e-9 {
            let (motor, kind) = (m.motor.name.clone(), FitFaultKind::Wall(wall_mm));
            self.plan.faults.push(FitFault { motor, kind, at, origin: m.origin });
        }
    }

    /// A window for the box, flanges behind the frame round it.
    fn flanges(
        &mut self,
        m: &MountSolid,
        frame: &Frame,
        heights: Heights,
        screws: MotorScrews,
    ) -> Vector3<f64> {
        let (wall, hole) = (self.wall(), screws.diameter_mm + m.clearance_mm);
        let [length, width, height] = m.motor.size_mm;
        let beside = (screws.pitch_mm - length) / 2.0 - m.clearance_mm;
        let reach = [beside + hole / 2.0 + wall, wall.max(screws.diameter_mm)];
        let window = self.frame(m, frame, heights.seat, reach, OVERLAP_MM);
        for at in places(m, &screws) {
            self.seat_bar(frame, at, at, hole / 2.0 + wall, heights.seat);
        }
        self.plan.pockets.push(frame.pocket(window.x, window.y, [-BEYOND_MM, heights.all + BEYOND_MM]));
        self.screw_holes(m, frame, heights, screws);
        self.fault_of_wall(m, beside - hole / 2.0, frame.at(window.x[1], 0.0, 0.0));
        self.carry(m, frame, [-height, 0.0], [length, width]);
        window.joined(frame, &m.rest, reach)
    }

    /// Walls round the box, and a lip before it.
    fn walls(&mut self, m: &MountSolid, frame: &Frame, heights: Heights) -> Vector3<f64> {
        let wall = self.wall();
        let [length, width, height] = m.motor.size_mm;
        let lip = wall.min(heights.seat / 2.0);
        let window = self.frame(m, frame, heights.seat, [wall; 2], LIP_MM + m.clearance_mm + OVERLAP_MM);
        let top = heights.seat - lip;
        self.plan.pockets.push(frame.pocket(window.x, window.y, [-BEYOND_MM, top]));
        let inner = LIP_MM + m.clearance_mm;
        let (x, y) = ([window.x[0] + inner, window.x[1] - inner], window.y - inner);
        self.plan.pockets.push(frame.pocket(x, y, [top - BEYOND_MM, heights.all + BEYOND_MM]));
        self.carry(m, frame, [top - height, top], [length, width]);
        window.joined(frame, &m.rest, [wall; 2])
    }

    /// Four bars round the box, reaching out by `reach` at its ends and its sides and inwards by `inwards`.
    fn frame(&mut self, m: &MountSolid, frame: &Frame, height: f64, reach: [f64; 2], inwards: f64) -> Window {
        let ([length, width, _], c) = (m.motor.size_mm, m.clearance_mm);
        let x = [-m.motor.end_mm - c, length - m.motor.end_mm + c];
        let y = width / 2.0 + c;
        let radius = reach.map(|r| (r + inwards) / 2.0);
        let out = reach.map(|r| (r - inwards) / 2.0);
        for (x, sign) in [(x[0], -1.0), (x[1], 1.0)] {
            let x = x + sign * out[0];
            // As far as the sides reach, less its own round ends.
            let y = (y + reach[1] - radius[0]).max(0.0);
            self.seat_bar(frame, [x, -y], [x, y], radius[0], height);
        }
        for sign in [-1.0, 1.0] {
            let y = sign * (y + out[1]);
            let more = reach[0] - radius[1].min(reach[0]);
            self.seat_bar(frame, [x[0] - more, y], [x[1] + more, y], radius[1], height);
        }
        Window { x, y }
    }

    /// A ring round the shaft, and an arm to each screw.
    fn face(&mut self, m: &MountSolid, frame: &Frame, heights: Heights, screws: MotorScrews) -> Vector3<f64> {
        let (wall, hole) = (self.wall(), screws.diameter_mm + m.clearance_mm);
        let opening = m.motor.pilot_mm.map(|(d, depth)| (d + 2.0 * m.clearance_mm, depth));
        let ring = opening.map_or(self.boss_radius(), |(d, _)| d / 2.0 + RING * wall);
        self.seat_bar(frame, [0.0; 2], [0.0; 2], ring, heights.seat);
        let all = places(m, &screws);
        for at in &all {
            self.seat_bar(frame, [0.0; 2], *at, hole / 2.0 + wall, heights.seat);
        }
        if let [_, _, _, _] = all[..] {
            for k in 0..4 {
                self.seat_bar(frame, all[k], all[(k + 1) % 4], hole / 2.0 + wall, heights.seat);
            }
        }
        let head = HEAD * screws.diameter_mm / 2.0;
        for [x, y] in &all {
            let [start, end] = [heights.all, heights.all + DRIVER_MM].map(|z| frame.at(*x, *y, z));
            let way =
                Slot::bar((start + end) / 2.0, (start + end) / 2.0, m.axis, head, DRIVER_MM / 2.0, EDGE_MM);
            self.plan.access.push((way, m.motor.name.clone(), m.origin));
        }
        if let Some((diameter_mm, depth)) = opening {
            // What stands out goes into the seat where that leaves a floor, else the seat is open.
            let deep =
                depth.map(|d| d + m.clearance_mm).filter(|d| d + self.input.least_wall_mm <= heights.seat);
            let end = frame.at(0.0, 0.0, deep.unwrap_or(heights.all + BEYOND_MM));
            let start = frame.at(0.0, 0.0, -BEYOND_MM);
            self.plan.bores.push(BoreCut { joint: None, start, end, diameter_mm });
            for [x, y] in &all {
                let left = x.hypot(*y) - diameter_mm / 2.0 - hole / 2.0;
                self.fault_of_wall(m, left, frame.at(*x, *y, 0.0));
            }
        }
        self.screw_holes(m, frame, heights, screws);
        let [length, width, height] = m.motor.size_mm;
        self.carry(m, frame, [-height, 0.0], [length, width]);
        if m.passes {
            return frame.origin;
        }
        let away = m.rest - m.point;
        let away = away - m.axis * away.dot(&m.axis);
        frame.origin + away.try_normalize(1e-9).unwrap_or(m.forward) * ring
    }

    /// The box of the motor, as what moves sees it.
    fn carry(&mut self, m: &MountSolid, frame: &Frame, z: [f64; 2], [length, width]: [f64; 2]) {
        let count = (width / TILE_MM).ceil().max(1.0);
        let radius = width / count / 2.0;
        let middle = (z[0] + z[1]) / 2.0;
        for k in 0..count as usize {
            let y = (2 * k + 1) as f64 * radius - width / 2.0;
            let [start, end] = [radius - m.motor.end_mm, length - m.motor.end_mm - radius];
            let [start, end] = [start, end.max(start)].map(|x| frame.at(x, y, middle));
            let half = (z[1] - z[0]) / 2.0;
            self.plan.carried.push(Slot::bar(start, end, frame.axes[2], radius, half, EDGE_MM));
        }
    }

    /// Whether a motor stands where its own body holds something else.
    pub(super) fn check_mounts(&mut self, body: &BodySolid) {
        let kept = |role: &Role| matches!(role, Role::Stub(_) | Role::Eye(_) | Role::Riser | Role::Guide(_));
        let own: Vec<Slot> = self.plan.slots.iter().filter(|(r, _)| kept(r)).map(|(_, s)| *s).collect();
        let mut from = 0;
        for m in &body.mounts {
            let count = (m.motor.size_mm[1] / TILE_MM).ceil().max(1.0) as usize;
            let box_of = self.plan.carried.get(from..from + count).unwrap_or_default();
            from += count;
            let met = box_of.iter().flat_map(|b| own.iter().map(move |s| separation(b, s)));
            if let Some(met) = met.filter(|s| s.gap_mm < 0.0).min_by(|a, b| a.gap_mm.total_cmp(&b.gap_mm)) {
                let (motor, kind) = (m.motor.name.clone(), FitFaultKind::InTheWay);
                self.plan.faults.push(FitFault { motor, kind, at: met.at, origin: m.origin });
            }
        }
    }
}

/// Where a box goes through: ends, and half its width, mm.
struct Window {
    x: [f64; 2],
    y: f64,
}

impl Window {
    /// The middle of that edge of the frame that is nearest to the rest of the body.
    fn joined(&self, frame: &Frame, rest: &Vector3<f64>, reach: [f64; 2]) -> Vector3<f64> {
        let middle = (self.x[0] + self.x[1]) / 2.0;
        let y = self.y + reach[1];
        let edges = [[self.x[0] - reach[0], 0.0], [self.x[1] + reach[0], 0.0], [middle, -y], [middle, y]];
        let edges = edges.map(|[x, y]| frame.at(x, y, 0.0));
        let off = |p: &Vector3<f64>| (p - rest).norm();
        edges.into_iter().min_by(|p, q| off(p).total_cmp(&off(q))).unwrap_or(frame.origin)
    }
}

/// Where the screws of a motor are.
fn places(m: &MountSolid, screws: &MotorScrews) -> Vec<[f64; 2]> {
    let middle = m.motor.size_mm[0] / 2.0 - m.motor.end_mm;
    let x = [middle - screws.pitch_mm / 2.0, middle + screws.pitch_mm / 2.0];
    if screws.across_mm > 0.0 {
        let y = screws.across_mm / 2.0;
        vec![[x[0], -y], [x[1], -y], [x[1], y], [x[0], y]]
    } else {
        x.map(|x| [x, 0.0]).to_vec()
    }
}
