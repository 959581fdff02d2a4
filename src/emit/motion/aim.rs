//! Inverse use: from an output to shaft angles, by a table of the compliant mechanism. Of one drive straight lines
//! between the table's points; of two, the grid's cells in two triangles each, in which both directions are linear, so
//! that a place is in one triangle or in none.

use super::MDEG;
use std::fmt;

/// The error that is stated is the largest measured one and this much more, for what lies between the measured places.
const MARGIN: f64 = 1.25;
/// Part of a triangle by which a place may lie outside of it and still count as on its edge.
const EDGE: f64 = 1e-5;
/// A triangle whose area is less than this part of the largest has none.
const FLAT: f64 = 1e-4;

/// What an output is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputUnit {
    /// Degrees.
    Deg,
    /// Millimetres.
    Mm,
    /// A component of a unit direction.
    One,
}

impl OutputUnit {
    /// As people read it.
    pub fn shown(self) -> &'static str {
        match self {
            Self::Deg => "deg",
            Self::Mm => "mm",
            Self::One => "of 1",
        }
    }
}

/// One drive of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridAxis {
    /// Index into the motors.
    pub axis: usize,
    /// Name of the drive.
    pub name: String,
    /// Shaft angle at every place of the fine grid, degrees, increasing or decreasing.
    pub shaft_deg: Vec<f64>,
    /// Drive value there, deg or mm.
    pub value: Vec<f64>,
    /// `deg` or `mm`.
    pub unit: &'static str,
    /// Smallest angle the motor tells apart, degrees of the shaft.
    pub resolution_deg: f64,
}

/// What the solver gave: outputs on a grid that is finer than the table is to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Name of the table.
    pub name: String,
    /// Names and units of the outputs.
    pub wanted: Vec<(String, OutputUnit)>,
    /// One or two drives.
    pub axes: Vec<GridAxis>,
    /// Fine steps a step of the table.
    pub refine: usize,
    /// Each output at every place; that of (i, j) at i · (places of the second drive) + j.
    pub outputs: Vec<Vec<f64>>,
    /// Of one drive, the longest stretch that can be inverted will do.
    pub part: bool,
}

/// A table from outputs to shaft angles.
#[derive(Clone, Debug, PartialEq)]
pub struct AimTable {
    /// Name: an identifier.
    pub name: String,
    /// Names and units of the outputs.
    pub wanted: Vec<(String, OutputUnit)>,
    /// Motors: indices into those of the motion.
    pub axes: Vec<usize>,
    /// Shaft angles of the grid lines, thousandths of a degree.
    pub shaft_mdeg: Vec<Vec<i32>>,
    /// Outputs at the grid's places; of one drive the first is increasing.
    pub outputs: Vec<Vec<f32>>,
    /// Largest distance of the outputs from what was aimed at, in their unit (of two together).
    pub error: f64,
    /// How much a motor's resolution adds to it at most.
    pub resolution: f64,
    /// How far the drives go.
    pub region: String,
}

/// Outputs that cannot be aimed at.
#[derive(Clone, Debug, PartialEq)]
pub enum AimError {
    /// The outputs do not change, or a grid is empty.
    Flat,
    /// The output turns back, or two places have the same outputs.
    Folds {
        /// Where, in drive values.
        region: String,
    },
}

impl fmt::Display for AimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flat => write!(f, "it does not change with these drives"),
            Self::Folds { region } => {
                write!(f, "it has one value at several places: it turns back at {region}")
            }
        }
    }
}

impl AimTable {
    /// The table of a grid, with its error measured at the places between the table's.
    ///
    /// # Errors
    /// Where outputs do not tell the drives.
    pub fn new(grid: &Grid) -> Result<Self, AimError> {
        match grid.axes.as_slice() {
            [a] => one(grid, a),
            [a, b] => two(grid, a, b),
            _ => Err(AimError::Flat),
        }
    }

    /// Shaft angles for wanted outputs, degrees; none outside of the table. What the code does, in double precision.
    pub fn solve(&self, wanted: &[f64]) -> Option<Vec<f64>> {
        let deg = |axis: usize, k: usize| Some(f64::from(*self.shaft_mdeg.get(axis)?.get(k)?) / MDEG);
        let out = |o: usize, k: usize| Some(f64::from(*self.outputs.get(o)?.get(k)?));
        if let [x] = wanted {
            let nodes = self.outputs.first()?;
            let after = nodes.partition_point(|v| f64::from(*v) < *x).clamp(1, nodes.len() - 1);
            let (a, b) = (out(0, after - 1)?, out(0, after)?);
            let s = (x - a) / (b - a);
            if !(-EDGE..=1.0 + EDGE).contains(&s) {
                return None;
            }
            let (d, e) = (deg(0, after - 1)?, deg(0, after)?);
            return Some(vec![d + s * (e - d)]);
        }
        let [x, y] = wanted else { return None };
        let columns = self.shaft_mdeg.get(1)?.len();
        let rows = self.shaft_mdeg.first()?.len();
        let place = |i: usize, j: usize| Some([out(0, i * columns + j)?, out(1, i * columns + j)?]);
        for i in 0..rows.checked_sub(1)? {
            for j in 0..columns.checked_sub(1)? {
                for upper in [false, true] {
                    let [p, q, r] = corners(i, j, upper);
                    let [u, v] = weights([place(p.0, p.1)?, place(q.0, q.1)?, place(r.0, r.1)?], [*x, *y]);
                    if u >= -EDGE && v >= -EDGE && u + v <= 1.0 + EDGE {
                        let (a, b) = (deg(0, p.0)?, deg(0, q.0)?);
                        let (c, d) = (deg(1, p.1)?, deg(1, r.1)?);
                        return Some(vec![a + u * (b - a), c + v * (d - c)]);
                    }
                }
            }
        }
        None
    }
}

/// Corners of a cell's lower or upper triangle: the second differs from the first along the first drive, the third
/// along the second.
fn corners(i: usize, j: usize, upper: bool) -> [(usize, usize); 3] {
    match upper {
        false => [(i, j), (i + 1, j), (i, j + 1)],
        true => [(i + 1, j + 1), (i, j + 1), (i + 1, j)],
    }
}

/// Weights of the second and third corner at a place; beyond 1 where the triangle is flat.
fn weights([p, q, r]: [[f64; 2]; 3], at: [f64; 2]) -> [f64; 2] {
    let (e, f, g) = ([q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]], [at[0] - p[0], at[1] - p[1]]);
    let det = e[0] * f[1] - e[1] * f[0];
    if det == 0.0 {
        return [2.0, 2.0];
    }
    [(g[0] * f[1] - g[1] * f[0]) / det, (e[0] * g[1] - e[1] * g[0]) / det]
}

fn stretch(a: &GridAxis, from: usize, to: usize) -> String {
    let value = |k: usize| a.value.get(k).copied().unwrap_or(f64::NAN);
    let (x, y) = (value(from).min(value(to)), value(from).max(value(to)));
    format!("{} {x:.2} to {y:.2} {}", a.name, a.unit)
}

fn rounded(mdeg: f64) -> i32 {
    (mdeg * MDEG).round() as i32
}

/// The longest run over which the output goes one way: first and last place.
fn longest_run(outputs: &[f64], least: f64) -> (usize, usize) {
    let way = |k: usize| match outputs.get(k + 1).zip(outputs.get(k)).map(|(b, a)| b - a) {
        Some(d) if d > least => 1,
        Some(d) if d < -least => -1,
        _ => 0,
    };
    let (mut best, mut start) = ((0, 0), 0);
    for k in 0..outputs.len().saturating_sub(1) {
        if way(k) == 0 || (k > start && way(k) != way(k - 1)) {
            start = if way(k) == 0 { k + 1 } else { k };
        }
        if way(k) != 0 && k + 1 - start > best.1 - best.0 {
            best = (start, k + 1);
        }
    }
    best
}

fn one(grid: &Grid, axis: &GridAxis) -> Result<AimTable, AimError> {
    let outputs = grid.outputs.first().ok_or(AimError::Flat)?;
    let refine = grid.refine.max(1);
    let (low, high) =
        outputs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let span = high - low;
    if outputs.len() < refine + 1 || span.is_nan() || span < 1e-9 {
        return Err(AimError::Flat);
    }
    // Slopes of less than a thousandth of the mean are as good as a turning point.
    let (mut from, mut to) = longest_run(outputs, span / outputs.len() as f64 * 1e-3);
    if !grid.part && (from, to) != (0, outputs.len() - 1) {
        let turn = if from > 0 { from } else { to };
        let region = stretch(axis, turn.saturating_sub(1), (turn + 1).min(outputs.len() - 1));
        return Err(AimError::Folds { region });
    }
    // Whole steps of the table.
    from = from.div_ceil(refine) * refine;
    to = to / refine * refine;
    if to <= from {
        return Err(AimError::Flat);
    }
    let mut nodes: Vec<usize> = (from..=to).step_by(refine).collect();
    let at = |k: usize| outputs.get(k).copied().unwrap_or(f64::NAN);
    if at(from) > at(to) {
        nodes.reverse();
    }
    let shaft = |k: usize| axis.shaft_deg.get(k).copied().unwrap_or(f64::NAN);
    let mut table = AimTable {
        name: grid.name.clone(),
        wanted: grid.wanted.clone(),
        axes: vec![axis.axis],
        shaft_mdeg: vec![nodes.iter().map(|k| rounded(shaft(*k))).collect()],
        outputs: vec![nodes.iter().map(|k| at(*k) as f32).collect()],
        error: 0.0,
        resolution: 0.0,
        region: stretch(axis, from, to),
    };
    let mut steepest = 0.0_f64;
    for k in from..=to {
        let (a, b) = (k.max(from + 1) - 1, (k + 1).min(to));
        let slope = ((at(b) - at(a)) / (shaft(b) - shaft(a))).abs();
        steepest = steepest.max(slope);
        if let Some(found) = table.solve(&[at(k)]).and_then(|s| s.first().copied()) {
            table.error = table.error.max((found - shaft(k)).abs() * slope);
        }
    }
    table.error *= MARGIN;
    table.resolution = steepest * axis.resolution_deg / 2.0;
    Ok(table)
}

fn two(grid: &Grid, a: &GridAxis, b: &GridAxis) -> Result<AimTable, AimError> {
    let refine = grid.refine.max(1);
    let (rows, columns) = (a.value.len(), b.value.len());
    let out = |o: usize, i: usize, j: usize| {
        grid.outputs.get(o).and_then(|v| v.get(i * columns + j)).copied().unwrap_or(f64::NAN)
    };
    if rows < refine + 1 || columns < refine + 1 || grid.outputs.len() != 2 {
        return Err(AimError::Flat);
    }
    let (is, js): (Vec<usize>, Vec<usize>) =
        ((0..rows).step_by(refine).collect(), (0..columns).step_by(refine).collect());
    let node = |i: usize, j: usize| {
        let at = |list: &[usize], k: usize| list.get(k).copied().unwrap_or(0);
        [out(0, at(&is, i), at(&js, j)), out(1, at(&is, i), at(&js, j))]
    };
    let region = |i: usize, j: usize| {
        let ends = |list: &[usize], k: usize| {
            (list.get(k).copied().unwrap_or(0), list.get(k + 1).copied().unwrap_or(0))
        };
        let ((i0, i1), (j0, j1)) = (ends(&is, i), ends(&js, j));
        format!("{}, {}", stretch(a, i0, i1), stretch(b, j0, j1))
    };
    let cells = || (0..is.len() - 1).flat_map(|i| (0..js.len() - 1).map(move |j| (i, j)));
    type Triangle = [[f64; 2]; 3];
    let triangles: Vec<((usize, usize), Triangle)> = cells()
        .flat_map(|(i, j)| [false, true].map(|upper| ((i, j), corners(i, j, upper).map(|(k, l)| node(k, l)))))
        .collect();
    let area = |t: &[[f64; 2]; 3]| {
        (t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[1][1] - t[0][1]) * (t[2][0] - t[0][0])
    };
    let largest =
        triangles.iter().map(|(_, t)| area(t)).fold(0.0, |m: f64, x| if x.abs() > m.abs() { x } else { m });
    if largest == 0.0 || !largest.is_finite() {
        return Err(AimError::Flat);
    }
    // The first cell that is turned otherwise than the first one lies at the fold.
    let sense = triangles.first().map_or(1.0, |(_, t)| area(t).signum());
    if let Some(((i, j), _)) = triangles.iter().find(|(_, t)| area(t) * sense <= largest.abs() * FLAT) {
        return Err(AimError::Folds { region: region(*i, *j) });
    }
    // Turned the same way everywhere, it could still run over itself.
    for (k, ((i, j), t)) in triangles.iter().enumerate() {
        let centre = [0, 1].map(|c| (t[0][c] + t[1][c] + t[2][c]) / 3.0);
        let holds = |t: &[[f64; 2]; 3]| {
            let [u, v] = weights(*t, centre);
            u >= 0.0 && v >= 0.0 && u + v <= 1.0
        };
        if triangles.iter().enumerate().any(|(l, (_, other))| l != k && holds(other)) {
            return Err(AimError::Folds { region: region(*i, *j) });
        }
    }
    let shaft = |axis: &GridAxis, k: usize| axis.shaft_deg.get(k).copied().unwrap_or(f64::NAN);
    let nodes = |o: usize| {
        let all = (0..is.len()).flat_map(|i| (0..js.len()).map(move |j| (i, j)));
        all.map(|(i, j)| node(i, j).get(o).copied().unwrap_or(f64::NAN) as f32).collect()
    };
    let mut table = AimTable {
        name: grid.name.clone(),
        wanted: grid.wanted.clone(),
        axes: vec![a.axis, b.axis],
        shaft_mdeg: vec![
            is.iter().map(|k| rounded(shaft(a, *k))).collect(),
            js.iter().map(|k| rounded(shaft(b, *k))).collect(),
        ],
        outputs: vec![nodes(0), nodes(1)],
        error: 0.0,
        resolution: 0.0,
        region: format!("{}, {}", stretch(a, 0, rows - 1), stretch(b, 0, columns - 1)),
    };
    for i in 0..rows {
        for j in 0..columns {
            let (i0, i1) = (i.max(1) - 1, (i + 1).min(rows - 1));
            let (j0, j1) = (j.max(1) - 1, (j + 1).min(columns - 1));
            let by_a = [0, 1].map(|o| (out(o, i1, j) - out(o, i0, j)) / (shaft(a, i1) - shaft(a, i0)));
            let by_b = [0, 1].map(|o| (out(o, i, j1) - out(o, i, j0)) / (shaft(b, j1) - shaft(b, j0)));
            let off = |da: f64, db: f64| {
                let d = [0, 1].map(|o| by_a[o] * da + by_b[o] * db);
                d[0].hypot(d[1])
            };
            let (ra, rb) = (a.resolution_deg / 2.0, b.resolution_deg / 2.0);
            table.resolution = table.resolution.max(off(ra, rb)).max(off(ra, -rb));
            // A place on a hollow edge lies outside of the table's straight one.
            if let Some([sa, sb]) = table.solve(&[out(0, i, j), out(1, i, j)]).as_deref() {
                table.error = table.error.max(off(sa - shaft(a, i), sb - shaft(b, j)));
            }
        }
    }
    table.error *= MARGIN;
    Ok(table)
}
