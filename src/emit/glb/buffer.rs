//! The binary chunk and the accessors into it. Little-endian, every view on a multiple of four bytes.

use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Stride, Target, View};
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Accessor, Index, Root, Value};
use nalgebra::Vector3;

/// The binary chunk while it grows.
#[derive(Debug, Default)]
pub struct Bytes(pub Vec<u8>);

/// One value an item, in the components' own type.
pub trait Component: Copy + PartialOrd + Into<f64> {
    /// Its type in the file.
    const TYPE: ComponentType;
    /// Appends its bytes.
    fn put(self, out: &mut Vec<u8>);
}

impl Component for f32 {
    const TYPE: ComponentType = ComponentType::F32;
    fn put(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }
}

impl Component for u32 {
    const TYPE: ComponentType = ComponentType::U32;
    fn put(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }
}

impl Component for u8 {
    const TYPE: ComponentType = ComponentType::U8;
    fn put(self, out: &mut Vec<u8>) {
        out.push(self);
    }
}

/// What a view is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// Vertex attributes.
    Vertices,
    /// Indices of triangles.
    Indices,
    /// Key frames, matrices.
    Other,
}

impl Bytes {
    /// Appends items of `N` components as a view with an accessor; `bounded` states least and largest values.
    pub fn add<T: Component, const N: usize>(
        &mut self,
        root: &mut Root,
        items: &[[T; N]],
        kind: (Use, bool),
        bounded: bool,
    ) -> Index<Accessor> {
        let (target, normalized) = kind;
        while !self.0.len().is_multiple_of(4) {
            self.0.push(0);
        }
        let offset = self.0.len();
        items.iter().flatten().for_each(|x| x.put(&mut self.0));
        let view = root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(self.0.len() - offset),
            byte_offset: Some(USize64::from(offset)),
            byte_stride: (target == Use::Vertices).then(|| Stride(N * T::TYPE.size())),
            name: None,
            target: match target {
                Use::Vertices => Some(Checked::Valid(Target::ArrayBuffer)),
                Use::Indices => Some(Checked::Valid(Target::ElementArrayBuffer)),
                Use::Other => None,
            },
            extensions: None,
            extras: Default::default(),
        });
        let bound = |pick: fn(f64, f64) -> f64| {
            let start: Option<[f64; N]> = items.first().map(|first| first.map(Into::into));
            let least = start.map(|start| {
                items.iter().fold(start, |m, item| std::array::from_fn(|k| pick(m[k], item[k].into())))
            });
            // What is stated must be the stored values themselves: shortest decimals of the single precision read back.
            least.filter(|_| bounded).map(|m| Value::from(m.map(|x| x as f32).to_vec()))
        };
        root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(items.len()),
            component_type: Checked::Valid(GenericComponentType(T::TYPE)),
            type_: Checked::Valid(match N {
                1 => Type::Scalar,
                3 => Type::Vec3,
                4 => Type::Vec4,
                _ => Type::Mat4,
            }),
            min: bound(f64::min),
            max: bound(f64::max),
            name: None,
            normalized,
            sparse: None,
            extensions: None,
            extras: Default::default(),
        })
    }
}

/// mm to metres, as the format wants.
pub fn metres(p: &Vector3<f64>) -> [f32; 3] {
    [p.x, p.y, p.z].map(|x| (x * 1e-3) as f32 + 0.0)
}

/// A direction in single precision.
pub fn direction(n: &Vector3<f64>) -> [f32; 3] {
    [n.x, n.y, n.z].map(|x| x as f32 + 0.0)
}
