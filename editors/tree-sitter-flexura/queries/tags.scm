(mechanism name: (identifier) @name) @definition.class
(flexure name: (identifier) @name) @definition.class
(record name: (identifier) @name) @definition.constant
(param name: (identifier) @name) @definition.field
(joint name: (identifier) @name) @definition.field
(template name: (identifier) @name) @reference.class
(place mechanism: (identifier) @name) @reference.class
