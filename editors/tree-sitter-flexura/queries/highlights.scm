; Later patterns count more where several match.
(identifier) @variable

[
  "edition" "use" "mechanism" "flexure" "replaces" "material" "process" "motor" "param" "let" "point" "ground" "link"
  "links" "model" "height" "print" "on" "cycle" "steps" "over" "drive" "from" "to" "by" "with" "continuous" "drum"
  "rest" "at" "trace" "minimize" "weight" "require" "export" "rod" "along" "section" "keys" "linear" "smooth" "and"
  "output" "target" "about" "direction" "axis" "layer" "pin" "fillet" "into" "toward" "as" "free" "body" "first" "second"
  "place" "turned" "scale" "merging" "mirror" "across" "sharing" "load" "gravity" "hole" "moment" "workspace" "allow"
  "string" "via" "assert" "variant" "for" "case" "mount" "horn" "plate" "solid" "thick" "clearance" "deep" "margin"
  "fatigue" "spring" "stop" "sweep" "tolerance"
] @keyword
(cycle "in" @keyword)
(for "in" @keyword)
(free "in" @keyword)
(stretch "in" @keyword)
(kind) @keyword

(mechanism name: (identifier) @type)
(flexure name: (identifier) @type)
(record name: (identifier) @type)
(template name: (identifier) @type)
(place mechanism: (identifier) @type)
(drive motor: (identifier) @type)
(mount motor: (identifier) @type)
(horn motor: (identifier) @type)
(material (identifier) @type)
(print (identifier) @type)
(dimension) @type

(param name: (identifier) @variable.parameter)
(field name: (identifier) @property)
(argument name: (identifier) @variable.parameter)
(call function: (identifier) @function)
(model (identifier) @constant)
(mirror plane: (identifier) @constant)
(allow code: (identifier) @constant)
(import target: (path) @module)

(digits) @number
(integer) @number
(unit) @type.builtin
(text) @string
(comment) @comment
(doc_comment) @comment.documentation

["+" "-" "*" "/" "^" "=" ".." (compare)] @operator
["(" ")" "{" "}" "[" "]"] @punctuation.bracket
["," ":" "."] @punctuation.delimiter
