; The names of captures are those of Helix, of which Neovim knows the first parts, such as
; `constant` of `constant.numeric`. Later patterns win, and of two captures the second.

[
  (name)
  (variable)
] @variable

((variable) @constant.builtin
  (#any-of? @constant.builtin "pi" "inf"))

; Declarations

(type) @type

(include_declaration
  alias: (name) @module @namespace)

(function_declaration
  name: (name) @function)

(kernel_declaration
  name: (name) @function)

(infer_block
  name: (name) @function)

(parameter
  name: (name) @variable.parameter)

; Expressions

(call
  function: (variable) @function)

(field
  field: (name) @variable.other.member)

(call
  function: (field
    field: (name) @function))

(named_argument
  name: (name) @variable.parameter)

(record_field
  name: (name) @variable.other.member)

(number) @constant.numeric

(boolean) @constant.builtin.boolean

(string) @string

(escape_sequence) @constant.character.escape

; Words

"include" @keyword.control.import

[
  "param"
  "data"
  "kernel"
  "infer"
  "report"
  "export"
  "as"
  "to"
  "assume"
  "let"
  "observe"
  "with"
  "coarse"
  "predict"
  "factor"
  "force"
  "freeze"
  "forget"
  "sample"
  "mix"
  "collect"
  "propose"
] @keyword

"fn" @keyword.function

[
  "if"
  "else"
] @keyword.control.conditional

[
  "for"
  "in"
  "warmup"
  "repeat"
  "every"
  "stop"
  "when"
] @keyword.control.repeat

[
  "or"
  "and"
  "not"
] @keyword.operator

; Punctuation

[
  "~"
  "="
  "=>"
  ".."
  "=="
  "!="
  "<"
  "<="
  ">"
  ">="
  "+"
  "-"
  "*"
  "/"
  "%"
  "&"
  "**"
] @operator

[
  "("
  ")"
  "["
  "]"
  "{"
  "}"
] @punctuation.bracket

[
  ","
  ";"
  ":"
  "."
] @punctuation.delimiter

; Tags, tag selections, addresses

(tag
  [
    "#"
    ":"
  ] @attribute)

(tag
  name: (name) @attribute)

(tag_selection
  [
    "$"
    ":"
  ] @attribute)

(tag_selection
  name: (name) @attribute)

(tag_selection
  value: (tag_value) @attribute)

(address) @label

(segment
  [
    "["
    "]"
  ] @label)

(segment
  name: (_) @label)

(segment
  key: [
    (name)
    (any)
  ] @label)

(occurrence) @label

; Comments

(line_comment) @comment.line

(block_comment) @comment.block
