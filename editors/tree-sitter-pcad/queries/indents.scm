; For Helix.

[
  (body)
  (block)
  (plan)
  (mix_statement)
  (arguments)
  (parameters)
  (parenthesized)
  (array)
  (record)
] @indent

[
  ")"
  "]"
  "}"
] @outdent
