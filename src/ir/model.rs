//! By which theory flexures are computed.

use serde::{Deserialize, Serialize};

/// Theory of the rods (`docs/rod-model.md`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RodModel {
    /// Stretch, bending and St Venant torsion (Megaro et al. 2017).
    Plain,
    /// With what a slender rod leaves out.
    #[default]
    Corrected,
}

impl RodModel {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Plain, Self::Corrected];

    /// Its word in the language.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Corrected => "corrected",
        }
    }

    /// Whether nothing need be written.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}
