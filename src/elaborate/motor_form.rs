//! What a motor's record says of its outside: the box, its screws, its horn.

use super::codes;
use super::eval::{Evaluator, Failed, Outcome};
use super::value::ItemRef;
use crate::diagnostic::Diagnostic;
use crate::ir::{HornForm, MotorBody, MotorScrews};
use crate::syntax::ast::Ident;

/// Most screws of a horn.
const MOST_SCREWS: u32 = 16;

impl<'a> Evaluator<'a> {
    /// The outside of a motor, for its mount.
    pub(super) fn motor_body(&mut self, item: ItemRef, asked: &Ident) -> Outcome<MotorBody> {
        self.check_record(item)?;
        let [length, width, height] =
            self.all_of(item, asked, ["body_length", "body_width", "body_height"])?;
        let [end_mm] = self.all_of(item, asked, ["body_end"])?;
        if 2.0 * end_mm > length + 1e-9 {
            let help = "`body_end` is the distance from the nearer end of `body_length` to the shaft's axis";
            return self.unfit(asked, "its shaft is nearer to the other end of its box", help);
        }
        let screw = self.positive_field(item, "screw")?;
        let pitch = self.positive_field(item, "screw_pitch")?;
        let across = self.positive_field(item, "screw_across")?;
        let screws = match (screw, pitch) {
            (Some(diameter_mm), Some(pitch_mm)) => {
                Some(MotorScrews { pitch_mm, across_mm: across.unwrap_or(0.0), diameter_mm })
            }
            (None, None) if across.is_none() => None,
            _ => {
                let help =
                    "state `screw`, its diameter, and `screw_pitch`; of four screws `screw_across` too";
                return self.unfit(asked, "its screws are stated in part", help);
            }
        };
        let depth = self.positive_field(item, "pilot_height")?;
        let pilot_mm = self.positive_field(item, "pilot")?.map(|d| (d, depth));
        let shaft_mm = self.positive_field(item, "shaft")?;
        let name = asked.node.clone();
        Ok(MotorBody { name, size_mm: [length, width, height], end_mm, screws, pilot_mm, shaft_mm })
    }

    /// The horn of a motor, for its seat.
    pub(super) fn horn_form(&mut self, item: ItemRef, asked: &Ident) -> Outcome<HornForm> {
        self.check_record(item)?;
        let diameter_mm = self.positive_field(item, "horn")?;
        let spline_mm = self.positive_field(item, "spline")?;
        if diameter_mm.is_none() && spline_mm.is_none() {
            let help = "measure it and declare a motor of your own, with `horn` (a diameter) or `spline`";
            return self.unfit(asked, "neither a horn nor a toothed shaft is stated", help);
        }
        let count = match self.positive_field(item, "horn_screws")? {
            Some(_) => Some(self.whole_field(item, "horn_screws", "a horn")?),
            None => None,
        };
        let circle = self.positive_field(item, "horn_circle")?;
        let screw = self.positive_field(item, "horn_screw")?;
        let screws = match (count, circle, screw) {
            (Some(n), Some(circle), Some(screw)) if n <= MOST_SCREWS => Some((n as usize, circle, screw)),
            (None, None, None) => None,
            _ => {
                let help = "state `horn_screws` (up to 16), `horn_circle` and `horn_screw`, a diameter";
                return self.unfit(asked, "the screws of its horn are stated in part", help);
            }
        };
        Ok(HornForm { name: asked.node.clone(), diameter_mm, spline_mm, screws })
    }

    fn all_of<const N: usize>(
        &mut self,
        item: ItemRef,
        asked: &Ident,
        names: [&str; N],
    ) -> Outcome<[f64; N]> {
        let mut values = [0.0; N];
        for (value, name) in values.iter_mut().zip(names) {
            let Some(found) = self.positive_field(item, name)? else {
                let help = "measure it and declare a motor of your own: `body_length`, `body_width` and `body_height` of its box, `body_end` from the box's end to the shaft";
                return self.unfit(asked, &format!("`{name}` is not stated"), help);
            };
            *value = found;
        }
        Ok(values)
    }

    fn unfit<T>(&mut self, asked: &Ident, why: &str, help: &str) -> Outcome<T> {
        let message = format!("`{}` cannot be fitted: {why}", asked.node);
        self.out.push(Diagnostic::error(codes::FITTING, message, asked.at).help(help));
        Err(Failed)
    }
}
