//! What the ends and sizes of a link's slots follow when the design parameters change (paper, section 3.3: link
//! geometry adapts to the flexures). Which nodes are joined, and how, is taken as it is at the point.

use super::skeleton::median_derivative;
use crate::equilibrium::ModelRod;
use crate::kinematics::Twist;
use nalgebra::{Matrix3, Matrix3xX, RowDVector, Vector3};

/// What a point of a link follows, in the rest pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Anchor {
    /// No flexure: what the conventional mechanism's body has drawn there, or else carries there.
    #[default]
    Fixed,
    /// As another point of the body that follows no flexure: a fixed way from it.
    Beside(Vector3<f64>),
    /// The end of a flexure: a fixed way from its attachment, along its outward tangent laid into the plane
    /// normal to the stacking axis.
    Stub {
        /// The end.
        end: FlexureEnd,
        /// The way, mm.
        along_mm: f64,
        /// How the way follows the end.
        along: SizeBy,
        /// How the height along the stacking axis follows the end.
        level: SizeBy,
    },
    /// The geometric median of nodes.
    Hub {
        /// The nodes with what they follow.
        nodes: Vec<(Vector3<f64>, Anchor)>,
        /// Where it lies.
        at: Vector3<f64>,
    },
    /// A fixed way from the first node towards the second.
    Toward {
        /// The nodes with what they follow.
        nodes: Box<[(Vector3<f64>, Anchor); 2]>,
        /// The way, mm.
        along_mm: f64,
    },
    /// Half-way between two others.
    Middle(Box<[Anchor; 2]>),
}

/// An end of a flexure as a body built in layers sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlexureEnd {
    /// Index of the flexure.
    pub flexure: usize,
    /// The second of its ends.
    pub at_end: bool,
    /// Unit axis of the body's layers.
    pub axis: Vector3<f64>,
}

/// Derivatives of a length by what a flexure's end has: the height of its attachment along the stacking axis and
/// its half widths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SizeBy {
    /// By the height of the attachment.
    pub level: f64,
    /// By the half width along m₁.
    pub a: f64,
    /// By the half width along m₂.
    pub b: f64,
}

/// What a slot follows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Follow {
    /// Its start and its end.
    pub ends: [Anchor; 2],
    /// The end its sizes follow; none: they are fixed.
    pub sized_by: Option<FlexureEnd>,
    /// Its outer radius.
    pub radius: SizeBy,
    /// Its outer half height.
    pub half_height: SizeBy,
    /// The end whose wide direction its axis is; none: the axis is fixed in the body.
    pub upright: Option<FlexureEnd>,
}

impl Follow {
    /// Both ends follow the same, sizes are fixed.
    pub fn point(anchor: &Anchor) -> Self {
        Self::bar([anchor.clone(), anchor.clone()])
    }

    /// Two ends, fixed sizes.
    pub fn bar(ends: [Anchor; 2]) -> Self {
        Self { ends, ..Self::default() }
    }
}

/// A point of a body's drawing, with its derivative.
#[derive(Clone, Debug)]
pub struct DrawnPoint {
    /// In the rest pose, mm.
    pub at: Vector3<f64>,
    /// By the n design parameters, 3 × n.
    pub by: Matrix3xX<f64>,
}

/// Derivatives of what anchors of one body follow by the n design parameters.
pub struct Followed<'m> {
    /// The rods, in the order of the flexures.
    pub rods: &'m [ModelRod],
    /// How the rest pose moves what the body carries, per free variable that moves it.
    pub carried: Vec<(usize, Twist)>,
    /// Points and joints of the body, as far as free variables move its drawing or rest pose.
    pub drawn: Vec<DrawnPoint>,
    /// Axis of the body's layers, along which what is drawn at another height is meant.
    pub axis: Option<Vector3<f64>>,
    /// Number of design parameters.
    pub parameters: usize,
}

/// Drawn points nearer than this in plan are the same, mm.
const SAME_MM: f64 = 1e-6;

impl Followed<'_> {
    /// Derivative of a point that follows no flexure, 3 × n.
    fn fixed(&self, at: &Vector3<f64>) -> Matrix3xX<f64> {
        let flat = |d: Vector3<f64>| self.axis.map_or(d, |axis| d - axis * d.dot(&axis));
        if let Some(point) = self.drawn.iter().find(|q| flat(q.at - at).norm() < SAME_MM) {
            return point.by.clone();
        }
        let mut by = Matrix3xX::zeros(self.parameters);
        for (parameter, twist) in &self.carried {
            by.set_column(*parameter, &twist.at(at));
        }
        by
    }

    /// Derivative of a point, 3 × n; `at` is the point.
    pub fn point(&self, anchor: &Anchor, at: &Vector3<f64>) -> Matrix3xX<f64> {
        match anchor {
            Anchor::Fixed => self.fixed(at),
            Anchor::Beside(point) => self.fixed(point),
            Anchor::Stub { end, along_mm, along, level } => self.stub(end, *along_mm, along, level),
            Anchor::Hub { nodes, at } => {
                let points: Vec<Vector3<f64>> = nodes.iter().map(|n| n.0).collect();
                let mut sum = Matrix3xX::zeros(self.parameters);
                for ((point, anchor), by) in nodes.iter().zip(median_derivative(&points, at)) {
                    if *anchor != Anchor::Fixed || !self.drawn.is_empty() {
                        sum += by * self.point(anchor, point);
                    }
                }
                sum
            }
            Anchor::Toward { nodes, along_mm } => {
                let [(p, from), (q, to)] = nodes.as_ref();
                let (d, (from, to)) = (q - p, (self.point(from, p), self.point(to, q)));
                let length = d.norm();
                if length <= 0.0 {
                    return from;
                }
                let u = d / length;
                let turn = (Matrix3::identity() - u * u.transpose()) * (*along_mm / length);
                &from + turn * (to - &from)
            }
            Anchor::Middle(pair) => (self.point(&pair[0], at) + self.point(&pair[1], at)) * 0.5,
        }
    }

    fn stub(&self, end: &FlexureEnd, along_mm: f64, along: &SizeBy, level: &SizeBy) -> Matrix3xX<f64> {
        let FlexureEnd { flexure, at_end, axis } = *end;
        let Some(rod) = self.rods.get(flexure) else { return Matrix3xX::zeros(self.parameters) };
        let q = rod.rod.parameters();
        // Outward is back along the curve at its first end.
        let outward = if at_end { q.derivative_b } else { -q.derivative_a };
        let sign = if at_end { 1.0 } else { -1.0 };
        let flatten = Matrix3::identity() - axis * axis.transpose();
        let (row, flat) = (if at_end { 6 } else { 0 }, flatten * outward);
        let length = flat.norm().max(f64::MIN_POSITIVE);
        let u = flat / length;
        let turn = (Matrix3::identity() - u * u.transpose()) * flatten * (sign * along_mm / length);
        let mut out = flatten * rod.dq_dp.rows(row, 3) + turn * rod.dq_dp.rows(row + 3, 3);
        out += u * self.size(end, along) + axis * self.size(end, level);
        Matrix3xX::from_columns(
            &out.column_iter().map(|c| Vector3::new(c[0], c[1], c[2])).collect::<Vec<_>>(),
        )
    }

    /// Derivative of the wide direction at an end, 3 × n: of the joint's axis laid normal to the tangent there.
    pub fn wide(&self, end: &FlexureEnd) -> Matrix3xX<f64> {
        let Some(rod) = self.rods.get(end.flexure) else { return Matrix3xX::zeros(self.parameters) };
        let q = rod.rod.parameters();
        let (derivative, row) = if end.at_end { (q.derivative_b, 9) } else { (q.derivative_a, 3) };
        let length = derivative.norm().max(f64::MIN_POSITIVE);
        let t = derivative / length;
        let across = q.axis - t * q.axis.dot(&t);
        let size = across.norm().max(f64::MIN_POSITIVE);
        let m = across / size;
        let unit = |u: &Vector3<f64>, size: f64| (Matrix3::identity() - u * u.transpose()) / size;
        let by_tangent = -(t * q.axis.transpose() + Matrix3::identity() * q.axis.dot(&t)) * unit(&t, length);
        let by_axis = Matrix3::identity() - t * t.transpose();
        let rows = |first: usize| {
            let d = rod.dq_dp.rows(first, 3);
            Matrix3xX::from_fn(self.parameters, |r, c| d[(r, c)])
        };
        unit(&m, size) * (by_tangent * rows(row) + by_axis * rows(12))
    }

    /// Derivative of a length, 1 × n.
    pub fn size(&self, end: &FlexureEnd, by: &SizeBy) -> RowDVector<f64> {
        let Some(rod) = self.rods.get(end.flexure).filter(|_| *by != SizeBy::default()) else {
            return RowDVector::zeros(self.parameters);
        };
        let row = if end.at_end { 6 } else { 0 };
        let level = end.axis.transpose() * rod.dq_dp.rows(row, 3);
        let [a, b] = if end.at_end { [17, 18] } else { [15, 16] };
        let size = level * by.level + rod.dq_dp.row(a) * by.a + rod.dq_dp.row(b) * by.b;
        RowDVector::from_iterator(self.parameters, size.iter().copied())
    }
}
