/**
 * `.mech` files for editors: colours, folds and indentation that survive a text in the making. What the language is, says
 * grammar/mech.pest; this one is wider where a mistake is better told by the compiler.
 *
 * A statement ends with its line, unless the next one begins with an operator or a bracket is open: the scanner decides.
 */
const UNIT =
  "(µm|um|mm|cm|m|rad|deg|turn|mN|kN|N|lbf|Pa|kPa|MPa|GPa|kg|g|ms|s)(\\^-?[0-9]+)?";

const commas = (rule) => seq(rule, repeat(seq(",", rule)));

module.exports = grammar({
  name: "flexura",
  word: ($) => $.identifier,
  externals: ($) => [$._end, $._never],
  extras: ($) => [/\s/, /\uFEFF/, $.doc_comment, $.comment],
  // `1 in` is an inch, `free 1 in 0 .. 2` a number and its bounds.
  conflicts: ($) => [[$.number]],
  supertypes: ($) => [$._statement],

  rules: {
    source_file: ($) =>
      repeat(choice($.edition, $.import, seq($.allow, $._end), $.mechanism, $.flexure, $.record)),

    doc_comment: (_) => token(prec(1, seq("//", /[/!]/, /[^\r\n]*/))),
    comment: (_) => token(seq("//", /[^\r\n]*/)),

    // Items of a file.
    edition: ($) => seq("edition", alias(/[0-9]+/, $.integer), $._end),
    import: ($) => seq("use", field("target", choice($.text, $.path)), $._end),
    path: ($) => seq($.identifier, repeat(seq(".", $.identifier))),
    mechanism: ($) => seq("mechanism", field("name", $.identifier), $.block),
    flexure: ($) =>
      seq("flexure", field("name", $.identifier), "replaces", field("kind", $._kind), $.block),
    record: ($) =>
      seq(
        field("kind", choice("material", "process", "motor")),
        field("name", $.identifier),
        alias($._fields, $.fields),
      ),
    _fields: ($) => seq("{", repeat(seq($.field, $._gap)), "}"),
    field: ($) => seq(field("name", $.identifier), "=", field("value", $._value)),
    _gap: ($) => choice(",", $._end),
    block: ($) => seq("{", repeat(seq($._statement, $._end)), "}"),

    _statement: ($) =>
      choice(
        $.param, $.let, $.point, $.body, $.own_body, $.joint, $.material, $.print, $.links, $.model, $.cycle,
        $.drive, $.rest, $.trace, $.output, $.target, $.minimize, $.require, $.export, $.rod, $.load, $.hole,
        $.mount, $.horn, $.plate, $.solid, $.string, $.place, $.mirror, $.allow, $.assert, $.variant, $.for, $.case, $.workspace, $.later,
      ),

    // Names and numbers.
    param: ($) =>
      seq("param", field("name", $.identifier), optional(seq(":", field("type", alias($.identifier, $.dimension)))), "=", field("value", $._value)),
    let: ($) => seq("let", field("name", $.identifier), "=", field("value", $._value)),
    point: ($) => seq("point", field("name", $.identifier), "=", field("value", $._value)),
    assert: ($) => seq("assert", $._value, $.compare, $._value, $.text),
    variant: ($) => seq("variant", field("name", $.identifier), "{", repeat(seq($.setting, $._gap)), "}"),
    setting: ($) => seq(alias($.path, $.name), "=", field("value", $._value)),
    for: ($) => seq("for", field("name", $.identifier), "in", $._value, "..", $._value, $.block),

    // Bodies and joints.
    body: ($) => seq(choice("ground", "link"), field("name", $.identifier), $.points, optional($.layer)),
    own_body: ($) => seq("body", field("name", $.identifier), optional($.points)),
    points: ($) => seq("{", optional(commas($.identifier)), optional(","), "}"),
    layer: ($) => seq("layer", $._value),
    _kind: ($) => alias(choice("hinge", "ball", "universal", "slider", "cylindrical", "fixed"), $.kind),
    joint: ($) =>
      seq(
        field("kind", $._kind), field("name", $.identifier), ":", field("body", $.identifier),
        "to", commas(field("body", $.identifier)), "at", field("at", $._value),
        repeat(choice($.axis, $.layer, $.pin, $.fillet, $.into, $.template)),
      ),
    axis: ($) => seq("axis", $._value, optional(seq("and", $._value))),
    pin: ($) => seq("pin", $._value),
    fillet: ($) => seq("fillet", $._value),
    into: ($) => seq("into", $.identifier, "toward", $._value),
    template: ($) => seq("as", field("name", $.identifier), optional(alias($._fields, $.overrides))),
    links: ($) =>
      seq(
        "links",
        choice(seq("height", $._value, optional($.fillet)), seq($.fillet, optional(seq("height", $._value)))),
      ),
    model: ($) => seq("model", $.identifier),
    hole: ($) => seq("hole", $._value, "on", $._body_ref, "at", $._value, optional(seq("along", $._value))),
    _body_ref: ($) => seq($.identifier, optional($.index), optional(seq(".", $.identifier))),
    _fitted: ($) => seq(field("motor", $.identifier), "on", $._body_ref, "at", $._value),
    mount: ($) => seq("mount", $._fitted, repeat(seq(choice("along", "toward", "thick", "clearance"), $._value))),
    horn: ($) => seq("horn", $._fitted, repeat(seq(choice("deep", "clearance"), $._value))),
    plate: ($) => seq("plate", $._value, "on", $._body_ref, optional(seq("margin", $._value))),
    solid: ($) => seq("solid", field("file", $.text), "on", $._body_ref, repeat(choice(seq("at", $._value), $.turned, $.scaled))),
    string: ($) =>
      seq("string", field("name", $.identifier), ":", $.identifier, "at", $._value, "to", $.identifier, "via", commas($._value)),

    // What it is made of, and how it moves.
    material: ($) => seq("material", $.identifier),
    print: ($) => seq("print", "on", $.identifier),
    cycle: ($) => seq("cycle", optional("in"), $._value, "steps", optional(seq("over", $._value))),
    drive: ($) =>
      seq(
        "drive", field("joint", $.identifier), choice($.profile, seq("by", choice($._value, $.keys))),
        optional(seq("with", field("motor", $.identifier), repeat(choice("continuous", seq("drum", $._value))))),
      ),
    profile: ($) => seq("from", $._value, "to", $._value),
    keys: ($) => seq("keys", choice("linear", "smooth"), "{", repeat(seq($.key, $._gap)), "}"),
    key: ($) => seq($._value, ":", $._value),
    rest: ($) => seq("rest", field("joint", $.identifier), "at", $._value),
    load: ($) =>
      seq(
        "load",
        choice(
          seq("gravity", $._value),
          seq("moment", $._value, "about", $._value, "on", $.identifier),
          seq($._value, "along", $._value, "on", $.identifier, "at", $._value),
        ),
      ),
    case: ($) => seq("case", field("name", $.identifier), $.block),

    // What is watched, wanted and made.
    trace: ($) =>
      seq("trace", field("name", $.identifier), "=", optional("direction"), $._value, "on", $.identifier),
    output: ($) => seq("output", field("name", $.identifier), "=", $._value),
    target: ($) => seq("target", field("name", $.identifier), "=", $._value),
    minimize: ($) => seq("minimize", "{", repeat(seq($.term, $._gap)), "}"),
    term: ($) => seq($.call, optional(seq("weight", $._value))),
    require: ($) => seq("require", $._value, $.compare, $._value),
    export: ($) => seq("export", commas(choice($.call, $.name, alias("3mf", $.identifier)))),
    allow: ($) => seq("allow", field("code", $.identifier), $.text),
    workspace: ($) => seq("workspace", commas($.name), "by", commas($.stretch)),
    stretch: ($) => seq($.identifier, $.profile, optional(seq("in", $._value, "steps"))),

    // Flexures.
    rod: ($) =>
      seq(
        "rod", field("name", $.identifier), "{", optional(seq("axis", choice("first", "second"))),
        $.rod_from, $.rod_to, $.rod_section, "}",
      ),
    rod_from: ($) => seq("from", $._rod_end),
    rod_to: ($) => seq("to", $._rod_end),
    _rod_end: ($) => seq($.identifier, "at", $._value, "along", $._value),
    rod_section: ($) => seq("section", $._value, optional(seq("to", $._value))),

    // Several of a kind.
    place: ($) =>
      seq(
        "place", field("name", $.identifier), optional($.index), "=", field("mechanism", $.identifier),
        optional(alias($._fields, $.overrides)), "at", $._value, repeat(choice($.turned, $.scaled, $.merging)),
      ),
    turned: ($) => seq("turned", $._value, "about", $._value),
    scaled: ($) => seq("scale", "=", $._value),
    merging: ($) => seq("merging", $.identifier, "into", $.identifier),
    mirror: ($) =>
      seq(
        "mirror", field("name", $.identifier), optional($.index), "=", $.identifier, optional($.index), "across",
        field("plane", $.identifier), optional(seq("sharing", commas($.identifier))),
      ),

    // Statements of the whole language that are only recognised yet.
    later: ($) =>
      seq(
        choice("fatigue", "spring", "stop", "sweep", "tolerance"),
        repeat(choice($._anything, $._later_block)),
      ),
    _anything: (_) => /[^\s{}][^\r\n{}]*/,
    _later_block: ($) => seq("{", repeat(choice($._anything, $._later_block)), "}"),

    // Expressions.
    _value: ($) => choice($.free, $._expression),
    free: ($) =>
      seq("free", field("start", $._expression), "in", field("least", $._expression), "..", field("most", $._expression)),
    _expression: ($) => choice($.sum, $.product, $.negation, $.power, $._primary),
    sum: ($) => prec.left(1, seq($._expression, choice("+", "-"), $._expression)),
    product: ($) => prec.left(2, seq($._expression, choice("*", "/"), $._expression)),
    negation: ($) => prec(3, seq("-", $._expression)),
    power: ($) => prec(4, seq($._primary, "^", alias(/-?[0-9]+/, $.integer))),
    _primary: ($) => choice($.number, $.text, $.call, $.name, $.tuple),
    tuple: ($) => seq("(", commas($._value), optional(","), ")"),
    call: ($) =>
      seq(field("function", $.identifier), token.immediate("("), optional(commas($._argument)), optional(","), ")"),
    _argument: ($) => choice($.argument, $.about, $._value),
    argument: ($) => seq(field("name", $.identifier), "=", $._value),
    about: ($) => seq($.identifier, "about", $._value),
    name: ($) => seq($.identifier, optional($.index), repeat(seq(".", $.identifier, optional($.index)))),
    index: ($) =>
      seq(token.immediate("["), $._part, repeat(seq(choice("+", "-"), $._part)), "]"),
    _part: ($) => choice($.identifier, alias(/[0-9]+/, $.integer)),
    compare: (_) => choice("<=", ">=", "<", ">"),
    text: (_) => /"[^"\r\n]*"/,
    number: ($) => seq($.digits, optional($.unit)),
    digits: (_) => /[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]+)?/,
    unit: ($) => choice($._unit, "in"),
    _unit: (_) => new RustRegex(`(${UNIT}([*/]${UNIT})*|%|°)`),
    identifier: (_) => /[A-Za-z_][A-Za-z0-9_]*/,
  },
});
