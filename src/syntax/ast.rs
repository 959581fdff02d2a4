//! Typed view of a parsed `.mech` file: what the statements say, each with its place.
//! Nothing is resolved here: names are text, numbers carry the unit they were written with.

use crate::diagnostic::Origin;

/// A value with the place it was written at.
#[derive(Clone, Debug, PartialEq)]
pub struct At<T> {
    /// The value.
    pub node: T,
    /// Its place.
    pub at: Origin,
}

/// An identifier at its place.
pub type Ident = At<String>;

/// A whole file.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct File {
    /// `edition 1`.
    pub edition: Option<At<u32>>,
    /// Imports.
    pub uses: Vec<Use>,
    /// Top-level declarations.
    pub items: Vec<Item>,
    /// `allow CODE "reason"` outside of blocks.
    pub allows: Vec<Allow>,
}

/// `allow CODE "reason"`: a finding that is known and accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct Allow {
    /// The finding's code.
    pub code: Ident,
    /// Why it is accepted.
    pub reason: At<String>,
    /// Whole statement.
    pub at: Origin,
}

/// `use std.materials.rigur` or `use "finger.mech"`.
#[derive(Clone, Debug, PartialEq)]
pub struct Use {
    /// What is imported.
    pub target: UseTarget,
    /// Whole declaration.
    pub at: Origin,
}

/// The target of an import.
#[derive(Clone, Debug, PartialEq)]
pub enum UseTarget {
    /// A dotted path into the standard library.
    Std(Vec<Ident>),
    /// A neighbouring file, relative to the importing one.
    File(At<String>),
}

/// A top-level declaration.
#[derive(Clone, Debug, PartialEq)]
pub enum Item {
    /// `mechanism NAME { … }`
    Mechanism(Mechanism),
    /// `flexure NAME replaces KIND { … }`
    Flexure(Flexure),
    /// `material NAME { field = value … }`, and likewise `process` and `motor`.
    Record(Record),
}

/// `material`, `process` or `motor` with its fields.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// `material`, `process` or `motor`.
    pub kind: Ident,
    /// Its name.
    pub name: Ident,
    /// Fields in order.
    pub fields: Vec<(Ident, Expr)>,
    /// Doc comment (`///` lines joined by newlines), empty if none.
    pub doc: String,
    /// Whole declaration.
    pub at: Origin,
}

/// `mechanism NAME { … }`
#[derive(Clone, Debug, PartialEq)]
pub struct Mechanism {
    /// Its name.
    pub name: Ident,
    /// Statements in order.
    pub statements: Vec<Statement>,
    /// Doc comment.
    pub doc: String,
    /// Whole declaration.
    pub at: Origin,
}

/// `flexure NAME replaces KIND { … }`
#[derive(Clone, Debug, PartialEq)]
pub struct Flexure {
    /// Its name.
    pub name: Ident,
    /// The joint kind it replaces, e.g. `hinge`.
    pub replaces: Ident,
    /// `param`, `let`, `body` and `rod` statements in order.
    pub statements: Vec<Statement>,
    /// Doc comment.
    pub doc: String,
    /// Whole declaration.
    pub at: Origin,
}

/// A statement with its place (the whole statement) and doc comment.
#[derive(Clone, Debug, PartialEq)]
pub struct Statement {
    /// What it says.
    pub kind: StatementKind,
    /// The whole statement, without the doc comment.
    pub at: Origin,
    /// `///` lines before it.
    pub doc: String,
}

/// Everything a statement can be.
#[derive(Clone, Debug, PartialEq)]
pub enum StatementKind {
    /// `param NAME[: TYPE] = EXPR`
    Param {
        /// Name.
        name: Ident,
        /// Declared dimension, e.g. `length`.
        ty: Option<Ident>,
        /// Default value.
        value: Expr,
    },
    /// `let NAME = EXPR`
    Let {
        /// Name.
        name: Ident,
        /// Value.
        value: Expr,
    },
    /// `point NAME = EXPR`
    Point {
        /// Name.
        name: Ident,
        /// Value.
        value: Expr,
    },
    /// `ground NAME { P, Q } [layer N]` or `link …`
    Body {
        /// True for `ground`.
        ground: bool,
        /// Name.
        name: Ident,
        /// Skeleton points.
        points: Vec<Ident>,
        /// `layer N`.
        layer: Option<Expr>,
    },
    /// `KIND NAME: A to B[, C] at P [axis D [and E]] [layer N] [pin D] [fillet R] [into BODY toward Q]… [as TEMPLATE [{ … }]]`
    Joint(Box<Joint>),
    /// `material NAME`
    Material(Ident),
    /// `print on NAME`
    PrintOn(Ident),
    /// `links [height EXPR] [fillet EXPR]`: what all links have in common.
    Links {
        /// Height of every planar link along the stacking axis.
        height: Option<Expr>,
        /// Radius where flexures enter them.
        fillet: Option<Expr>,
    },
    /// `model NAME`: theory of the flexures.
    Model(Ident),
    /// `cycle N steps [over T]`
    Cycle {
        /// Number of steps.
        steps: Expr,
        /// Duration.
        over: Option<Expr>,
    },
    /// `drive J from A to B [with MOTOR [continuous]]` and other forms.
    Drive {
        /// The driven joint.
        joint: Ident,
        /// The profile.
        profile: Profile,
        /// `with MOTOR`.
        motor: Option<Ident>,
        /// `continuous` was written.
        continuous: bool,
        /// `drum D`.
        drum: Option<Expr>,
    },
    /// `rest DRIVE at EXPR`
    Rest {
        /// The driven joint.
        joint: Ident,
        /// Its value in the rest pose (may be `free`).
        value: Expr,
    },
    /// `trace NAME = P on BODY`, `trace NAME = direction D on BODY`
    Trace {
        /// Name.
        name: Ident,
        /// `direction` was written.
        direction: bool,
        /// Point or direction.
        point: Expr,
        /// Body.
        body: Ident,
    },
    /// `output NAME = angle(BODY about D)`
    Output {
        /// Name.
        name: Ident,
        /// What is measured.
        value: Expr,
    },
    /// `workspace NAME, … by DRIVE from A to B [in N steps], …`
    Workspace(Box<Workspace>),
    /// `target TRACE = …`
    Target {
        /// The trace.
        trace: Ident,
        /// A file, a list of points, or an expression of t.
        value: Expr,
    },
    /// `minimize { TERM [weight W] … }`
    Minimize(Vec<Term>),
    /// `require EXPR <= EXPR`
    Require {
        /// Left side.
        left: Expr,
        /// Comparison.
        op: At<Compare>,
        /// Right side.
        right: Expr,
    },
    /// `export A, B(c)`
    Export(Vec<Expr>),
    /// `string NAME: BODY at P to BODY via Q, …`
    String(Box<Cable>),
    /// `load …`
    Load(Box<Load>),
    /// `hole DIAMETER on BODY at P [along D]`
    Hole(Box<Hole>),
    /// `mount MOTOR on BODY at P [along D] [toward Q] [thick T] [clearance C]`
    Mount(Box<Fitted>),
    /// `horn MOTOR on BODY at P [deep D] [clearance C]`
    Horn(Box<Fitted>),
    /// `plate THICKNESS on BODY [margin M]`
    Plate(Box<Plate>),
    /// `solid "FILE" on BODY [at P] [turned A about D]… [scale = K]`
    Solid(Box<Solid>),
    /// `rod NAME { [axis second] from a at … along … to b at … along … section … }` (templates only)
    Rod(Box<Rod>),
    /// `place NAME = MECHANISM [{ overrides }] at P [turned A about D] [scale = K] [merging GROUND into BODY]…`
    Place(Box<Place>),
    /// `mirror NAME = INSTANCE across yz [sharing BODY, …]`
    Mirror(Box<Mirror>),
    /// `assert EXPR <= EXPR "message"`
    Assert(Box<Assert>),
    /// `variant NAME { PATH = EXPR, … }`
    Variant(Box<Variant>),
    /// `for NAME in A .. B { … }`: repeats instances
    For(Box<For>),
    /// `case NAME { load … minimize { … } require … }`: the cycle once more, under other loads
    Case(Box<Case>),
    /// `body NAME`: a body that a template brings along (templates only)
    OwnBody {
        /// Name.
        name: Ident,
        /// Points written in braces: it has none.
        points: Vec<Ident>,
    },
    /// `allow CODE "reason"`
    Allow(Allow),
    /// A statement of the target language that this version does not have yet: its keyword.
    Later {
        /// Keyword.
        keyword: Ident,
    },
    /// What could not be understood; a diagnostic has been given already.
    Broken {
        /// The words in it: names that it may have declared.
        words: Vec<String>,
    },
}

/// A string that pulls.
#[derive(Clone, Debug, PartialEq)]
pub struct Cable {
    /// Name.
    pub name: Ident,
    /// The body it is tied to.
    pub from: Ident,
    /// Where.
    pub at: Expr,
    /// The body that guides it.
    pub to: Ident,
    /// Through which points of that body, in order.
    pub via: Vec<Expr>,
}

/// A motor's place on a body, or that of its horn.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The motor.
    pub motor: Ident,
    /// The body.
    pub body: Ident,
    /// Where its shaft is.
    pub point: Expr,
    /// Clauses: keyword and value.
    pub clauses: Vec<(Ident, Expr)>,
}

/// A body made as a plate.
#[derive(Clone, Debug, PartialEq)]
pub struct Plate {
    /// Thickness.
    pub thickness: Expr,
    /// The body.
    pub body: Ident,
    /// How far it reaches beyond what it carries.
    pub margin: Option<Expr>,
}

/// A mesh from a file that becomes part of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Solid {
    /// Path of the file, from the folder of the design.
    pub file: At<String>,
    /// The body.
    pub body: Ident,
    /// Where the file's origin is put.
    pub point: Option<Expr>,
    /// Turns by an angle about a direction, in their order.
    pub turned: Vec<(Expr, Expr)>,
    /// By what its lengths are multiplied.
    pub scale: Option<Expr>,
}

/// A hole through a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Hole {
    /// Diameter.
    pub diameter: Expr,
    /// The body.
    pub body: Ident,
    /// Where.
    pub point: Expr,
    /// Its direction.
    pub along: Option<Expr>,
}

/// A load on the mechanism.
#[derive(Clone, Debug, PartialEq)]
pub enum Load {
    /// `load gravity DIRECTION`
    Gravity {
        /// Where down is.
        direction: Expr,
    },
    /// `load moment SIZE about D on BODY`
    Moment {
        /// Size, may depend on t.
        size: Expr,
        /// Its axis.
        about: Expr,
        /// The body it turns.
        body: Ident,
    },
    /// `load SIZE along D on BODY at P`
    Force {
        /// Size, may depend on t.
        size: Expr,
        /// Its direction.
        along: Expr,
        /// The body it acts on.
        body: Ident,
        /// Where.
        point: Expr,
    },
}

/// A joint statement.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// `hinge`, `ball`, …
    pub kind: Ident,
    /// Name.
    pub name: Ident,
    /// First body, then the bodies after `to`.
    pub bodies: Vec<Ident>,
    /// Where.
    pub point: Expr,
    /// `axis D`: `x`, `y`, `z` as [`ExprKind::Name`], or a tuple.
    pub axis: Option<Expr>,
    /// `and E` after the axis.
    pub second_axis: Option<Expr>,
    /// `layer N`.
    pub layer: Option<Expr>,
    /// `pin D`.
    pub pin: Option<Expr>,
    /// `fillet R`.
    pub fillet: Option<Expr>,
    /// `into BODY toward Q`, each.
    pub into: Vec<(Ident, Expr)>,
    /// `as TEMPLATE { overrides }`.
    pub template: Option<TemplateUse>,
}

/// `as TEMPLATE { name = value … }`
#[derive(Clone, Debug, PartialEq)]
pub struct TemplateUse {
    /// Template name.
    pub name: Ident,
    /// Overrides in order.
    pub overrides: Vec<(Ident, Expr)>,
}

/// A mechanism put somewhere.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Name of the instance, with its index as written without spaces: `finger[i+1]`.
    pub name: Ident,
    /// The mechanism.
    pub mechanism: Ident,
    /// `{ name = value … }`: its parameters, in order.
    pub overrides: Vec<(Ident, Expr)>,
    /// Where its origin goes.
    pub point: Expr,
    /// `turned A about D`.
    pub turned: Option<(Expr, Expr)>,
    /// `scale = K`.
    pub scale: Option<Expr>,
    /// `merging GROUND into BODY`, each.
    pub merging: Vec<(Ident, Ident)>,
}

/// What must hold of a design's own numbers, before anything is solved.
#[derive(Clone, Debug, PartialEq)]
pub struct Assert {
    /// Left side.
    pub left: Expr,
    /// Comparison.
    pub op: At<Compare>,
    /// Right side.
    pub right: Expr,
    /// What to say where it does not hold.
    pub message: At<String>,
}

/// The same design with other parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Variant {
    /// Name.
    pub name: Ident,
    /// What is set to what, as by `--set`: `r`, `knee.thickness`.
    pub settings: Vec<(Ident, Expr)>,
}

/// Statements that are repeated.
#[derive(Clone, Debug, PartialEq)]
pub struct For {
    /// The number that runs.
    pub variable: Ident,
    /// Its first value.
    pub first: Expr,
    /// Its last value.
    pub last: Expr,
    /// `place`, `mirror`, `require`, `export`, `for`.
    pub statements: Vec<Statement>,
}

/// A load case: what the mechanism meets besides its own loads, and what is asked of it there.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name.
    pub name: Ident,
    /// `load`, `minimize`, `require`.
    pub statements: Vec<Statement>,
}

/// The mirror image of an instance.
#[derive(Clone, Debug, PartialEq)]
pub struct Mirror {
    /// Name of the new instance.
    pub name: Ident,
    /// The instance it is an image of.
    pub of: Ident,
    /// `yz`, `zx` or `xy`.
    pub plane: Ident,
    /// `sharing BODY, …`: bodies that both have in common.
    pub sharing: Vec<Ident>,
}

/// The profile of a drive.
#[derive(Clone, Debug, PartialEq)]
pub enum Profile {
    /// `from A to B`
    Range(Expr, Expr),
    /// `by EXPRESSION`: of t, which runs from 0 to 1.
    By(Expr),
    /// `by keys linear { 0 %: A, 25 %: B, … }`, or `smooth`
    Keys {
        /// `smooth` was written.
        smooth: bool,
        /// Time and value of each key.
        keys: Vec<(Expr, Expr)>,
        /// From `by` to `}`.
        at: Origin,
    },
}

/// A term of the objective.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The call, e.g. `track(tip, scale = 0.1 mm)`.
    pub call: Expr,
    /// `weight W`.
    pub weight: Option<Expr>,
    /// Whole term.
    pub at: Origin,
}

/// Comparison operators of `require`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compare {
    /// `<=`
    LessEqual,
    /// `<`
    Less,
    /// `>=`
    GreaterEqual,
    /// `>`
    Greater,
}

/// A rod of a template.
#[derive(Clone, Debug, PartialEq)]
pub struct Rod {
    /// Name.
    pub name: Ident,
    /// `axis second`: where it says so; true for the second axis.
    pub second_axis: Option<At<bool>>,
    /// `from BODY at … along …`
    pub from: RodEnd,
    /// `to BODY at … along …`
    pub to: RodEnd,
    /// `section …`
    pub section: Expr,
    /// `section … to …`
    pub section_to: Option<Expr>,
}

/// One end of a rod.
#[derive(Clone, Debug, PartialEq)]
pub struct RodEnd {
    /// `a`, `b`, `c`: the joint's bodies in order; or a body of the template's own.
    pub body: Ident,
    /// Position, e.g. a call of `cyl`.
    pub position: Expr,
    /// Hermite derivative, e.g. a call of `cyl`.
    pub along: Expr,
}

/// An expression at its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    /// What it is.
    pub kind: ExprKind,
    /// Its place.
    pub at: Origin,
}

/// Everything an expression can be.
#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// `2.5 mm`, `60`, `8 N*mm`, `1.2 g/cm^3`, `20 %`.
    Number {
        /// The number as written.
        value: f64,
        /// Factors of the unit in order: (`mm`, 1), (`cm`, -3) …; empty for a bare number.
        unit: Vec<UnitFactor>,
    },
    /// `r`, `rigur.strength`, `finger[2].tip` (a part with its index, written without spaces).
    Name(Vec<Ident>),
    /// `"text"`.
    Text(String),
    /// `(a, b)` or `(a, b, c)`. Plain parentheses leave no node.
    Tuple(Vec<Expr>),
    /// `-a`.
    Negate(Box<Expr>),
    /// `a + b` …
    Binary(BinaryOp, Box<Expr>, Box<Expr>),
    /// `f(a, name = b)`.
    Call {
        /// Function.
        function: Ident,
        /// Arguments.
        arguments: Vec<Argument>,
    },
    /// `free START in LOWER .. UPPER`.
    Free {
        /// Start.
        start: Box<Expr>,
        /// Lower bound.
        lower: Box<Expr>,
        /// Upper bound.
        upper: Box<Expr>,
    },
    /// `BODY about D`: only as an argument of `angle`.
    About {
        /// The body that turns.
        body: Ident,
        /// The axis.
        axis: Box<Expr>,
    },
    /// What could not be understood; a diagnostic has been given already.
    Broken,
}

/// A unit symbol with its exponent.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitFactor {
    /// Symbol as written (`mm`, `N`, `%`); the elaborator knows which exist.
    pub symbol: Ident,
    /// Exponent, negative after `/`.
    pub exponent: i32,
}

/// An argument of a call.
#[derive(Clone, Debug, PartialEq)]
pub struct Argument {
    /// `name =`, if written.
    pub name: Option<Ident>,
    /// Value.
    pub value: Expr,
}

/// Binary operators. `^` takes an integer literal exponent on the right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinaryOp {
    /// `+`
    Add,
    /// `-`
    Subtract,
    /// `*`
    Multiply,
    /// `/`
    Divide,
    /// `^`
    Power,
}

/// `workspace NAME, … by DRIVE from A to B [in N steps], …`
#[derive(Clone, Debug, PartialEq)]
pub struct Workspace {
    /// What is aimed at: names of outputs, or components of traces (`tip.x`).
    pub wanted: Vec<Expr>,
    /// The drives and how far each goes.
    pub stretches: Vec<Stretch>,
}

/// `DRIVE from A to B [in N steps]`
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// The drive.
    pub drive: Ident,
    /// Its value at one end.
    pub from: Expr,
    /// At the other.
    pub to: Expr,
    /// Number of steps of the table.
    pub steps: Option<Expr>,
}
