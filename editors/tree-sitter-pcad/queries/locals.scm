; After `local.definition.` comes what Helix is to show for the name wherever it is used.

[
  (function_declaration)
  (kernel_declaration)
  (function)
  (body)
  (for_statement)
  (block)
  (plan)
] @local.scope

(include_declaration
  alias: (name) @local.definition.namespace)

(parameter
  name: (name) @local.definition.variable.parameter)

(for_statement
  variable: (name) @local.definition.variable)

(let_statement
  name: (name) @local.definition.variable)

(draw_statement
  target: (variable) @local.definition.variable)

(variable) @local.reference
