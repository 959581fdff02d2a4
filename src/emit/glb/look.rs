//! What things look like: materials by number, and the colours of stress.

use crate::emit::scene::Scene;
use gltf_json::material::{
    AlphaMode, EmissiveFactor, Material, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor,
};
use gltf_json::validation::Checked;

/// Printed parts in turn, sRGB.
const PARTS: [[f64; 3]; 5] =
    [[0.78, 0.80, 0.83], [0.62, 0.70, 0.80], [0.80, 0.74, 0.62], [0.66, 0.76, 0.68], [0.76, 0.66, 0.72]];
const GHOST: [f64; 3] = [0.35, 0.35, 0.40];
const GHOST_ALPHA: f32 = 0.45;
const TRACE: [f64; 3] = [0.85, 0.20, 0.15];
const TARGET: [f64; 3] = [0.15, 0.35, 0.85];

/// Numbers of the materials.
pub struct Looks;

impl Looks {
    pub const FLEXURE: u32 = 0;
    pub const GHOST: u32 = 1;
    pub const TRACE: u32 = 2;
    pub const TARGET: u32 = 3;

    /// That of a printed part.
    pub fn link(part: usize) -> u32 {
        4 + (part % PARTS.len()) as u32
    }
}

/// All of them, in the order of their numbers.
pub fn materials(scene: &Scene) -> Vec<Material> {
    let plain = |name: &str, colour: [f64; 3]| matte(name, colour.map(linear), 1.0);
    let lit = |name: &str, colour: [f64; 3]| Material {
        emissive_factor: EmissiveFactor(colour.map(|c| linear(c) as f32)),
        ..matte(name, [0.0; 3], 1.0)
    };
    let flexure = Material {
        // Their roots are open, inside the links.
        double_sided: true,
        ..matte(
            &format!("flexure: red is {:.0} MPa, at any time of the cycle", scene.full_stress_mpa),
            [1.0; 3],
            1.0,
        )
    };
    let ghost = Material {
        alpha_mode: Checked::Valid(AlphaMode::Blend),
        ..matte("conventional mechanism", GHOST.map(linear), GHOST_ALPHA)
    };
    let mut all = vec![flexure, ghost, lit("trace", TRACE), lit("target", TARGET)];
    all.extend(PARTS.iter().enumerate().map(|(k, c)| plain(&format!("part {}", k + 1), *c)));
    all
}

fn matte(name: &str, colour: [f64; 3], alpha: f32) -> Material {
    let [r, g, b] = colour.map(|c| c as f32);
    Material {
        name: Some(name.into()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, alpha]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.7),
            ..Default::default()
        },
        ..Default::default()
    }
}

/// The linear value of an sRGB component.
fn linear(c: f64) -> f64 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Colour of a stress (MPa) as the format wants vertex colours: linear, in bytes.
pub fn colour_bytes(colour: [f64; 3]) -> [u8; 4] {
    let [r, g, b] = colour.map(|c| (linear(c) * 255.0).round() as u8);
    [r, g, b, u8::MAX]
}
