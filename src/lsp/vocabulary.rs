//! Words of the language with what to say about them.

/// A function: name, parameters, what it gives.
pub(super) struct Function {
    pub name: &'static str,
    pub parameters: &'static [&'static str],
    pub gives: &'static str,
}

const fn function(name: &'static str, parameters: &'static [&'static str], gives: &'static str) -> Function {
    Function { name, parameters, gives }
}

/// Functions of values, terms of `minimize`, queries of `require`, places and sections of templates.
pub(super) const FUNCTIONS: &[Function] = &[
    function("polar", &["r", "φ"], "the vector of length r at angle φ from +x, about +z"),
    function(
        "meet",
        &["circle(P, r)", "circle(Q, s)", "left or right"],
        "the point where two circles meet, on that side of the way from P to Q",
    ),
    function("circle", &["centre", "radius"], "a circle, for `meet`"),
    function("distance", &["P", "Q"], "a length"),
    function("sqrt", &["x"], "the square root, with its dimension"),
    function("abs", &["x"], "the size"),
    function("min", &["a", "b, …"], "the least; in `require`, over the cycle"),
    function("max", &["a", "b, …"], "the largest; in `require`, over the cycle"),
    function("sin", &["angle"], "a plain number"),
    function("cos", &["angle"], "a plain number"),
    function("tan", &["angle"], "a plain number"),
    function("asin", &["x"], "an angle"),
    function("acos", &["x"], "an angle"),
    function("atan2", &["y", "x"], "an angle"),
    function(
        "track",
        &["TRACE", "scale = LENGTH", "form = closest", "emphasis = EXPRESSION"],
        "a term: the distance from the target, squared",
    ),
    function(
        "stress",
        &["below = STRESS", "scale = STRESS"],
        "a term: what exceeds the limit, squared; in `require`, the largest stress",
    ),
    function(
        "torque",
        &["DRIVE"],
        "a term: the largest torque relative to the motor's stall; in `require`, the torque",
    ),
    function("force", &["DRIVE"], "the same for what slides or is pulled"),
    function(
        "sway",
        &["TRACE", "force = FORCE", "scale = LENGTH", "along = DIRECTION"],
        "a term: how far the traced point gives way",
    ),
    function(
        "collision",
        &["gap = LENGTH"],
        "a term: how much bodies come nearer to each other than the gap",
    ),
    function("error", &["TRACE", "form = closest"], "the distance from the target"),
    function("tension", &["STRING"], "the force in a string, with its sign"),
    function("buckling", &[], "the factor by which all loads can grow before it buckles, at most 10"),
    function("gap", &[], "the least distance between what moves"),
    function("angle", &["BODY about DIRECTION"], "how far a body has turned"),
    function("mean", &["QUANTITY"], "the mean over the cycle"),
    function("span", &["QUANTITY"], "the largest less the least over the cycle"),
    function("at", &["QUANTITY", "time"], "the value at a time of the cycle"),
    function("path", &["\"FILE.csv\""], "the places in a file below the design's folder"),
    function("points", &["P", "Q", "…"], "places, spread evenly over the cycle"),
    function("cyl", &["r", "φ", "z"], "a place in the frame of a rod's end"),
    function("sph", &["r", "azimuth", "elevation"], "a place in the frame of a rod's end"),
    function("ellipse", &["thick = LENGTH", "wide = LENGTH"], "a section; widths are full widths"),
    function("rect", &["thick = LENGTH", "wide = LENGTH"], "a section; widths are full widths"),
    function("round", &["diameter"], "a section"),
];

/// The function of a name.
pub(super) fn named(name: &str) -> Option<&'static Function> {
    FUNCTIONS.iter().find(|f| f.name == name)
}
