//! The text front end: text to tree to AST, recovery and diagnostics.

use flexura::syntax::parse;

const CHEBYSHEV: &str = include_str!("syntax/samples/chebyshev.mech");
const CROSSED_LEAVES: &str = include_str!("syntax/samples/crossed_leaves.mech");

#[test]
fn samples_parse_without_a_diagnostic_and_print_back() {
    for text in [CHEBYSHEV, CROSSED_LEAVES] {
        let parse = parse(0, text);
        assert_eq!(parse.tree.print(text), text);
        assert_eq!(parse.diagnostics, []);
    }
}
