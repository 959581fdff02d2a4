//! Lines to text: columns of neighbouring lines are set below each other.

use super::lines::{Line, LineKind};

/// Columns further apart than this are not set below each other: the gap would separate what belongs together.
const SPREAD: usize = 28;
/// The same for comments behind lines.
const COMMENT_SPREAD: usize = 40;
/// Spaces before a comment.
const BEFORE_COMMENT: usize = 2;

/// Prints lines, each ended by `end`; the last one is not where it is left as it is and had no end (`open`): recovery
/// reads `x {` at the end of a line otherwise than at the end of a file.
pub(super) fn print(mut lines: Vec<Line>, end: &str, open: bool) -> String {
    for paragraph in paragraphs(&lines) {
        align(&mut lines, &paragraph);
    }
    aim_directions(&mut lines);
    let mut comments = vec![0; lines.len()];
    for paragraph in paragraphs(&lines) {
        align_comments(&lines, &paragraph, &mut comments);
    }
    let mut out = String::new();
    for (line, comment) in lines.iter().zip(comments) {
        if line.blank {
            out.push_str(end);
        }
        let start = out.len();
        out.push_str(&text(line));
        if !line.comment.is_empty() {
            let width = out.get(start..).unwrap_or("").chars().count();
            let gap = match line.kind {
                LineKind::Comment => 0,
                _ => comment.max(width + BEFORE_COMMENT) - width,
            };
            out.extend(std::iter::repeat_n(' ', gap));
            out.push_str(&line.comment);
        }
        out.push_str(end);
    }
    if open && lines.last().is_some_and(|l| l.kind == LineKind::AsIs) {
        out.truncate(out.len().saturating_sub(end.len()));
    }
    out
}

/// A line without its comment.
fn text(line: &Line) -> String {
    let mut text = " ".repeat(line.indent);
    for cell in &line.cells {
        // Set below nothing: it stands by itself.
        text.extend(std::iter::repeat_n(' ', cell.column.as_ref().map_or(0, |c| c.space)));
        text.push_str(&cell.text);
    }
    text
}

/// Indices of lines that are one table: of one depth, without blank lines or broken statements between them.
fn paragraphs(lines: &[Line]) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = vec![Vec::new()];
    let mut depth = None;
    for (i, line) in lines.iter().enumerate() {
        let same = depth == Some(line.indent);
        match line.kind {
            LineKind::Comment if !line.blank => continue,
            LineKind::Code if line.continues => continue,
            LineKind::Code if same && !line.blank => {}
            _ => all.push(Vec::new()),
        }
        if let (LineKind::Code, Some(last)) = (line.kind, all.last_mut()) {
            depth = Some(line.indent);
            last.push(i);
        }
    }
    all
}

/// Pads the cells of a table.
fn align(lines: &mut [Line], paragraph: &[usize]) {
    let ranks = |line: &Line| -> Vec<u8> {
        line.cells.iter().filter_map(|c| c.column.as_ref()).map(|c| c.rank).collect()
    };
    let mut all: Vec<u8> = paragraph.iter().filter_map(|i| lines.get(*i)).flat_map(ranks).collect();
    all.sort_unstable();
    all.dedup();
    for rank in all {
        // (line, cell, where it would begin by itself) of neighbours with the same column.
        let mut run: Vec<(usize, usize, usize)> = Vec::new();
        let mut key: Option<String> = None;
        for i in paragraph {
            let found = lines.get(*i).and_then(|line| place(line, rank));
            let (found, this) = match found {
                Some((cell, at, this)) => (Some((*i, cell, at)), Some(this)),
                None => (None, None),
            };
            if this != key {
                pad(lines, &run);
                run.clear();
                key = this;
            }
            run.extend(found);
        }
        pad(lines, &run);
    }
}

/// Cell of a rank, where it would begin by itself, and its key.
fn place(line: &Line, rank: u8) -> Option<(usize, usize, String)> {
    let mut width = line.indent;
    for (c, cell) in line.cells.iter().enumerate() {
        if let Some(column) = &cell.column
            && column.rank == rank
        {
            return Some((c, width + column.space, column.key.clone()));
        }
        width += cell.text.chars().count() + cell.column.as_ref().map_or(0, |c| c.space);
    }
    None
}

/// Sets the cells of a run below each other. A padded cell carries its spaces and is no column any more.
fn pad(lines: &mut [Line], run: &[(usize, usize, usize)]) {
    let least = run.iter().map(|r| r.2).min().unwrap_or(0);
    let most = run.iter().map(|r| r.2).max().unwrap_or(0);
    for (line, cell, at) in run {
        let Some(cell) = lines.get_mut(*line).and_then(|l| l.cells.get_mut(*cell)) else { continue };
        let more = if most - least > SPREAD { 0 } else { most - at };
        let space = cell.column.take().map_or(0, |c| c.space) + more;
        cell.text.insert_str(0, &" ".repeat(space));
    }
}

/// `along` on a line of its own stands below the `at` that it goes with.
fn aim_directions(lines: &mut [Line]) {
    let mut below = None;
    for line in lines.iter_mut().filter(|l| l.kind == LineKind::Code) {
        let first = line.cells.first().map_or("", |c| c.text.as_str());
        if matches!(first, "from" | "to") {
            let text = text(line);
            let column = text.find(" at ").map(|at| text.get(..at).unwrap_or("").chars().count() + 1);
            below = column;
        } else if line.continues && first.starts_with("along ") {
            line.indent = below.unwrap_or(line.indent);
        } else {
            below = None;
        }
    }
}

/// Where the comments behind the lines of a table begin.
fn align_comments(lines: &[Line], paragraph: &[usize], comments: &mut [usize]) {
    let width = |i: usize| lines.get(i).map_or(0, |l| text(l).chars().count());
    let has = |i: &&usize| lines.get(**i).is_some_and(|l| !l.comment.is_empty());
    let run: Vec<usize> = paragraph.iter().filter(has).copied().collect();
    let least = run.iter().map(|i| width(*i)).min().unwrap_or(0);
    let most = run.iter().map(|i| width(*i)).max().unwrap_or(0);
    for i in run {
        if let Some(at) = comments.get_mut(i).filter(|_| most - least <= COMMENT_SPREAD) {
            *at = most + BEFORE_COMMENT;
        }
    }
}
