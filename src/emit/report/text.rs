//! Numbers as they are read.

/// Digits that are shown of a number.
const DIGITS: i32 = 4;

/// Four digits that count, without a tail of zeros; very large and very small ones with a power of ten.
pub fn number(v: f64) -> String {
    if !v.is_finite() {
        return "–".into();
    }
    if v == 0.0 {
        return "0".into();
    }
    let size = v.abs().log10().floor() as i32;
    if !(-4..6).contains(&size) {
        return signed(format!("{v:.2e}"));
    }
    let digits = (DIGITS - 1 - size).max(0) as usize;
    let plain = format!("{v:.digits$}");
    signed(match plain.contains('.') {
        true => plain.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => plain,
    })
}

/// With the sign that typesetters use.
fn signed(plain: String) -> String {
    match plain.strip_prefix('-') {
        Some("0") => "0".into(),
        Some(rest) => format!("−{rest}"),
        None => plain,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        let shown = [0.0, 0.25, 1.0 / 3.0, -1234.56, 99_999.6, 2.0e-7, 3.0e9, f64::NAN].map(number);
        assert_eq!(shown, ["0", "0.25", "0.3333", "−1235", "100000", "2.00e-7", "3.00e9", "–"]);
    }
}
