//! Suggestions for names that are nearly right.

/// The candidate closest to `name`, if it is close enough to be meant.
pub fn suggestion<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<String> {
    // One edit in up to four letters, two in five, three in eight.
    let allowed = (name.chars().count().saturating_add(1) / 3).max(1);
    candidates
        .into_iter()
        .filter(|c| !c.is_empty() && *c != name)
        .map(|c| {
            // A difference of case only is the nearest miss there is.
            let same_letters = c.eq_ignore_ascii_case(name);
            (if same_letters { 0 } else { strsim::damerau_levenshtein(name, c) }, c)
        })
        .filter(|(d, c)| *d <= allowed && (*d < c.chars().count() || name.starts_with(c)))
        .min()
        .map(|(_, c)| c.to_string())
}

#[cfg(test)]
mod tests {
    use super::suggestion;

    #[test]
    fn near_misses_are_found_and_far_ones_are_not() {
        let names = ["thickness", "height", "size", "r"];
        assert_eq!(suggestion("thicknes", names), Some("thickness".into()));
        assert_eq!(suggestion("hieght", names), Some("height".into()));
        assert_eq!(suggestion("Size", names), Some("size".into()));
        assert_eq!(suggestion("colour", names), None);
        assert_eq!(suggestion("q", names), None);
        assert_eq!(suggestion("rr", names), Some("r".into()));
    }
}
