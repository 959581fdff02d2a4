//! The words a line may start with, the form of each statement, and the nearest word to a typo.

use super::tree::Kind;

/// Words that start a top-level declaration.
pub(super) const ITEM_WORDS: &[&str] =
    &["edition", "use", "mechanism", "flexure", "material", "process", "motor", "allow"];

/// Words that start a statement inside a block.
pub(super) const STATEMENT_WORDS: &[&str] = &[
    "param",
    "let",
    "point",
    "ground",
    "link",
    "hinge",
    "ball",
    "universal",
    "slider",
    "cylindrical",
    "fixed",
    "material",
    "print",
    "links",
    "model",
    "cycle",
    "drive",
    "rest",
    "trace",
    "minimize",
    "require",
    "export",
    "rod",
    "body",
    "load",
    "string",
    "allow",
    "assert",
    "case",
    "fatigue",
    "for",
    "hole",
    "horn",
    "mirror",
    "mount",
    "output",
    "place",
    "plate",
    "solid",
    "spring",
    "stop",
    "sweep",
    "target",
    "tolerance",
    "variant",
    "workspace",
];

/// Those of [`STATEMENT_WORDS`] whose statements a later version will understand.
const LATER_WORDS: &[&str] = &["fatigue", "spring", "stop", "sweep", "tolerance"];

/// Words that can start a line in a block of a kind, or at the top of a file for [`Kind::File`].
pub(super) fn starting(block: Kind) -> Vec<&'static str> {
    const IN_FLEXURE: &[&str] = &["param", "let", "body", "rod", "allow"];
    match block {
        Kind::File => ITEM_WORDS.to_vec(),
        Kind::Mechanism => {
            let own = |w: &&&str| !LATER_WORDS.contains(w) && !matches!(**w, "body" | "rod");
            STATEMENT_WORDS.iter().filter(own).copied().collect()
        }
        Kind::Flexure => IN_FLEXURE.to_vec(),
        Kind::For => vec!["place", "mirror", "require", "export", "for"],
        Kind::Case => vec!["load", "minimize", "require"],
        _ => Vec::new(),
    }
}

/// Whether a line starts a statement, as `statement_start` of the grammar has it.
pub(super) fn starts_statement(line: &str) -> bool {
    let line = line.trim_start_matches([' ', '\t']);
    let end = line.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(line.len());
    let (word, rest) = line.split_at(end);
    let next = rest.trim_start_matches([' ', '\t']);
    next.len() < rest.len()
        && next.starts_with(|c: char| c.is_ascii_alphanumeric() || "_{\"".contains(c))
        && (STATEMENT_WORDS.contains(&word) || ITEM_WORDS.contains(&word))
}

/// How many of [`STATEMENT_WORDS`], which begins with the common ones, help lists.
pub(super) const COMMON_STATEMENTS: usize = 24;

/// Whether a keyword is a kind of joint.
pub(super) fn is_joint_kind(word: &str) -> bool {
    matches!(word, "hinge" | "ball" | "universal" | "slider" | "cylindrical" | "fixed")
}

/// How a statement is written, by the word it starts with.
pub(super) fn form(word: &str) -> Option<&'static str> {
    Some(match word {
        "edition" => "edition 1",
        "use" => "use std.materials.NAME` or `use \"file.mech\"",
        "mechanism" => "mechanism NAME {",
        "flexure" => "flexure NAME replaces KIND {",
        "process" => "process NAME {",
        "motor" => "motor NAME {",
        "param" => "param NAME: DIMENSION = VALUE",
        "let" => "let NAME = VALUE",
        "point" => "point NAME = (X, Y)",
        "ground" => "ground NAME { POINT, … }",
        "link" => "link NAME { POINT, … }",
        word if is_joint_kind(word) => "KIND NAME: BODY to BODY at POINT",
        "material" => "material NAME",
        "print" => "print on PROCESS",
        "links" => "links height LENGTH` or `links fillet RADIUS",
        "model" => "model corrected` or `model plain",
        "cycle" => "cycle NUMBER steps over TIME",
        "drive" => "drive JOINT from VALUE to VALUE with MOTOR",
        "rest" => "rest JOINT at VALUE",
        "trace" => "trace NAME = POINT on BODY",
        "output" => "output NAME = angle(BODY about AXIS)",
        "workspace" => "workspace OUTPUT by DRIVE from VALUE to VALUE in NUMBER steps",
        "target" => "target TRACE = path(\"FILE.csv\")",
        "minimize" => "minimize {",
        "term" => "TERM(…) weight NUMBER",
        "field" => "NAME = VALUE",
        "require" => "require VALUE <= VALUE",
        "export" => "export NAME, …",
        "place" => "place NAME = MECHANISM at POINT",
        "mirror" => "mirror NAME = INSTANCE across yz",
        "body" => "body NAME",
        "rod" => "rod NAME { from a at … along … to b at … along … section … }",
        "assert" => "assert VALUE <= VALUE \"MESSAGE\"",
        "variant" => "variant NAME { NAME = VALUE, … }",
        "for" => "for NAME in FIRST .. LAST {",
        "case" => "case NAME {",
        "string" => "string NAME: BODY at POINT to BODY via POINT",
        "allow" => "allow CODE \"REASON\"",
        "hole" => "hole DIAMETER on BODY at POINT",
        "mount" => "mount MOTOR on BODY at POINT",
        "horn" => "horn MOTOR on BODY at POINT",
        "plate" => "plate THICKNESS on BODY",
        "solid" => "solid \"FILE.stl\" on BODY at POINT",
        "load" => "load FORCE along DIRECTION on BODY at POINT",
        _ => return None,
    })
}

/// The known word that a misspelt one most likely stands for.
pub(super) fn nearest<'a>(word: &str, known: &[&'a str]) -> Option<&'a str> {
    let lower = word.to_ascii_lowercase();
    // A third of the letters may be wrong, transposed neighbours count once.
    let limit = (word.len() / 3).max(1);
    known
        .iter()
        .map(|k| (strsim::damerau_levenshtein(&lower, k), *k))
        .filter(|(distance, _)| *distance <= limit)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, k)| k)
}
