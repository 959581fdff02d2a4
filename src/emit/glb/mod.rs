//! glTF 2.0 in one binary file: the mechanism moves through its cycle, in metres, with the design's own axes (x right, y
//! up, z towards the viewer).
//!
//! Rigid bodies are nodes that are translated and turned. A flexure is a skin: one joint a station of the rod, and every
//! vertex belongs to one, because a section of a rod stays plane and keeps its shape. So the file holds what was solved,
//! exactly, in 28 bytes a station and state; morph targets would hold every vertex of every state instead. Vertex colours
//! are the largest stress of the cycle. The conventional mechanism is a translucent ghost, traces are lines.

mod buffer;
mod look;

use super::normals::shaded;
use super::scene::{Frame, Ghost, Link, Ribbon, Scene};
use crate::geometry::{Facets, Mesh, Slot};
use buffer::{Bytes, Use, direction, metres};
use gltf_json::animation::{Channel, Interpolation, Property, Sampler, Target};
use gltf_json::mesh::{Mode, Primitive, Semantic};
use gltf_json::scene::UnitQuaternion;
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Accessor, Animation, Index, Node, Root, Skin};
use look::Looks;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion as Turn, Vector3};
use std::collections::BTreeMap;

/// A binary glTF file is a header, then chunks with their length and kind.
const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;

/// The bytes of a `.glb` file: same scene, same bytes.
///
/// # Errors
/// What the serialiser says.
pub fn glb_bytes(scene: &Scene) -> serde_json::Result<Vec<u8>> {
    let mut file = File::new(scene);
    let links: Vec<Index<Node>> = scene.links.iter().map(|l| file.link(l)).collect();
    let ribbons: Vec<Index<Node>> = scene.ribbons.iter().map(|r| file.ribbon(scene, r)).collect();
    let ghosts: Vec<Index<Node>> = scene.ghosts.iter().map(|g| file.ghost(g)).collect();
    let mut lines = Vec::new();
    for trace in &scene.traces {
        lines.extend(file.line(&format!("{} (trace)", trace.name), &trace.path, Looks::TRACE));
        lines.extend(file.line(&format!("{} (target)", trace.name), &trace.target, Looks::TARGET));
    }
    file.group("links", links);
    file.group("conventional mechanism", ghosts);
    file.group("traces", lines);
    // The nodes of skinned meshes stay at the top: their joints place them.
    file.top.extend(ribbons);
    file.finish(scene)
}

struct File {
    root: Root,
    bytes: Bytes,
    times: Option<Index<Accessor>>,
    samplers: Vec<Sampler>,
    channels: Vec<Channel>,
    top: Vec<Index<Node>>,
}

impl File {
    fn new(scene: &Scene) -> Self {
        let (mut root, mut bytes) = (Root::default(), Bytes::default());
        root.asset.generator = Some(concat!("flexura ", env!("CARGO_PKG_VERSION")).into());
        root.materials = look::materials(scene);
        // A single state is a pose, not a motion.
        let times: Vec<[f32; 1]> = scene.times_s.iter().map(|t| [*t as f32]).collect();
        let times = (times.len() > 1).then(|| bytes.add(&mut root, &times, (Use::Other, false), true));
        Self { root, bytes, times, samplers: Vec::new(), channels: Vec::new(), top: Vec::new() }
    }

    fn link(&mut self, link: &Link) -> Index<Node> {
        let mesh = self.solid(&link.name, &link.mesh, &link.center, Looks::link(link.part));
        self.moving(&link.name, mesh, &link.center, &link.states)
    }

    fn ghost(&mut self, ghost: &Ghost) -> Index<Node> {
        let name = format!("{} (conventional)", ghost.name);
        let mut mesh = Mesh::default();
        for [a, b] in &ghost.bars {
            mesh.append(
                &Slot::capsule(*a, *b, ghost.radius_mm)
                    .mesh(&Facets { around: 12, ..Facets::default() }, 0.0),
            );
        }
        let mesh = self.solid(&name, &mesh, &ghost.center, Looks::GHOST);
        self.moving(&name, mesh, &ghost.center, &ghost.states)
    }

    /// A mesh about a centre; none where there is nothing to see.
    fn solid(
        &mut self,
        name: &str,
        mesh: &Mesh,
        center: &Vector3<f64>,
        look: u32,
    ) -> Option<Index<gltf_json::Mesh>> {
        let seen = shaded(mesh);
        if seen.triangles.is_empty() {
            return None;
        }
        let positions: Vec<[f32; 3]> = seen.positions.iter().map(|p| metres(&(p - center))).collect();
        let normals: Vec<[f32; 3]> = seen.normals.iter().map(direction).collect();
        let attributes = [
            (Semantic::Positions, self.vertices(&positions, true)),
            (Semantic::Normals, self.vertices(&normals, false)),
        ];
        Some(self.mesh(name, attributes.into(), Some(&seen.triangles), look))
    }

    fn ribbon(&mut self, scene: &Scene, ribbon: &Ribbon) -> Index<Node> {
        let surface = ribbon.surface();
        let at = |k: usize| ribbon.rest.get(k);
        let placed = |(local, station): (&Vector3<f64>, &usize)| {
            metres(&at(*station).map_or(*local, |f| f.point(local)))
        };
        let turned =
            |(n, station): (&Vector3<f64>, &usize)| direction(&at(*station).map_or(*n, |f| f.rotation * n));
        let positions: Vec<[f32; 3]> = surface.local.iter().zip(&surface.stations).map(placed).collect();
        let normals: Vec<[f32; 3]> = surface.normals.iter().zip(&surface.stations).map(turned).collect();
        // Rods have tens of stations; the format counts joints of a skin in bytes.
        let joint = |k: &usize| [u8::try_from(*k).unwrap_or(u8::MAX), 0, 0, 0];
        let joints: Vec<[u8; 4]> = surface.stations.iter().map(joint).collect();
        let weights = vec![[u8::MAX, 0, 0, 0]; surface.stations.len()];
        let colours: Vec<[u8; 4]> =
            surface.stresses_mpa.iter().map(|s| look::colour_bytes(scene.colour(*s))).collect();
        let attributes = [
            (Semantic::Positions, self.vertices(&positions, true)),
            (Semantic::Normals, self.vertices(&normals, false)),
            (Semantic::Colors(0), self.bytes.add(&mut self.root, &colours, (Use::Vertices, true), false)),
            (Semantic::Joints(0), self.bytes.add(&mut self.root, &joints, (Use::Vertices, false), false)),
            (Semantic::Weights(0), self.bytes.add(&mut self.root, &weights, (Use::Vertices, true), false)),
        ];
        let mesh = self.mesh(&ribbon.name, attributes.into(), Some(&surface.triangles), Looks::FLEXURE);
        let stations: Vec<Index<Node>> = (0..ribbon.rest.len())
            .map(|k| {
                let states = ribbon.states.iter().filter_map(|s| s.get(k).copied()).collect::<Vec<Frame>>();
                let node = self.root.push(placed_node(None, None, states.first().or(at(k))));
                self.animate(node, &states);
                node
            })
            .collect();
        let inverse: Vec<[f32; 16]> = ribbon.rest.iter().map(inverse_matrix).collect();
        let inverse = self.bytes.add(&mut self.root, &inverse, (Use::Other, false), false);
        let holder = Node {
            children: Some(stations.clone()),
            name: Some(format!("{} (stations)", ribbon.name)),
            ..empty()
        };
        let holder = self.root.push(holder);
        self.top.push(holder);
        let skin = self.root.push(Skin {
            inverse_bind_matrices: Some(inverse),
            joints: stations,
            name: None,
            skeleton: Some(holder),
            extensions: None,
            extras: Default::default(),
        });
        self.root.push(Node {
            mesh: Some(mesh),
            skin: Some(skin),
            name: Some(ribbon.name.clone()),
            ..empty()
        })
    }

    fn line(&mut self, name: &str, points: &[Vector3<f64>], look: u32) -> Option<Index<Node>> {
        let mut line: Vec<[f32; 3]> = points.iter().map(metres).collect();
        line.dedup();
        if line.len() < 2 {
            return None;
        }
        let positions = self.vertices(&line, true);
        let mesh = self.mesh(name, [(Semantic::Positions, positions)].into(), None, look);
        Some(self.root.push(Node { mesh: Some(mesh), name: Some(name.into()), ..empty() }))
    }

    fn vertices(&mut self, items: &[[f32; 3]], bounded: bool) -> Index<Accessor> {
        self.bytes.add(&mut self.root, items, (Use::Vertices, false), bounded)
    }

    fn mesh(
        &mut self,
        name: &str,
        attributes: Vec<(Semantic, Index<Accessor>)>,
        triangles: Option<&[[usize; 3]]>,
        look: u32,
    ) -> Index<gltf_json::Mesh> {
        let attributes: BTreeMap<_, _> =
            attributes.into_iter().map(|(s, a)| (Checked::Valid(s), a)).collect();
        let indices = triangles.map(|t| {
            let flat: Vec<[u32; 1]> = t.iter().flatten().map(|i| [*i as u32]).collect();
            self.bytes.add(&mut self.root, &flat, (Use::Indices, false), false)
        });
        let mode = if indices.is_some() { Mode::Triangles } else { Mode::LineStrip };
        self.root.push(gltf_json::Mesh {
            primitives: vec![Primitive {
                attributes,
                indices,
                material: Some(Index::new(look)),
                mode: Checked::Valid(mode),
                targets: None,
                extensions: None,
                extras: Default::default(),
            }],
            weights: None,
            name: Some(name.into()),
            extensions: None,
            extras: Default::default(),
        })
    }

    /// A node that follows the states of a body described about its centre.
    fn moving(
        &mut self,
        name: &str,
        mesh: Option<Index<gltf_json::Mesh>>,
        center: &Vector3<f64>,
        states: &[Frame],
    ) -> Index<Node> {
        let rest = Frame { origin: *center, rotation: Matrix3::identity() };
        let node = self.root.push(placed_node(Some(name), mesh, states.first().or(Some(&rest))));
        self.animate(node, states);
        node
    }

    /// Key frames of a node, where it moves.
    fn animate(&mut self, node: Index<Node>, states: &[Frame]) {
        let Some(times) = self.times else { return };
        let places: Vec<[f32; 3]> = states.iter().map(|f| metres(&f.origin)).collect();
        let mut turns: Vec<[f32; 4]> = Vec::with_capacity(states.len());
        for frame in states {
            let q = quaternion(&frame.rotation);
            // q and −q are one rotation: the next key is the nearer of the two.
            let turned =
                turns.last().is_some_and(|p| p.iter().zip(&q).map(|(a, b)| a * b).sum::<f32>() < 0.0);
            turns.push(if turned { q.map(|x| 0.0 - x) } else { q });
        }
        if places.windows(2).any(|w| w[0] != w[1]) {
            let output = self.bytes.add(&mut self.root, &places, (Use::Other, false), false);
            self.channel(node, times, output, Property::Translation);
        }
        if turns.windows(2).any(|w| w[0] != w[1]) {
            let output = self.bytes.add(&mut self.root, &turns, (Use::Other, false), false);
            self.channel(node, times, output, Property::Rotation);
        }
    }

    fn channel(
        &mut self,
        node: Index<Node>,
        input: Index<Accessor>,
        output: Index<Accessor>,
        path: Property,
    ) {
        self.samplers.push(Sampler {
            input,
            interpolation: Checked::Valid(Interpolation::Linear),
            output,
            extensions: None,
            extras: Default::default(),
        });
        self.channels.push(Channel {
            sampler: Index::new((self.samplers.len() - 1) as u32),
            target: Target { node, path: Checked::Valid(path), extensions: None, extras: Default::default() },
            extensions: None,
            extras: Default::default(),
        });
    }

    fn group(&mut self, name: &str, children: Vec<Index<Node>>) {
        if !children.is_empty() {
            let node = Node { children: Some(children), name: Some(name.into()), ..empty() };
            let node = self.root.push(node);
            self.top.push(node);
        }
    }

    fn finish(mut self, scene: &Scene) -> serde_json::Result<Vec<u8>> {
        if !self.channels.is_empty() {
            self.root.push(Animation {
                channels: self.channels,
                samplers: self.samplers,
                name: Some("cycle".into()),
                extensions: None,
                extras: Default::default(),
            });
        }
        let shown = self.root.push(gltf_json::Scene {
            nodes: self.top,
            name: Some(scene.name.clone()),
            extensions: None,
            extras: Default::default(),
        });
        self.root.scene = Some(shown);
        while !self.bytes.0.len().is_multiple_of(4) {
            self.bytes.0.push(0);
        }
        if !self.bytes.0.is_empty() {
            self.root.push(gltf_json::Buffer {
                byte_length: USize64::from(self.bytes.0.len()),
                name: None,
                uri: None,
                extensions: None,
                extras: Default::default(),
            });
        }
        let mut json = self.root.to_vec()?;
        while !json.len().is_multiple_of(4) {
            json.push(b' ');
        }
        Ok(packed(&json, &self.bytes.0))
    }
}

/// The two chunks behind their header.
fn packed(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let chunks: Vec<(&[u8; 4], &[u8])> =
        [(b"JSON", json), (b"BIN\0", binary)].into_iter().filter(|(_, c)| !c.is_empty()).collect();
    let total = 12 + chunks.iter().map(|(_, c)| 8 + c.len()).sum::<usize>();
    let mut out = Vec::with_capacity(total);
    out.extend(MAGIC);
    out.extend(VERSION.to_le_bytes());
    out.extend((total as u32).to_le_bytes());
    for (kind, chunk) in chunks {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}

fn empty() -> Node {
    Node {
        camera: None,
        children: None,
        extensions: None,
        extras: Default::default(),
        matrix: None,
        mesh: None,
        name: None,
        rotation: None,
        scale: None,
        translation: None,
        skin: None,
        weights: None,
    }
}

fn placed_node(name: Option<&str>, mesh: Option<Index<gltf_json::Mesh>>, at: Option<&Frame>) -> Node {
    Node {
        name: name.map(Into::into),
        mesh,
        translation: at.map(|f| metres(&f.origin)),
        rotation: at.map(|f| UnitQuaternion(quaternion(&f.rotation))),
        ..empty()
    }
}

/// x, y, z, w of unit length in single precision.
fn quaternion(rotation: &Matrix3<f64>) -> [f32; 4] {
    let q = Turn::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*rotation));
    [q.i, q.j, q.k, q.w].map(|x| x as f32 + 0.0)
}

/// From the rest pose into the frame, by columns, in metres.
fn inverse_matrix(frame: &Frame) -> [f32; 16] {
    let r = frame.rotation.transpose();
    let t = -(r * frame.origin);
    let column = |c: usize| [r[(0, c)], r[(1, c)], r[(2, c)], 0.0].map(|x| x as f32 + 0.0);
    let [x, y, z] = metres(&t);
    let mut out = [0.0; 16];
    let columns = [column(0), column(1), column(2), [x, y, z, 1.0]];
    out.iter_mut().zip(columns.iter().flatten()).for_each(|(to, from)| *to = *from);
    out
}
