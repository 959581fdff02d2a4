//! Series over the cycle beside traces and loads: nearest distances, traced directions, angles of bodies.

use super::measure::aggregate;
use super::report::or_nan;
use crate::equilibrium::{Cycle, Equilibrium, Layout, LayoutTrace, angle_between};
use crate::ir::{Aggregate, Design};
use crate::kinematics::Motion;
use crate::math::{nearest_turn, twist_about};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One value a state in every list.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AimSeries {
    /// Distance of each trace from the nearest place of its target, mm; empty where nothing asks for it.
    pub closest_mm: Vec<Vec<f64>>,
    /// Angle of each traced direction from its target, rad; empty for a conventional motion.
    pub aim_errors_rad: Vec<Vec<f64>>,
    /// Each traced direction.
    pub directions: Vec<Vec<[f64; 3]>>,
    /// Each angle that is asked for, from the drawing pose and unwrapped, rad.
    pub angles_rad: Vec<Vec<f64>>,
}

impl AimSeries {
    /// Of the conventional mechanism.
    pub fn conventional(design: &Design, motion: &Motion) -> Self {
        let direction = |d: &crate::ir::Direction| {
            let drawn = Vector3::from(d.direction);
            motion.states.iter().map(|s| s.poses[d.body].direction(&drawn).into()).collect()
        };
        let angle = |i: usize| motion.states.iter().filter_map(|s| s.angles_rad.get(i).copied()).collect();
        Self {
            directions: design.aims.directions.iter().map(direction).collect(),
            angles_rad: (0..design.aims.angles.len()).map(angle).collect(),
            ..Self::default()
        }
    }

    /// Of the compliant mechanism. Its angles are those within half a turn of the conventional ones.
    pub fn compliant(design: &Design, layout: &Layout, motion: &Motion, cycle: &Cycle) -> Self {
        let closest = |(i, t): (usize, &LayoutTrace)| {
            if !design.asks_for_nearest(i) {
                return Vec::new();
            }
            let distance = |e: &Equilibrium| {
                let z = e.state.poses[t.body].point(&t.rest);
                (z - t.nearest(&z).place).norm()
            };
            cycle.states.iter().map(distance).collect()
        };
        let mut out =
            Self { closest_mm: layout.traces.iter().enumerate().map(closest).collect(), ..Self::default() };
        for d in &layout.directions {
            let present: Vec<Vector3<f64>> =
                cycle.states.iter().map(|e| e.state.poses[d.body].direction(&d.rest)).collect();
            out.aim_errors_rad
                .push(present.iter().zip(&d.target).map(|(d, t)| angle_between(d, t)).collect());
            out.directions.push(present.into_iter().map(Into::into).collect());
        }
        for (i, asked) in design.aims.angles.iter().enumerate() {
            let at_rest = layout.rest_poses[asked.body].rotation;
            let angle = |(e, conventional): (&Equilibrium, &crate::kinematics::State)| {
                let turned = e.state.poses[asked.body].rotation * at_rest;
                let near = conventional.angles_rad.get(i).copied().unwrap_or(0.0);
                nearest_turn(twist_about(&turned, &Vector3::from(asked.axis)), near)
            };
            out.angles_rad.push(cycle.states.iter().zip(&motion.states).map(angle).collect());
        }
        out
    }

    /// Columns of `simulate`: traced directions, and the angles that are an `output`.
    pub fn columns(&self, design: &Design) -> Vec<(String, Vec<f64>)> {
        let mut out = Vec::new();
        for (d, series) in design.aims.directions.iter().zip(&self.directions) {
            for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
                let column = series.iter().map(|v| v[axis]).collect();
                out.push((format!("direction.{}.{letter}", d.name), column));
            }
        }
        for (angle, series) in design.aims.angles.iter().zip(&self.angles_rad) {
            if let Some(name) = &angle.name {
                out.push((format!("output.{name}_deg"), series.iter().map(|v| v.to_degrees()).collect()));
            }
        }
        out
    }

    /// Measures of the traced directions.
    pub fn measure_directions(&self, design: &Design, closed: bool) -> BTreeMap<String, DirectionMeasures> {
        let one = |series: &Vec<f64>| {
            let degrees = |how| aggregate(series, how, closed).map_or(f64::NAN, f64::to_degrees);
            DirectionMeasures {
                mean_error_deg: degrees(Aggregate::Mean),
                max_error_deg: degrees(Aggregate::Max),
            }
        };
        let names = design.aims.directions.iter().map(|d| d.name.clone());
        names.zip(self.aim_errors_rad.iter().map(one)).collect()
    }

    /// Measures of the outputs.
    pub fn measure_outputs(&self, design: &Design, closed: bool) -> BTreeMap<String, OutputMeasures> {
        let one = |series: &Vec<f64>| {
            let degrees = |how| aggregate(series, how, closed).map_or(f64::NAN, f64::to_degrees);
            OutputMeasures {
                min_deg: degrees(Aggregate::Min),
                max_deg: degrees(Aggregate::Max),
                span_deg: degrees(Aggregate::Span),
            }
        };
        let named = design.aims.angles.iter().zip(&self.angles_rad);
        named.filter_map(|(a, series)| Some((a.name.clone()?, one(series)))).collect()
    }
}

/// A traced direction against its target.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DirectionMeasures {
    /// Mean angle (a closed cycle's last state counts once), deg.
    #[serde(deserialize_with = "or_nan")]
    pub mean_error_deg: f64,
    /// Largest angle, deg.
    #[serde(deserialize_with = "or_nan")]
    pub max_error_deg: f64,
}

/// An `output` over the cycle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OutputMeasures {
    /// Least angle, deg.
    #[serde(deserialize_with = "or_nan")]
    pub min_deg: f64,
    /// Largest angle, deg.
    #[serde(deserialize_with = "or_nan")]
    pub max_deg: f64,
    /// Largest minus least, deg.
    #[serde(deserialize_with = "or_nan")]
    pub span_deg: f64,
}
