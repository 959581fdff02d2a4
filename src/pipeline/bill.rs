//! The bill of materials: what is bought for an assembly besides what is printed.

use crate::emit::plate::Bought;
use crate::geometry::parts::FLOOR_MM;
use crate::ir::assembly::HingeFitting;
use crate::ir::{Assembly, Design, HornForm, Instance, Mount, Realization};
use nalgebra::Vector3;

/// Things of two instances nearer than this are one, mm.
const SAME_MM: f64 = 1e-6;
/// What the screws of a horn go through at least, mm (`geometry/seat.rs`).
const HORN_HELD_MM: f64 = 3.0;

/// By what it is, in the order of first use: how many, and for what.
#[derive(Default)]
struct Bill(Vec<(String, usize, Vec<String>)>);

impl Bill {
    fn add(&mut self, name: String, count: usize, purpose: String) {
        match self.0.iter_mut().find(|a| a.0 == name) {
            Some((_, n, of)) => {
                *n += count;
                of.push(purpose);
            }
            None => self.0.push((name, count, vec![purpose])),
        }
    }
}

/// Motors, their horns and screws, pins and strings.
pub fn bought(assembly: &Assembly) -> Vec<Bought> {
    let mut bill = Bill::default();
    for first in &assembly.motors {
        let Some(instance) = assembly.instances.get(first.instance) else { continue };
        let drive = assembly.designs.get(instance.design).and_then(|d| d.drives.get(first.drive));
        let Some((drive, motor)) = drive.and_then(|d| Some((d, d.motor.as_ref()?))) else { continue };
        let drum = drive.drum_radius_mm.map_or(String::new(), |r| format!(", drum of {} mm", 2.0 * r));
        bill.add(format!("motor {}{drum}", motor.name), 1, instance.of(&drive.name));
    }
    // What two instances have in the same place is there once.
    let mut known: Vec<(String, Vector3<f64>)> = Vec::new();
    let mut is_new = |name: String, at: Vector3<f64>| {
        let is = |k: &(String, Vector3<f64>)| k.0 == name && (k.1 - at).norm() < SAME_MM;
        let new = !known.iter().any(is);
        known.push((name, at));
        new
    };
    for (instance, design) in assembly.placed() {
        for body in &design.bodies {
            for mount in &body.fittings.mounts {
                let at = place(instance, design, mount.position);
                if is_new(format!("mount {}", mount.motor.name), at) {
                    mounted(&mut bill, design, mount, instance.of(&body.name));
                }
            }
            for horn in &body.fittings.horns {
                let joint = design.joints.get(horn.joint);
                let at = joint.map_or_else(Vector3::zeros, |j| place(instance, design, j.point));
                if is_new(format!("horn {}", horn.form.name), at) {
                    seated(&mut bill, &horn.form, instance.of(&body.name));
                }
            }
        }
        for joint in &design.joints {
            if let Realization::Conventional { pin_diameter_mm: Some(d) } = joint.realization {
                let length = design.layers.height_mm - 2.0 * FLOOR_MM - design.process.clearance_mm;
                bill.add(format!("pin, {d} mm, cut {length:.1} mm long"), 1, instance.of(&joint.name));
            }
        }
        for string in &design.strings {
            bill.add("string".into(), 1, instance.of(&string.name));
        }
    }
    let places = assembly.places(|_| None);
    for joined in &assembly.joined {
        let first = joined.members.first().and_then(|(i, _)| assembly.instances.get(*i));
        let Some(design) = first.and_then(|i| assembly.designs.get(i.design)) else { continue };
        let hinged = joined.hinged.iter();
        let on_hinges = hinged.clone().filter_map(|h| match &h.fitting {
            HingeFitting::Mount(mount) => Some(mount),
            HingeFitting::Horn(_) => None,
        });
        for mount in joined.fittings.mounts.iter().chain(on_hinges) {
            if is_new(format!("mount {}", mount.motor.name), places.at(mount.position)) {
                mounted(&mut bill, design, mount, joined.name.clone());
            }
        }
        for (h, horn) in hinged.filter_map(|h| match &h.fitting {
            HingeFitting::Horn(horn) => Some((h.hinges.first()?, horn)),
            HingeFitting::Mount(_) => None,
        }) {
            let Some(instance) = assembly.instances.get(h.instance) else { continue };
            let Some(design) = assembly.designs.get(instance.design) else { continue };
            let Some(joint) = design.joints.get(h.joint) else { continue };
            if is_new(format!("horn {}", horn.form.name), place(instance, design, joint.point)) {
                seated(&mut bill, &horn.form, joined.name.clone());
            }
        }
    }
    let told =
        |(name, count, of): (String, usize, Vec<String>)| Bought { count, name, purpose: of.join(", ") };
    bill.0.into_iter().map(told).collect()
}

/// A point at the design's start, in its instance's place.
fn place(instance: &Instance, design: &Design, at: crate::ir::ExprPoint) -> Vector3<f64> {
    let start: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let values = design.exprs.values(&start);
    let value = |id: crate::ir::expr::ExprId| values.get(id.0 as usize).copied().unwrap_or_default();
    instance.placement.point(&Vector3::from(at.map(value)))
}

fn mounted(bill: &mut Bill, design: &Design, mount: &Mount, of: String) {
    let motor = &mount.motor;
    let Some(screws) = motor.screws else {
        let name = format!(
            "what holds {} in its pocket (rivets, a strap, glue): no screws of it are stated",
            motor.name
        );
        return bill.add(name, 1, of);
    };
    let (d, thick) = (screws.diameter_mm, mount.thickness_mm(design.layers.height_mm));
    let name = if motor.has_flanges() {
        format!("screw with nut for holes of {d} mm, longer than {thick} mm and the flange of {}", motor.name)
    } else {
        format!("screw, {d} mm, {thick} mm longer than it reaches into {}", motor.name)
    };
    bill.add(name, screws.count(), of);
}

fn seated(bill: &mut Bill, horn: &HornForm, of: String) {
    let Some(d) = horn.diameter_mm else { return };
    bill.add(format!("round horn of {}, {d} mm", horn.name), 1, of.clone());
    match horn.screws {
        Some((count, _, d)) => {
            let name = format!("screw, {d} mm, {HORN_HELD_MM} mm longer than it reaches into the horn");
            bill.add(name, count, of);
        }
        None => bill.add(format!("glue for the horn of {}: no screws of it are stated", horn.name), 1, of),
    }
}
