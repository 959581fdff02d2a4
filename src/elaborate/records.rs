//! Materials, processes and motors: records whose fields have fixed names and dimensions.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Outcome};
use super::load::item_kind;
use super::scope::{Key, State};
use super::units::GRAMS_PER_TONNE;
use super::value::{ItemRef, Value};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::{Machine, Material, Motor, MotorInterface, MotorMotion, Process};
use crate::syntax::ast::{Ident, Item, Record};

/// Servo pulses are shorter than a frame of 20 ms by far.
const LONGEST_PULSE_S: f64 = 10e-3;

/// What a field holds.
#[derive(Clone, Copy, PartialEq)]
enum Holds {
    Quantity(Dimension),
    Text,
}

struct Field {
    name: &'static str,
    holds: Holds,
    required: bool,
}

const fn field(name: &'static str, dimension: Dimension, required: bool) -> Field {
    Field { name, holds: Holds::Quantity(dimension), required }
}

const MATERIAL: &[Field] = &[
    field("E", Dimension::STRESS, true),
    field("nu", Dimension::NUMBER, true),
    field("density", Dimension::DENSITY, false),
    field("strength", Dimension::STRESS, false),
    field("yield", Dimension::STRESS, false),
    field("strain_once", Dimension::NUMBER, false),
    field("strain_repeated", Dimension::NUMBER, false),
];

const PROCESS: &[Field] = &[
    field("least_wall", Dimension::LENGTH, true),
    field("clearance", Dimension::LENGTH, true),
    field("layer", Dimension::LENGTH, false),
    field("line", Dimension::LENGTH, false),
    field("across", Dimension::NUMBER, false),
    field("overhang", Dimension::ANGLE, false),
    field("bed_width", Dimension::LENGTH, false),
    field("bed_depth", Dimension::LENGTH, false),
    field("bed_height", Dimension::LENGTH, false),
];

const MOTOR: &[Field] = &[
    Field { name: "interface", holds: Holds::Text, required: true },
    field("stall", Dimension::TORQUE, true),
    field("steps_per_turn", Dimension::NUMBER, false),
    field("microsteps", Dimension::NUMBER, false),
    field("range", Dimension::ANGLE, false),
    field("shaft", Dimension::LENGTH, false),
    field("speed", Dimension::SPEED, false),
    field("acceleration", Dimension::ACCELERATION, false),
    field("resolution", Dimension::ANGLE, false),
    field("least_pulse", Dimension::TIME, false),
    field("most_pulse", Dimension::TIME, false),
    field("body_length", Dimension::LENGTH, false),
    field("body_width", Dimension::LENGTH, false),
    field("body_height", Dimension::LENGTH, false),
    field("body_end", Dimension::LENGTH, false),
    field("screw", Dimension::LENGTH, false),
    field("screw_pitch", Dimension::LENGTH, false),
    field("screw_across", Dimension::LENGTH, false),
    field("pilot", Dimension::LENGTH, false),
    field("pilot_height", Dimension::LENGTH, false),
    field("spline", Dimension::LENGTH, false),
    field("horn", Dimension::LENGTH, false),
    field("horn_screws", Dimension::NUMBER, false),
    field("horn_circle", Dimension::LENGTH, false),
    field("horn_screw", Dimension::LENGTH, false),
];

fn fields_of(kind: &str) -> Option<&'static [Field]> {
    match kind {
        "material" => Some(MATERIAL),
        "process" => Some(PROCESS),
        "motor" => Some(MOTOR),
        _ => None,
    }
}

impl<'a> Evaluator<'a> {
    fn record(&self, item: ItemRef) -> Option<&'a Record> {
        match self.program.item(item)? {
            Item::Record(r) => Some(r),
            _ => None,
        }
    }

    /// `record.field`
    pub(super) fn record_field(&mut self, item: ItemRef, name: &Ident) -> Outcome<Value> {
        let Some(record) = self.record(item) else { return Err(super::eval::Failed) };
        let kind = record.kind.node.as_str();
        if let Some(index) = record.fields.iter().position(|(n, _)| n.node == name.node) {
            return self.force_field(item, index, name.at);
        }
        let known = fields_of(kind).unwrap_or_default();
        let owner = &record.name.node;
        let d = if known.iter().any(|f| f.name == name.node) {
            let stated: Vec<&str> = record.fields.iter().map(|(n, _)| n.node.as_str()).collect();
            Diagnostic::error(
                codes::UNKNOWN_FIELD,
                format!("`{owner}` does not state `{}`", name.node),
                name.at,
            )
            .also(record.name.at, format!("this {kind} states {}", stated.join(", ")))
        } else {
            let d = Diagnostic::error(
                codes::UNKNOWN_FIELD,
                format!("a {kind} has no field `{}`", name.node),
                name.at,
            );
            match super::names::suggestion(&name.node, known.iter().map(|f| f.name)) {
                Some(near) => super::lookup::meant(d, name, &near),
                None => {
                    d.help(format!("it has {}", known.iter().map(|f| f.name).collect::<Vec<_>>().join(", ")))
                }
            }
        };
        self.fail(d)
    }

    fn force_field(&mut self, item: ItemRef, index: usize, asked_at: Origin) -> Outcome<Value> {
        let Some(record) = self.record(item) else { return Err(super::eval::Failed) };
        let Some((name, value)) = record.fields.get(index) else { return Err(super::eval::Failed) };
        let slot = (item.0, item.1, index);
        let key = Key::Field(item.0, item.1, index);
        let shown = format!("{}.{}", record.name.node, name.node);
        match self.fields.get(&slot) {
            Some(State::Done(v)) => return Ok(v.clone()),
            Some(State::Failed) => return Err(super::eval::Failed),
            Some(State::Busy) => return self.circle(key, &shown, asked_at),
            Some(State::Waiting) | None => {}
        }
        self.fields.insert(slot, State::Busy);
        self.busy.push((key, shown, asked_at));
        let result = self.unscaled(|s| s.field_value(item.0, record, name, value));
        self.busy.pop();
        let state = result.as_ref().map_or(State::Failed, |v| State::Done(v.clone()));
        self.fields.insert(slot, state);
        result
    }

    fn field_value(
        &mut self,
        module: usize,
        record: &'a Record,
        name: &'a Ident,
        value: &'a crate::syntax::ast::Expr,
    ) -> Outcome<Value> {
        let scope = self.scope(module);
        let v = self.eval(&Env::fixed(scope), value)?;
        let known = fields_of(&record.kind.node).unwrap_or_default().iter().find(|f| f.name == name.node);
        match known.map(|f| f.holds) {
            Some(Holds::Quantity(dim)) => {
                self.scalar(v.clone(), value, dim, &format!("`{}`", name.node))?;
            }
            Some(Holds::Text) if !matches!(v, Value::Text(_)) => {
                return self.fail(Diagnostic::error(
                    codes::TYPE,
                    format!("`{}` must be text in quotes, this is {}", name.node, v.a()),
                    value.at,
                ));
            }
            _ => {}
        }
        Ok(v)
    }

    /// Checks that a record has the fields it needs and no others; evaluates all.
    pub(super) fn check_record(&mut self, item: ItemRef) -> Outcome<&'a Record> {
        let Some(record) = self.record(item) else { return Err(super::eval::Failed) };
        let known = fields_of(&record.kind.node).unwrap_or_default();
        self.limit(record.fields.len(), "fields", record.name.at)?;
        let mut ok = true;
        for (i, (name, _)) in record.fields.iter().enumerate() {
            if record.fields.iter().take(i).any(|(n, _)| n.node == name.node) {
                self.out.push(
                    Diagnostic::error(codes::DUPLICATE, format!("`{}` is given twice", name.node), name.at)
                        .label("again here"),
                );
                ok = false;
            }
            if !known.iter().any(|f| f.name == name.node) {
                let d = Diagnostic::error(
                    codes::RECORD,
                    format!("a {} has no field `{}`", record.kind.node, name.node),
                    name.at,
                );
                let near = super::names::suggestion(&name.node, known.iter().map(|f| f.name));
                self.out.push(match near {
                    Some(n) => super::lookup::meant(d, name, &n),
                    None => d.help(format!(
                        "it has {}",
                        known.iter().map(|f| f.name).collect::<Vec<_>>().join(", ")
                    )),
                });
                ok = false;
            }
            ok &= self.force_field(item, i, name.at).is_ok();
        }
        for f in known.iter().filter(|f| f.required) {
            if !record.fields.iter().any(|(n, _)| n.node == f.name) {
                self.out.push(
                    Diagnostic::error(
                        codes::RECORD,
                        format!("{} `{}` lacks `{}`", record.kind.node, record.name.node, f.name),
                        record.name.at,
                    )
                    .help(match f.holds {
                        Holds::Quantity(d) => {
                            format!("add `{} = …`, {}", f.name, super::value::with_article(&d.to_string()))
                        }
                        Holds::Text => format!("add `{} = \"…\"`", f.name),
                    }),
                );
                ok = false;
            }
        }
        if ok { Ok(record) } else { Err(super::eval::Failed) }
    }

    /// A numeric field, in internal units; none if not stated.
    fn number_field(&mut self, item: ItemRef, name: &str) -> Outcome<Option<f64>> {
        let Some(record) = self.record(item) else { return Err(super::eval::Failed) };
        let Some(i) = record.fields.iter().position(|(n, _)| n.node == name) else { return Ok(None) };
        match self.force_field(item, i, record.at)? {
            Value::Scalar(s) => Ok(self.exprs.as_constant(s.id)),
            _ => Ok(None),
        }
    }

    /// A numeric field that must be positive; none if not stated.
    pub(super) fn positive_field(&mut self, item: ItemRef, name: &str) -> Outcome<Option<f64>> {
        let v = self.number_field(item, name)?;
        if let (Some(x), Some(record)) = (v, self.record(item))
            && x <= 0.0
            && let Some((_, e)) = record.fields.iter().find(|(n, _)| n.node == name)
        {
            return self.fail(Diagnostic::error(codes::SIZE, format!("`{name}` must be positive"), e.at));
        }
        Ok(v)
    }

    /// The record a name stands for, of the kind wanted.
    pub(super) fn record_named(&mut self, module: usize, name: &Ident, kind: &str) -> Outcome<ItemRef> {
        let scope = self.scope(module);
        let Some(item) = self.top_level(module, name) else { return self.unknown_item(scope, name, kind) };
        match self.program.item(item) {
            Some(Item::Record(r)) if r.kind.node == kind => Ok(item),
            Some(other) => {
                let is = item_kind(other).to_string();
                self.wrong_kind(name, &is, &super::value::with_article(kind))
            }
            None => Err(super::eval::Failed),
        }
    }

    pub(super) fn material(&mut self, item: ItemRef) -> Outcome<Material> {
        let record = self.check_record(item)?;
        let nu = self.number_field(item, "nu")?.unwrap_or_default();
        if !(0.0..0.5).contains(&nu)
            && let Some((_, e)) = record.fields.iter().find(|(n, _)| n.node == "nu")
        {
            return self.fail(Diagnostic::error(
                codes::RECORD,
                "Poisson's ratio must lie from 0 to below 0.5",
                e.at,
            ));
        }
        Ok(Material {
            name: record.name.node.clone(),
            e_mpa: self.positive_field(item, "E")?.unwrap_or_default(),
            nu,
            density_g_mm3: self.positive_field(item, "density")?.map(|d| d * GRAMS_PER_TONNE),
            strength_mpa: self.positive_field(item, "strength")?,
            yield_mpa: self.positive_field(item, "yield")?,
            strain_once: self.positive_field(item, "strain_once")?,
            strain_repeated: self.positive_field(item, "strain_repeated")?,
        })
    }

    pub(super) fn process(&mut self, item: ItemRef) -> Outcome<Process> {
        let record = self.check_record(item)?;
        let bed = ["bed_width", "bed_depth", "bed_height"].map(|side| self.positive_field(item, side));
        let bed_mm = match bed {
            [Ok(Some(x)), Ok(Some(y)), Ok(Some(z))] => Some([x, y, z]),
            [Ok(None), Ok(None), Ok(None)] => None,
            sides => {
                if sides.iter().all(Result::is_ok) {
                    let message = format!("process `{}` states a bed in part", record.name.node);
                    self.out.push(
                        Diagnostic::error(codes::RECORD, message, record.name.at)
                            .help("state `bed_width`, `bed_depth` and `bed_height`, or none of them"),
                    );
                }
                return Err(super::eval::Failed);
            }
        };
        let machine = Machine {
            layer_mm: self.positive_field(item, "layer")?,
            line_mm: self.positive_field(item, "line")?,
            across: self.positive_field(item, "across")?,
            overhang_rad: self.positive_field(item, "overhang")?,
            bed_mm,
        };
        Ok(Process {
            name: record.name.node.clone(),
            least_wall_mm: self.positive_field(item, "least_wall")?.unwrap_or_default(),
            clearance_mm: self.positive_field(item, "clearance")?.unwrap_or_default(),
            machine,
        })
    }

    pub(super) fn motor(&mut self, item: ItemRef) -> Outcome<Motor> {
        let record = self.check_record(item)?;
        let text = record.fields.iter().position(|(n, _)| n.node == "interface");
        let interface = match text.map(|i| self.force_field(item, i, record.at)) {
            Some(Ok(Value::Text(t))) => t,
            _ => return Err(super::eval::Failed),
        };
        let interface = match interface.as_str() {
            "stepper" => MotorInterface::Stepper {
                steps_per_turn: self.whole_field(item, "steps_per_turn", "a stepper")?,
                microsteps: self.whole_field(item, "microsteps", "a stepper")?,
            },
            "pwm" => MotorInterface::Pwm { range_rad: self.needed_field(item, "range", "a servo")? },
            "dynamixel" => {
                MotorInterface::Dynamixel { range_rad: self.needed_field(item, "range", "a servo")? }
            }
            other => {
                let d =
                    Diagnostic::error(codes::RECORD, format!("unknown interface `{other}`"), record.name.at)
                        .help("interfaces are \"stepper\", \"pwm\", \"dynamixel\"");
                return self.fail(d);
            }
        };
        Ok(Motor {
            name: record.name.node.clone(),
            interface,
            stall_n_mm: self.positive_field(item, "stall")?.unwrap_or_default(),
            shaft_diameter_mm: self.positive_field(item, "shaft")?,
            motion: self.motor_motion(item)?,
        })
    }

    fn motor_motion(&mut self, item: ItemRef) -> Outcome<MotorMotion> {
        let pulses = [self.positive_field(item, "least_pulse")?, self.positive_field(item, "most_pulse")?];
        let pulses_s = match pulses {
            [Some(least), Some(most)] if least < most && most < LONGEST_PULSE_S => Some([least, most]),
            [None, None] => None,
            _ => {
                let at = self.record(item).map(|r| r.name.at).unwrap_or_default();
                let message = "`least_pulse` and `most_pulse` are the widths at both ends of the range";
                return self.fail(
                    Diagnostic::error(codes::RECORD, message, at)
                        .help("state both, the lesser first, or none: such as 0.5 ms and 2.4 ms"),
                );
            }
        };
        Ok(MotorMotion {
            speed_rad_s: self.positive_field(item, "speed")?,
            acceleration_rad_s2: self.positive_field(item, "acceleration")?,
            resolution_rad: self.positive_field(item, "resolution")?,
            pulses_s,
        })
    }

    fn needed_field(&mut self, item: ItemRef, name: &str, what: &str) -> Outcome<f64> {
        if let Some(v) = self.positive_field(item, name)? {
            return Ok(v);
        }
        let at = self.record(item).map(|r| r.name.at).unwrap_or_default();
        self.fail(Diagnostic::error(codes::RECORD, format!("{what} needs `{name}`"), at))
    }

    pub(super) fn whole_field(&mut self, item: ItemRef, name: &str, what: &str) -> Outcome<u32> {
        let v = self.needed_field(item, name, what)?;
        if v.fract() != 0.0 || v > 1e6 {
            let at = self.record(item).map(|r| r.name.at).unwrap_or_default();
            return self.fail(Diagnostic::error(
                codes::COUNT,
                format!("`{name}` must be a whole number"),
                at,
            ));
        }
        Ok(v as u32)
    }
}
