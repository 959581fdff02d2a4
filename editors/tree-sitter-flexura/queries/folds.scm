[
  (mechanism) (flexure) (record) (minimize) (rod) (variant) (for) (case) (keys) (overrides) (tuple)
] @fold
