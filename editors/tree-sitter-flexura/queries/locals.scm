(mechanism) @local.scope
(flexure) @local.scope

(param name: (identifier) @local.definition)
(let name: (identifier) @local.definition)
(point name: (identifier) @local.definition)
(body name: (identifier) @local.definition)
(own_body name: (identifier) @local.definition)
(joint name: (identifier) @local.definition)
(trace name: (identifier) @local.definition)
(output name: (identifier) @local.definition)
(place name: (identifier) @local.definition)
(mirror name: (identifier) @local.definition)
(identifier) @local.reference
