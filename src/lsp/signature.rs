//! The parameters of the call around a place.

use super::vocabulary;

/// A signature with the number of the parameter in hand.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signature {
    /// `polar(r, φ)`
    pub label: String,
    /// Parameters as they stand in the label.
    pub parameters: Vec<String>,
    /// What it gives.
    pub gives: String,
    /// Which parameter is being written.
    pub active: usize,
}

/// The call around a byte. Looks at the text alone: a call that is being written is not in the tree.
pub fn signature(text: &str, byte: usize) -> Option<Signature> {
    let mut depth = 0_usize;
    let mut commas = 0;
    for (i, c) in text.get(..byte)?.char_indices().rev() {
        match c {
            ')' | '}' => depth += 1,
            '(' if depth > 0 => depth -= 1,
            ',' if depth == 0 => commas += 1,
            '{' if depth == 0 => return None,
            '{' => depth -= 1,
            '(' => {
                let before = text.get(..i)?;
                let start = before.rfind(|c: char| !(c.is_alphanumeric() || c == '_')).map_or(0, |n| n + 1);
                // A start inside a sign of several bytes is no name.
                let f = vocabulary::named(before.get(start..).unwrap_or(""))?;
                let parameters: Vec<String> = f.parameters.iter().map(|p| (*p).to_string()).collect();
                return Some(Signature {
                    label: format!("{}({})", f.name, parameters.join(", ")),
                    active: commas.min(parameters.len().saturating_sub(1)),
                    parameters,
                    gives: f.gives.into(),
                });
            }
            _ => {}
        }
    }
    None
}
