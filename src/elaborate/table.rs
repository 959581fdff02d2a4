//! Places over the cycle from the text of a CSV file.

/// Most rows of a table.
const MAX_ROWS: usize = 100_000;

/// Times (increasing from 0 to 1) and places.
pub(super) type Places = (Vec<f64>, Vec<[f64; 3]>);

/// Reads the three named columns, and `t` where there is one; without it the rows are spread evenly. Other columns are
/// passed over, the third one is 0 where `flat` allows it to be absent. Empty lines and lines that begin with `#` mean nothing.
///
/// # Errors
/// What is wrong with the text, in words, with its line.
pub(super) fn places(text: &str, columns: [&str; 3], flat: bool) -> Result<Places, String> {
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let Some((_, heading)) = lines.next() else { return Err("the file is empty".into()) };
    let names: Vec<&str> = heading.split(',').map(|n| n.trim().trim_matches('"')).collect();
    let time = column(&names, "t")?;
    let mut indices = [None; 3];
    for (k, (slot, name)) in indices.iter_mut().zip(columns).enumerate() {
        *slot = column(&names, name)?;
        if slot.is_none() && !(flat && k == 2) {
            let found: Vec<String> = names.iter().take(12).map(|n| format!("`{n}`")).collect();
            return Err(format!("it has no column `{name}`, but {}", found.join(", ")));
        }
    }
    let (mut times, mut places) = (Vec::new(), Vec::new());
    for (line, row) in lines {
        if places.len() >= MAX_ROWS {
            return Err(format!("it has more than {MAX_ROWS} rows"));
        }
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != names.len() {
            return Err(format!("line {line} has {} fields, the heading {}", fields.len(), names.len()));
        }
        let number = |i: Option<usize>| -> Result<f64, String> {
            let Some(i) = i else { return Ok(0.0) };
            let field = fields.get(i).copied().unwrap_or("");
            let shown: String = field.chars().take(20).collect();
            match field.parse::<f64>() {
                Ok(v) if v.is_finite() => Ok(v),
                _ => {
                    let name = names.get(i).copied().unwrap_or("");
                    Err(format!("line {line}: `{shown}` in column `{name}` is no finite number"))
                }
            }
        };
        if time.is_some() {
            let t = number(time)?;
            if times.last().is_some_and(|before| t <= *before) {
                return Err(format!("line {line}: its time is not after the one before it"));
            }
            times.push(t);
        }
        places.push([number(indices[0])?, number(indices[1])?, number(indices[2])?]);
    }
    if places.len() < 2 {
        return Err("a path has at least two rows".into());
    }
    if time.is_none() {
        times = even(places.len());
    } else if (times.first(), times.last()) != (Some(&0.0), Some(&1.0)) {
        return Err("its column `t` does not run from 0 to 1".into());
    }
    Ok((times, places))
}

/// Times of n places at equal intervals.
pub(super) fn even(n: usize) -> Vec<f64> {
    (0..n).map(|i| i as f64 / n.saturating_sub(1).max(1) as f64).collect()
}

fn column(names: &[&str], wanted: &str) -> Result<Option<usize>, String> {
    let mut found = names.iter().enumerate().filter(|(_, n)| **n == wanted).map(|(i, _)| i);
    match (found.next(), found.next()) {
        (_, Some(_)) => Err(format!("it has two columns `{wanted}`")),
        (first, None) => Ok(first),
    }
}

#[cfg(test)]
mod tests {
    const MM: [&str; 3] = ["x_mm", "y_mm", "z_mm"];

    #[test]
    fn rows_are_spread_evenly_or_have_their_times() {
        let (times, places) =
            super::places("\u{FEFF}x_mm, y_mm\n1,2\n\n# said\n3,4\r\n5,-6e1\n", MM, true).unwrap();
        assert_eq!(
            (times, places),
            (vec![0.0, 0.5, 1.0], vec![[1.0, 2.0, 0.0], [3.0, 4.0, 0.0], [5.0, -60.0, 0.0]])
        );
        let (times, places) =
            super::places("step,\"z_mm\",t,y_mm,x_mm\n0,1,0,2,3\n1,4,1,5,6\n", MM, true).unwrap();
        assert_eq!((times, places), (vec![0.0, 1.0], vec![[3.0, 2.0, 1.0], [6.0, 5.0, 4.0]]));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let wrong = |text: &str, flat: bool| super::places(text, MM, flat).unwrap_err();
        assert_eq!(wrong("", true), "the file is empty");
        assert_eq!(wrong("x,y\n1,2\n3,4\n", true), "it has no column `x_mm`, but `x`, `y`");
        assert_eq!(wrong("x_mm,y_mm\n1,2\n3,4\n", false), "it has no column `z_mm`, but `x_mm`, `y_mm`");
        assert_eq!(wrong("x_mm,y_mm,x_mm\n", true), "it has two columns `x_mm`");
        assert_eq!(wrong("x_mm,y_mm\n1,2\n3\n", true), "line 3 has 1 fields, the heading 2");
        assert_eq!(wrong("x_mm,y_mm\n1,NaN\n", true), "line 2: `NaN` in column `y_mm` is no finite number");
        assert_eq!(
            wrong("x_mm,y_mm\n1,1e999\n", true),
            "line 2: `1e999` in column `y_mm` is no finite number"
        );
        assert_eq!(wrong("x_mm,y_mm\n1,two\n", true), "line 2: `two` in column `y_mm` is no finite number");
        assert_eq!(wrong("x_mm,y_mm\n1,2\n", true), "a path has at least two rows");
        assert_eq!(
            wrong("t,x_mm,y_mm\n0,1,2\n0,1,2\n", true),
            "line 3: its time is not after the one before it"
        );
        assert_eq!(wrong("t,x_mm,y_mm\n0,1,2\n0.5,1,2\n", true), "its column `t` does not run from 0 to 1");
    }
}
