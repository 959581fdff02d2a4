//! What a material bears once, and again and again, against the strain of a flexure: as it must be at the least before
//! anything is solved, and as it is in the solution.

use super::Rule;
use super::shapes::Flexure;
use super::views::{OfFlexures, OfSolution};
use super::walk::{joint_of, worst_of_joints};
use crate::diagnostic::Diagnostic;
use crate::ir::{Joint, Material};

/// A strain that a material bears once, or again and again: what is told of it at either stage.
#[derive(Clone, Copy)]
pub enum Bears {
    /// Once.
    Once,
    /// Again and again; beyond what it bears once, that alone is told.
    Repeatedly,
}

impl Bears {
    /// The material's limit, where it is stated, if a strain is beyond it.
    fn exceeded(self, material: &Material, strain: f64) -> Option<f64> {
        let once = material.strain_once;
        let (limit, most) = match self {
            Self::Once => (once?, f64::INFINITY),
            Self::Repeatedly => (material.strain_repeated?, once.unwrap_or(f64::INFINITY)),
        };
        (strain > limit && strain <= most).then_some(limit)
    }

    fn told(self) -> &'static str {
        match self {
            Self::Once => "once",
            Self::Repeatedly => "again and again",
        }
    }

    /// Joints whose flexures are strained beyond it at the least, by their turn, length and least thickness.
    pub fn at_the_least(self, rule: &Rule, view: &OfFlexures) -> Vec<Diagnostic> {
        let material = &view.of.design.material;
        let strain =
            |f: &Flexure| f.even_strain(f.least_thick_mm).filter(|e| self.exceeded(material, *e).is_some());
        let finding =
            |(joint, f): (&Joint, &Flexure)| {
                let strain = strain(f)?;
                let message = format!(
                    "`{}` is strained by {:.2} % at the least; `{}` bears {:.2} % {}",
                    joint.name,
                    100.0 * strain,
                    material.name,
                    100.0 * self.exceeded(material, strain)?,
                    self.told()
                );
                Some(rule.finds(message, joint.origin).help(
                    "make the flexure thinner or longer, turn less, or take a material that bears more",
                ))
            };
        worst_of_joints(view, strain).into_iter().filter_map(finding).collect()
    }

    /// Whether the largest strain of the solution is beyond it; `help` is told the limit as a stress, MPa.
    pub fn solved(self, rule: &Rule, view: &OfSolution, help: impl Fn(f64) -> String) -> Vec<Diagnostic> {
        let (design, material) = (view.of.design, &view.of.design.material);
        let Some((stress, place)) = &view.simulation.worst.stress else { return Vec::new() };
        let strain = stress / material.e_mpa;
        let Some(limit) = self.exceeded(material, strain) else { return Vec::new() };
        let message = format!(
            "the largest strain is {:.2} % {}; `{}` bears {:.2} % {}",
            100.0 * strain,
            place.told(),
            material.name,
            100.0 * limit,
            self.told()
        );
        let at = joint_of(design, place).unwrap_or(design.origin);
        vec![rule.finds(message, at).help(help(limit * material.e_mpa))]
    }
}
