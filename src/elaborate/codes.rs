//! Every diagnostic of elaboration with a one-line summary: the single list of codes.

/// A code and what it stands for.
pub struct Code {
    /// Stable code.
    pub code: &'static str,
    /// One line.
    pub summary: &'static str,
}

macro_rules! codes {
    ($($name:ident $code:literal $summary:literal;)*) => {
        $(#[doc = $summary] pub const $name: &str = $code;)*
        /// All codes in order.
        pub const ALL: &[Code] = &[$(Code { code: $code, summary: $summary }),*];
    };
}

codes! {
    UNKNOWN_NAME "E0101" "a name that is declared nowhere in reach";
    DUPLICATE "E0102" "a name declared twice";
    SHADOWING "E0103" "a name that hides one of an outer scope";
    PRIVATE "E0104" "a private name (leading `_`) used from outside";
    CYCLE "E0105" "declarations that need each other in a circle";
    IMPORT_CYCLE "E0106" "files that import each other in a circle";
    IMPORT_UNKNOWN "E0107" "an import that does not exist";
    IMPORT_REFUSED "E0108" "an import path that could leave the design's folder";
    IMPORT_UNREADABLE "E0109" "a file that cannot be read";
    UNKNOWN_FUNCTION "E0110" "a function that does not exist";
    UNKNOWN_FIELD "E0111" "a field that a record does not have or does not state";
    UNKNOWN_UNIT "E0112" "a unit that does not exist";
    UNKNOWN_TYPE "E0113" "a declared type that does not exist";
    SET_UNKNOWN "E0114" "`--set` of something that cannot be set";
    SET_SYNTAX "E0115" "`--set` with a value that is not an expression";
    EDITION "E0116" "an edition this version does not know";
    NO_VARIANT "E0117" "a variant that does not exist";
    DIMENSION "E0201" "dimensions that do not fit";
    MISSING_UNIT "E0202" "a bare number where a quantity is needed";
    TYPE "E0203" "a value of the wrong type";
    ARGUMENTS "E0204" "wrong arguments of a function";
    ROOT "E0205" "the square root of a dimension with an odd exponent";
    EXPONENT "E0206" "an exponent that is not a small integer";
    FREE_BOUNDS "E0207" "a `free` whose bounds do not contain its start";
    FREE_PLACE "E0208" "a `free` where nothing may vary";
    FREE_NESTED "E0209" "a `free` whose start or bounds depend on a free value";
    NOT_FIXED "E0210" "a free value where a fixed number is needed";
    NO_MEETING "E0301" "circles that do not meet";
    NOT_FINITE "E0302" "a result that is not a finite number";
    AXIS "E0303" "a joint axis that is missing or zero";
    END_FRAME "E0304" "a template end frame that is not determined";
    SIZE "E0305" "a size that must be positive";
    PLANE "E0306" "circles that do not lie in one plane";
    NO_MECHANISM "E0401" "a file without a mechanism";
    MISSING "E0402" "a statement that every mechanism needs is missing";
    REPEATED "E0403" "a statement that may stand only once";
    NO_GROUND "E0404" "a mechanism without a ground body";
    JOINT_BODIES "E0405" "bodies of a joint that are not different, or not those its flexure joins";
    WRONG_KIND "E0406" "a name of the wrong kind";
    TEMPLATE_KIND "E0407" "a template that does not replace this kind of joint";
    QUERY "E0408" "a requirement that does not compare a query with a quantity";
    REST "E0409" "a rest value for a joint that is not driven";
    MOTOR_RANGE "E0410" "a drive beyond its motor's range";
    RECORD "E0411" "a record that lacks a field it needs, or has one that is wrong";
    TOO_LARGE "E0412" "a design beyond the limits of the compiler";
    COUNT "E0413" "a count or duration that is not positive and whole where it must be";
    MISPLACED "E0414" "a statement that does not belong here";
    EXPORT "E0415" "an export that lacks what it needs";
    KEYS "E0416" "keys of a drive that do not run from 0 % to 100 %";
    NOT_DRIVEN "E0417" "a drive of a joint that has no single value";
    ASSERTION "E0418" "an assertion that does not hold";
    INDEX "E0419" "an index that is no whole number";
    MODEL "E0430" "a theory of flexures that does not exist";
    TAPER "E0431" "a rod between sections of different shape";
    NONCONSERVATIVE "E0440" "a moment whose work would depend on the way";
    WEIGHTLESS "E0441" "gravity on a material that states no density";
    NO_TARGET "E0442" "the error of a trace without a target";
    STRING "E0443" "a string that cannot pull";
    DRUM "E0444" "a motor on something that slides without a drum, or a drum without need";
    TARGET "E0450" "a target that is no path";
    EMPHASIS "E0451" "an emphasis that is negative, or zero all over the cycle";
    WORKSPACE "E0452" "a workspace whose outputs or drives do not fit";
    CYCLES_DIFFER "E0460" "instances whose cycles differ";
    SHARED "E0461" "a body that a mirrored instance cannot share";
    MIXED "E0462" "one body of two materials or processes";
    FITTING "E0463" "a mount or horn that its motor or its place does not allow";
    SOLID_FILE "E0464" "a file that cannot become a solid: no STL, empty, too large, no places";
    LATER_STATEMENT "E0901" "a statement that is not available yet";
    LATER_TERM "E0902" "an objective, query, export or function that is not available yet";
    LATER_JOINT "E0903" "a kind of joint that is not available yet";
    UNUSED_IMPORT "W0101" "an import that is not used";
    IDLE_FREE "W0201" "a `free` value that nothing depends on";
    INSIDE_OUT "W0464" "a solid whose file is inside out";
}

#[cfg(test)]
mod tests {
    #[test]
    fn codes_are_unique_and_sorted_within_their_letter() {
        for pair in super::ALL.windows(2) {
            if pair[0].code.as_bytes()[0] == pair[1].code.as_bytes()[0] {
                assert!(pair[0].code < pair[1].code, "{} {}", pair[0].code, pair[1].code);
            }
        }
    }
}
