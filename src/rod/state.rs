//! The state of a rod and how increments move it: vertices translate, frames are carried by parallel
//! transport and then turned, clamped edges follow their links. Frames are stored, never angles, so the
//! energy has no memory of the way taken (Bergou et al. 2010, time-parallel frames).

use super::Rod;
use super::shear::FREEDOMS;
use super::stencil::EdgeFrame;
use crate::math::Pose;
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;
use std::fmt;

/// Present shape of a rod with N edges.
#[derive(Clone, Debug, PartialEq)]
pub struct RodState {
    /// N + 1 vertices, mm; the first two and last two follow the links.
    pub vertices: Vec<Vector3<f64>>,
    /// N unit vectors m₁ normal to their edge; m₂ = t × m₁.
    pub m1: Vec<Vector3<f64>>,
    /// With shear, the sum of all shear displacements, mm: the vertices leave them out, and those of link
    /// B lie this much short of the link.
    pub slip: Vector3<f64>,
    /// With shear, the force link B exerts on the rod, N.
    pub force: Vector3<f64>,
}

/// Why an increment was refused: it must be cut. The state is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RetractError {
    /// The direction or frame of this edge would turn by π/2 or more, or the edge vanish.
    EdgeTurn {
        /// The edge.
        edge: usize,
    },
    /// The twist at this vertex would reach π/2, beyond which the principal angle is no longer sure.
    VertexTwist {
        /// The vertex.
        vertex: usize,
    },
    /// The increment has the wrong length.
    Length,
}

impl fmt::Display for RetractError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EdgeTurn { edge } => write!(f, "edge {edge} would turn by more than a right angle"),
            Self::VertexTwist { vertex } => {
                write!(f, "the twist at vertex {vertex} would exceed a right angle")
            }
            Self::Length => write!(f, "the increment does not have one entry per internal freedom"),
        }
    }
}

impl std::error::Error for RetractError {}

/// Minimal rotation taking unit `from` to unit `to`, applied to `v`; not defined for opposite directions.
pub(crate) fn parallel_transport(v: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let axis = from.cross(to);
    v + axis.cross(v) + axis.cross(&axis.cross(v)) / (1.0 + from.dot(to))
}

impl Rod {
    /// Writes the clamped vertices and frames of both ends from the links' poses, and carries the frames
    /// of the first and last free edge along with their change of direction. The inner vertices stay: for
    /// small steps prefer [`Self::retract`], which also checks.
    pub fn set_clamps(&self, state: &mut RodState, pose_a: &Pose, pose_b: &Pose) {
        let ends = [1, self.edges - 2];
        let direction = |s: &RodState, j: usize| (s.vertices[j + 1] - s.vertices[j]).normalize();
        let old = ends.map(|j| direction(state, j));
        self.write_clamps(state, pose_a, pose_b);
        for (j, old) in ends.into_iter().zip(old) {
            let t = direction(state, j);
            let carried = parallel_transport(&state.m1[j], &old, &t);
            state.m1[j] = (carried - t * carried.dot(&t)).normalize();
        }
    }

    fn write_clamps(&self, state: &mut RodState, pose_a: &Pose, pose_b: &Pose) {
        let n = self.edges;
        let pose_b = self.chain_pose(state, pose_b);
        for (edge, pose) in [(0, pose_a), (n - 1, &pose_b)] {
            for k in [edge, edge + 1] {
                state.vertices[k] = pose.point(&self.rest.vertices[k]);
            }
            state.m1[edge] = pose.direction(&self.rest.m1[edge]);
        }
    }

    /// The frame of edge `j` after an increment.
    fn moved(&self, state: &RodState, increment: &[f64], poses: [&Pose; 2], j: usize) -> Option<EdgeFrame> {
        let n = self.edges;
        let vertex = |k: usize| match k {
            0 | 1 => poses[0].point(&self.rest.vertices[k]),
            k if k >= n - 1 => poses[1].point(&self.rest.vertices[k]),
            k => state.vertices[k] + Vector3::from_column_slice(&increment[4 * k - 7..4 * k - 4]),
        };
        let e = vertex(j + 1) - vertex(j);
        let l = e.norm();
        let t = e / l;
        let m1 = if j == 0 || j == n - 1 {
            poses[usize::from(j > 0)].direction(&self.rest.m1[j])
        } else {
            let old = (state.vertices[j + 1] - state.vertices[j]).normalize();
            let theta = increment[4 * j - 4];
            let safe = old.dot(&t) > 0.0 && theta.abs() < FRAC_PI_2;
            if !safe {
                return None;
            }
            let carried = parallel_transport(&state.m1[j], &old, &t);
            let turned = carried * theta.cos() + t.cross(&carried) * theta.sin();
            (turned - t * turned.dot(&t)).normalize()
        };
        Some(EdgeFrame { t, m1, m2: t.cross(&m1), l })
    }

    /// Applies an increment of the internal freedoms (θ₁, x₂, θ₂, …) and the links' new poses. The state may
    /// be one of a rod with the same number of edges and neighbouring parameters: predictions along
    /// parameters go this way too.
    ///
    /// # Errors
    /// When an edge or its frame would turn by π/2 or more, or a vertex reach a twist of π/2; the state
    /// is then unchanged and the step is to be cut.
    pub fn retract(
        &self,
        state: &mut RodState,
        increment: &[f64],
        pose_a: &Pose,
        pose_b: &Pose,
    ) -> Result<(), RetractError> {
        if increment.len() != self.internal_freedoms() {
            return Err(RetractError::Length);
        }
        let mut chain_b = self.chain_pose(state, pose_b);
        let (mut slip, mut force) = (state.slip, state.force);
        if let Some(extra) = increment.get(self.band_freedoms()..).filter(|x| x.len() == FREEDOMS) {
            let change = Vector3::from_column_slice(&extra[..3]);
            chain_b.translation -= change;
            slip += change;
            force += Vector3::from_column_slice(&extra[3..]);
            if !slip.iter().chain(force.iter()).all(|x| x.is_finite()) {
                return Err(RetractError::EdgeTurn { edge: self.edges - 1 });
            }
        }
        let poses = [pose_a, &chain_b];
        let mut previous: Option<EdgeFrame> = None;
        let mut m1 = Vec::with_capacity(self.edges);
        for j in 0..self.edges {
            let frame = self.moved(state, increment, poses, j).ok_or(RetractError::EdgeTurn { edge: j })?;
            if let Some(p) = &previous {
                let chi = 1.0 + p.t.dot(&frame.t);
                let cosine = p.m1.dot(&frame.m1) + p.m2.dot(&frame.m2);
                if chi.is_nan() || chi <= 0.0 {
                    return Err(RetractError::EdgeTurn { edge: j });
                }
                if cosine.is_nan() || cosine <= 0.0 {
                    return Err(RetractError::VertexTwist { vertex: j });
                }
            }
            m1.push(frame.m1);
            previous = Some(frame);
        }
        state.m1 = m1;
        for (x, d) in state.vertices[2..self.edges - 1].iter_mut().zip(increment[1..].chunks_exact(4)) {
            *x += Vector3::new(d[0], d[1], d[2]);
        }
        (state.slip, state.force) = (slip, force);
        self.write_clamps(state, pose_a, pose_b);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rod::derivative_tests::random_sample;

    #[test]
    fn steps_too_long_are_refused_and_leave_the_state() {
        let sample = random_sample(1, 10);
        let n = sample.rod.internal_freedoms();
        let mut state = sample.state.clone();
        let mut twist = vec![0.0; n];
        twist[8] = 1.7;
        let refused = sample.rod.retract(&mut state, &twist, &sample.a, &sample.b);
        assert_eq!(refused, Err(RetractError::EdgeTurn { edge: 3 }));
        let mut twist = vec![0.0; n];
        (twist[8], twist[12]) = (1.5, -1.5);
        let refused = sample.rod.retract(&mut state, &twist, &sample.a, &sample.b);
        assert!(matches!(refused, Err(RetractError::VertexTwist { .. })), "{refused:?}");
        let mut fold = vec![0.0; n];
        fold[1] = 100.0;
        let refused = sample.rod.retract(&mut state, &fold, &sample.a, &sample.b);
        assert!(matches!(refused, Err(RetractError::EdgeTurn { .. })), "{refused:?}");
        let mut lost = vec![0.0; n];
        lost[2] = f64::NAN;
        assert!(sample.rod.retract(&mut state, &lost, &sample.a, &sample.b).is_err());
        assert_eq!(sample.rod.retract(&mut state, &[], &sample.a, &sample.b), Err(RetractError::Length));
        assert_eq!(state, sample.state);
        assert_eq!(sample.rod.retract(&mut state, &vec![0.0; n], &sample.a, &sample.b), Ok(()));
    }

    /// Frames stay orthonormal over many steps, and transport along a closed way of edge directions on a
    /// sphere turns a frame by the enclosed angle.
    #[test]
    fn transport_keeps_frames_and_knows_holonomy() {
        let mut v = Vector3::y();
        let way = [Vector3::x(), Vector3::y(), Vector3::z(), Vector3::x()];
        for w in way.windows(2) {
            v = parallel_transport(&v, &w[0], &w[1]);
            assert!(v.dot(&w[1]).abs() < 1e-15 && (v.norm() - 1.0).abs() < 1e-15);
        }
        // An octant encloses π/2.
        assert!((v - Vector3::z()).norm() < 1e-15, "{v}");
        let sample = random_sample(4, 12);
        for (j, m) in sample.state.m1.iter().enumerate() {
            let t = (sample.state.vertices[j + 1] - sample.state.vertices[j]).normalize();
            assert!(m.dot(&t).abs() < 1e-12 && (m.norm() - 1.0).abs() < 1e-12);
        }
    }
}
