[
  (block) (fields) (overrides) (minimize) (rod) (variant) (keys) (tuple) (call)
] @indent

["}" ")"] @outdent
