//! `model NAME`: by which theory the flexures are computed.

use super::codes;
use super::eval::Evaluator;
use super::sheet::Sheet;
use crate::diagnostic::Diagnostic;
use crate::ir::RodModel;

impl Evaluator<'_> {
    /// The theory that the mechanism names, or the default; none for a name that means nothing.
    pub(super) fn rod_model(&mut self, sheet: &Sheet<'_>) -> Option<RodModel> {
        let Some((name, _)) = sheet.model else { return Some(RodModel::default()) };
        let found = RodModel::ALL.into_iter().find(|m| m.name() == name.node);
        if found.is_none() {
            self.out.push(
                Diagnostic::error(codes::MODEL, format!("there is no model `{}`", name.node), name.at).help(
                    "write `model corrected` (the default: with shear, the stiffening of wide leaves and \
                     hindered warping) or `model plain` (the slender rod)",
                ),
            );
        }
        found
    }
}
