[
  (body)
  (block)
  (plan)
  (mix_statement)
  (arguments)
  (parameters)
  (array)
  (record)
  (block_comment)
] @fold
