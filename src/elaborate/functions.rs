//! The functions of the language: plane geometry and elementary mathematics.

use super::codes;
use super::dimension::Dimension;
use super::eval::{Env, Evaluator, Outcome};
use super::value::{Scalar, Value};
use crate::diagnostic::{Diagnostic, Origin};
use crate::ir::ExprPoint;
use crate::ir::expr::{ExprId, Node};
use crate::syntax::ast::{Argument, Expr, ExprKind, Ident};

/// Functions that give a value.
const FUNCTIONS: &[&str] = &[
    "polar", "meet", "circle", "distance", "sqrt", "sin", "cos", "tan", "asin", "acos", "atan2", "min",
    "max", "abs",
];

/// Functions that exist elsewhere: in objectives, requirements, templates and exports.
const ELSEWHERE: &[(&str, &str)] = &[
    ("cyl", "`cyl` places the ends of a template's rods"),
    ("sph", "`sph` places the ends of a template's rods"),
    ("ellipse", "`ellipse` is the section of a template's rod"),
    ("track", "`track` is a term of `minimize`"),
    ("stress", "`stress()` stands in `minimize`, or inside `max(…)` in `require`"),
    ("error", "`error(trace)` stands inside `max(…)` or `mean(…)` in `require`"),
    ("torque", "`torque(drive)` stands inside `max(…)` in `require`"),
    ("arduino", "`arduino` is an export"),
    ("angle", "`angle(BODY about D)` stands in an `output`, or inside `span(…)` in `require`"),
    ("path", "`path(\"FILE.csv\")` is a `target` of a trace"),
    ("points", "`points(P, Q, …)` is a `target` of a trace"),
];

/// Functions of the target language that this version does not have.
const LATER: &[&str] = &["mirror", "turn"];

/// Circles that miss by less than this part of their radii touch: room for a few hundred roundings
/// (1.1e-16 each) in the points they are drawn from.
const TANGENT: f64 = 1e-13;

impl<'a> Evaluator<'a> {
    /// A function call that gives a value.
    pub(super) fn call(&mut self, env: &Env, f: &Ident, args: &'a [Argument], at: Origin) -> Outcome<Value> {
        let name = f.node.as_str();
        match name {
            "polar" => self.polar(env, f, args, at),
            "circle" => self.circle_value(env, f, args),
            "meet" => self.meet(env, f, args, at),
            "distance" => self.distance(env, f, args, at),
            "sqrt" | "abs" => {
                let (s, e) = self.one_scalar(env, f, args)?;
                if name == "abs" {
                    return Ok(Value::Scalar(Scalar { id: self.node(Node::Abs(s.id), at)?, dim: s.dim }));
                }
                let Some(dim) = s.dim.root() else {
                    return self.fail(
                        Diagnostic::error(
                            codes::ROOT,
                            "this has no square root with a dimension of its own",
                            e.at,
                        )
                        .label(s.dim.to_string()),
                    );
                };
                Ok(Value::Scalar(Scalar { id: self.node(Node::Sqrt(s.id), at)?, dim }))
            }
            "sin" | "cos" | "tan" => {
                let e = self.only(f, args, "angle")?;
                let id = self.eval_scalar(env, e, Dimension::ANGLE, name)?;
                let node = match name {
                    "sin" => Node::Sin(id),
                    "cos" => Node::Cos(id),
                    _ => Node::Tan(id),
                };
                Ok(Value::Scalar(Scalar { id: self.node(node, at)?, dim: Dimension::NUMBER }))
            }
            "asin" | "acos" => {
                let e = self.only(f, args, "number")?;
                let id = self.eval_scalar(env, e, Dimension::NUMBER, name)?;
                let node = if name == "asin" { Node::Asin(id) } else { Node::Acos(id) };
                Ok(Value::Scalar(Scalar { id: self.node(node, at)?, dim: Dimension::ANGLE }))
            }
            "atan2" => {
                let [y, x] = self.fixed_arguments(f, args, ["y", "x"])?;
                let (a, b) = self.like_scalars(env, y, x)?;
                Ok(Value::Scalar(Scalar {
                    id: self.node(Node::Atan2(a.id, b.id), at)?,
                    dim: Dimension::ANGLE,
                }))
            }
            "min" | "max" => self.extremum(env, f, args, at),
            _ => self.unknown_function(f),
        }
    }

    fn unknown_function(&mut self, f: &Ident) -> Outcome<Value> {
        let name = f.node.as_str();
        if LATER.contains(&name) {
            return self.later(codes::LATER_TERM, name, f.at);
        }
        let mut d =
            Diagnostic::error(codes::UNKNOWN_FUNCTION, format!("there is no function `{name}` here"), f.at);
        if let Some((_, text)) = ELSEWHERE.iter().find(|(n, _)| *n == name) {
            d = d.help(*text);
        } else if let Some(near) = super::names::suggestion(name, FUNCTIONS.iter().copied()) {
            d = super::lookup::meant(d, f, &near);
        } else {
            d = d.help(format!("functions are {}", FUNCTIONS.join(", ")));
        }
        self.fail(d)
    }

    /// "… is not available yet".
    pub(super) fn later<T>(&mut self, code: &str, what: &str, at: Origin) -> Outcome<T> {
        self.fail(
            Diagnostic::error(code, format!("`{what}` is not available yet"), at)
                .help("it is planned for a later version; leave it out for now"),
        )
    }

    /// Sorts arguments by the names of the parameters; reports what is missing, unknown or doubled.
    pub(super) fn arguments(
        &mut self,
        f: &Ident,
        args: &'a [Argument],
        names: &[&str],
        required: usize,
    ) -> Outcome<Vec<Option<&'a Expr>>> {
        let mut slots: Vec<Option<&'a Expr>> = vec![None; names.len()];
        let usage = || format!("it takes ({})", names.join(", "));
        for (position, a) in args.iter().enumerate() {
            let slot = match &a.name {
                None => position,
                Some(n) => match names.iter().position(|k| *k == n.node || ascii(k) == n.node) {
                    Some(i) => i,
                    None => {
                        let near = super::names::suggestion(&n.node, names.iter().copied());
                        let d = Diagnostic::error(
                            codes::ARGUMENTS,
                            format!("`{}` has no argument `{}`", f.node, n.node),
                            n.at,
                        );
                        let d = match near {
                            Some(near) => super::lookup::meant(d, n, &near),
                            None => d.help(usage()),
                        };
                        return self.fail(d);
                    }
                },
            };
            match slots.get_mut(slot) {
                None => {
                    let d = Diagnostic::error(
                        codes::ARGUMENTS,
                        format!("too many arguments for `{}`", f.node),
                        a.value.at,
                    );
                    return self.fail(d.help(usage()));
                }
                Some(s) if s.is_some() => {
                    let d = Diagnostic::error(
                        codes::ARGUMENTS,
                        format!("argument `{}` is given twice", names.get(slot).unwrap_or(&"")),
                        a.value.at,
                    );
                    return self.fail(d);
                }
                Some(s) => *s = Some(&a.value),
            }
        }
        if let Some(missing) = slots.iter().take(required).position(Option::is_none) {
            let d = Diagnostic::error(
                codes::ARGUMENTS,
                format!("`{}` lacks its argument `{}`", f.node, names.get(missing).unwrap_or(&"")),
                f.at,
            );
            return self.fail(d.help(usage()));
        }
        Ok(slots)
    }

    /// Arguments that must all be there.
    fn fixed_arguments<const N: usize>(
        &mut self,
        f: &Ident,
        args: &'a [Argument],
        names: [&str; N],
    ) -> Outcome<[&'a Expr; N]> {
        let slots: Vec<&'a Expr> = self.arguments(f, args, &names, N)?.into_iter().flatten().collect();
        slots.try_into().map_err(|_| super::eval::Failed)
    }

    fn only(&mut self, f: &Ident, args: &'a [Argument], name: &str) -> Outcome<&'a Expr> {
        let [e] = self.fixed_arguments(f, args, [name])?;
        Ok(e)
    }

    fn one_scalar(&mut self, env: &Env, f: &Ident, args: &'a [Argument]) -> Outcome<(Scalar, &'a Expr)> {
        let e = self.only(f, args, "x")?;
        Ok((self.any_scalar(env, e)?, e))
    }

    /// A scalar of whatever dimension.
    pub(super) fn any_scalar(&mut self, env: &Env, e: &'a Expr) -> Outcome<Scalar> {
        match self.eval(env, e)? {
            Value::Scalar(s) => Ok(s),
            other => self.fail(Diagnostic::error(
                codes::TYPE,
                format!("a number or quantity is needed, this is {}", other.a()),
                e.at,
            )),
        }
    }

    /// Two scalars of one dimension.
    fn like_scalars(&mut self, env: &Env, a: &'a Expr, b: &'a Expr) -> Outcome<(Scalar, Scalar)> {
        let x = self.any_scalar(env, a);
        let y = self.any_scalar(env, b);
        let (x, y) = (x?, y?);
        if x.dim == y.dim {
            return Ok((x, y));
        }
        let d = Diagnostic::error(codes::DIMENSION, format!("{} against {}", x.dim, y.dim), b.at)
            .label(y.dim.to_string())
            .also(a.at, x.dim.to_string());
        self.fail(d)
    }

    fn extremum(&mut self, env: &Env, f: &Ident, args: &'a [Argument], at: Origin) -> Outcome<Value> {
        if let Some(named) = args.iter().find_map(|a| a.name.as_ref()) {
            let d =
                Diagnostic::error(codes::ARGUMENTS, format!("`{}` takes plain arguments", f.node), named.at);
            return self.fail(d);
        }
        let Some((first, rest)) = args.split_first() else {
            return self.fail(Diagnostic::error(
                codes::ARGUMENTS,
                format!("`{}` needs at least one argument", f.node),
                f.at,
            ));
        };
        let mut best = self.any_scalar(env, &first.value)?;
        for a in rest {
            let next = self.any_scalar(env, &a.value)?;
            if next.dim != best.dim {
                let d = Diagnostic::error(
                    codes::DIMENSION,
                    format!("{} against {}", best.dim, next.dim),
                    a.value.at,
                )
                .label(next.dim.to_string())
                .also(first.value.at, best.dim.to_string());
                return self.fail(d);
            }
            let node =
                if f.node == "min" { Node::Min(best.id, next.id) } else { Node::Max(best.id, next.id) };
            best.id = self.node(node, at)?;
        }
        Ok(Value::Scalar(best))
    }

    /// `polar(r, φ)`: the vector of length r turned by φ from +x about +z.
    fn polar(&mut self, env: &Env, f: &Ident, args: &'a [Argument], at: Origin) -> Outcome<Value> {
        let [r, phi] = self.fixed_arguments(f, args, ["r", "φ"])?;
        let r = self.eval_scalar(env, r, Dimension::LENGTH, "the radius of `polar`");
        let phi = self.eval_scalar(env, phi, Dimension::ANGLE, "the angle of `polar`");
        let [x, y] = self.polar_components(r?, phi?, at)?;
        let z = self.constant(0.0, at)?;
        Ok(Value::Vector { v: [x, y, z], dim: Dimension::LENGTH, literal: false })
    }

    /// (r cos φ, r sin φ)
    pub(super) fn polar_components(&mut self, r: ExprId, phi: ExprId, at: Origin) -> Outcome<[ExprId; 2]> {
        let (c, s) = match self.exprs.as_constant(phi).and_then(quarter_turn) {
            Some((c, s)) => (self.constant(c, at)?, self.constant(s, at)?),
            None => (self.node(Node::Cos(phi), at)?, self.node(Node::Sin(phi), at)?),
        };
        Ok([self.node(Node::Mul(r, c), at)?, self.node(Node::Mul(r, s), at)?])
    }

    fn eval_point(&mut self, env: &Env, e: &'a Expr) -> Outcome<ExprPoint> {
        let v = self.eval(env, e)?;
        self.as_point(v, e)
    }

    fn circle_value(&mut self, env: &Env, f: &Ident, args: &'a [Argument]) -> Outcome<Value> {
        let [center, radius] = self.fixed_arguments(f, args, ["center", "radius"])?;
        let c = self.eval_point(env, center);
        let r = self.eval_scalar(env, radius, Dimension::LENGTH, "the radius of `circle`");
        let (c, r) = (c?, r?);
        if self.start_value(r) <= 0.0 {
            let shown = self.show(self.start_value(r), Dimension::LENGTH);
            return self.fail(
                Diagnostic::error(codes::SIZE, "the radius of a circle must be positive", radius.at)
                    .label(format!("this is {shown}")),
            );
        }
        Ok(Value::Circle { center: c, radius: r })
    }

    fn distance(&mut self, env: &Env, f: &Ident, args: &'a [Argument], at: Origin) -> Outcome<Value> {
        let [a, b] = self.fixed_arguments(f, args, ["A", "B"])?;
        let p = self.eval_point(env, a);
        let q = self.eval_point(env, b);
        let d = self.pairwise(p?, q?, at, Node::Sub)?;
        let d2 = self.dot(d, d, at)?;
        Ok(Value::Scalar(Scalar { id: self.node(Node::Sqrt(d2), at)?, dim: Dimension::LENGTH }))
    }

    fn dot(&mut self, a: ExprPoint, b: ExprPoint, at: Origin) -> Outcome<ExprId> {
        let p = self.pairwise(a, b, at, Node::Mul)?;
        let xy = self.node(Node::Add(p[0], p[1]), at)?;
        self.node(Node::Add(xy, p[2]), at)
    }

    /// `meet(circle(A, r), circle(B, s), left|right)`: with d = |AB|, the foot of the common chord lies
    /// a = (d² + r² − s²)/2d from A along AB, the meeting points ±√(r² − a²) beside it.
    fn meet(&mut self, env: &Env, f: &Ident, args: &'a [Argument], at: Origin) -> Outcome<Value> {
        let [first, second, side] = self.fixed_arguments(f, args, ["first", "second", "side"])?;
        let one = self.eval_circle(env, first);
        let two = self.eval_circle(env, second);
        let left = match &side.kind {
            ExprKind::Name(n) if n.len() == 1 && n.iter().all(|n| n.node == "left") => true,
            ExprKind::Name(n) if n.len() == 1 && n.iter().all(|n| n.node == "right") => false,
            _ => {
                return self.fail(
                    Diagnostic::error(codes::ARGUMENTS, "the side must be `left` or `right`", side.at)
                        .help("seen from +z, looking from the first centre to the second"),
                );
            }
        };
        let ((a, r), (b, s)) = (one?, two?);
        let apart = self.start_value(a[2]) - self.start_value(b[2]);
        if apart.abs() > 1e-9 {
            let shown = self.show(apart.abs(), Dimension::LENGTH);
            return self.fail(
                Diagnostic::error(codes::PLANE, "these circles do not lie in one plane", at)
                    .label(format!("their centres differ by {shown} in z")),
            );
        }
        self.check_meeting((a, r), (b, s), at)?;
        let d = self.pairwise(b, a, at, Node::Sub)?;
        let zero = self.constant(0.0, at)?;
        let flat = [d[0], d[1], zero];
        let d2 = self.dot(flat, flat, at)?;
        let d1 = self.node(Node::Sqrt(d2), at)?;
        let r2 = self.node(Node::Mul(r, r), at)?;
        let s2 = self.node(Node::Mul(s, s), at)?;
        let sum = self.node(Node::Add(d2, r2), at)?;
        let sum = self.node(Node::Sub(sum, s2), at)?;
        let twice = self.constant(2.0, at)?;
        let twice = self.node(Node::Mul(twice, d1), at)?;
        let foot = self.node(Node::Div(sum, twice), at)?;
        let foot2 = self.node(Node::Mul(foot, foot), at)?;
        let h2 = self.node(Node::Sub(r2, foot2), at)?;
        let h = match self.exprs.as_constant(h2) {
            Some(v) if v <= 0.0 => zero,
            _ => self.node(Node::Sqrt(h2), at)?,
        };
        let ux = self.node(Node::Div(d[0], d1), at)?;
        let uy = self.node(Node::Div(d[1], d1), at)?;
        let (along_x, along_y) = (self.node(Node::Mul(foot, ux), at)?, self.node(Node::Mul(foot, uy), at)?);
        let (beside_x, beside_y) = (self.node(Node::Mul(h, uy), at)?, self.node(Node::Mul(h, ux), at)?);
        let x = self.node(Node::Add(a[0], along_x), at)?;
        let y = self.node(Node::Add(a[1], along_y), at)?;
        // Left of the ray is (−u_y, u_x).
        let (x, y) = if left {
            (self.node(Node::Sub(x, beside_x), at)?, self.node(Node::Add(y, beside_y), at)?)
        } else {
            (self.node(Node::Add(x, beside_x), at)?, self.node(Node::Sub(y, beside_y), at)?)
        };
        Ok(Value::Point([x, y, a[2]]))
    }

    fn eval_circle(&mut self, env: &Env, e: &'a Expr) -> Outcome<(ExprPoint, ExprId)> {
        match self.eval(env, e)? {
            Value::Circle { center, radius } => Ok((center, radius)),
            other => self.fail(
                Diagnostic::error(codes::TYPE, format!("a circle is needed, this is {}", other.a()), e.at)
                    .help("write `circle(A, 50 mm)`"),
            ),
        }
    }

    /// Says by how much two circles miss each other, in mm.
    fn check_meeting(
        &mut self,
        one: (ExprPoint, ExprId),
        two: (ExprPoint, ExprId),
        at: Origin,
    ) -> Outcome<()> {
        let v = |id| self.start_value(id);
        let (r, s) = (v(one.1), v(two.1));
        let d = (v(two.0[0]) - v(one.0[0])).hypot(v(two.0[1]) - v(one.0[1]));
        let slack = TANGENT * (r + s);
        let why = if d <= slack {
            "they have the same centre".to_string()
        } else if d > r + s + slack {
            format!(
                "they miss each other by {}: the centres are {} apart, the radii reach {}",
                self.show(d - r - s, Dimension::LENGTH),
                self.show(d, Dimension::LENGTH),
                self.show(r + s, Dimension::LENGTH)
            )
        } else if d < (r - s).abs() - slack {
            format!(
                "one lies inside the other, {} from touching it",
                self.show((r - s).abs() - d, Dimension::LENGTH)
            )
        } else {
            return Ok(());
        };
        self.fail(
            Diagnostic::error(codes::NO_MEETING, "these circles do not meet", at)
                .label(why)
                .help("change a radius or move a centre"),
        )
    }
}

/// Cosine and sine of a multiple of a right angle, exactly: `polar(r, 90 deg)` is (0, r), not (1e-15, r).
fn quarter_turn(phi: f64) -> Option<(f64, f64)> {
    let turns = phi / std::f64::consts::FRAC_PI_2;
    if (turns - turns.round()).abs() > 4.0 * f64::EPSILON * turns.abs() || turns.abs() > 1e6 {
        return None;
    }
    Some(match (turns.round() as i64).rem_euclid(4) {
        0 => (1.0, 0.0),
        1 => (0.0, 1.0),
        2 => (-1.0, 0.0),
        _ => (0.0, -1.0),
    })
}

fn ascii(name: &str) -> &str {
    if name == "φ" { "phi" } else { name }
}
