//! Numbers as they are read.

/// Four digits that count, without a tail of zeros; very large and very small ones with a power of ten.
pub fn number(v: f64) -> String {
    rounded(v, 4)
}

/// Three digits that count: what is compared at a glance.
pub fn glance(v: f64) -> String {
    rounded(v, 3)
}

/// A text whose `code` stands between backticks, as HTML.
pub fn marked(text: &str) -> String {
    let piece = |(k, piece): (usize, &str)| {
        let safe = escaped(piece);
        if k % 2 == 1 { format!("<code>{safe}</code>") } else { safe }
    };
    text.split('`').enumerate().map(piece).collect()
}

/// Safe as HTML and XML, also inside of quotes.
pub fn escaped(text: &str) -> String {
    let of = |c: char| match c {
        '&' => "&amp;".to_string(),
        '<' => "&lt;".to_string(),
        '>' => "&gt;".to_string(),
        '"' => "&quot;".to_string(),
        '\'' => "&#39;".to_string(),
        other => other.to_string(),
    };
    text.chars().map(of).collect()
}

fn rounded(v: f64, count: i32) -> String {
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
    let digits = (count - 1 - size).max(0) as usize;
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
    fn code_is_marked_and_nothing_gets_through() {
        assert_eq!(marked("`a<b` & \"c\""), "<code>a&lt;b</code> &amp; &quot;c&quot;");
        assert_eq!(marked("<script>"), "&lt;script&gt;");
    }

    #[test]
    fn numbers_have_four_digits() {
        let shown = [0.0, 0.25, 1.0 / 3.0, -1234.56, 99_999.6, 2.0e-7, 3.0e9, f64::NAN].map(number);
        assert_eq!(shown, ["0", "0.25", "0.3333", "−1235", "100000", "2.00e-7", "3.00e9", "–"]);
    }
}
