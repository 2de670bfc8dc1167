/**
 * Tree-sitter grammar of `.pcad` programs.
 *
 * It follows `grammar/pcad.lalrpop`, production by production: where a rule here and one
 * there have the same name, they mean the same. Operators are not ranked by precedences
 * but by nesting (`_or` … `_postfix`), as there, because this also says which operators
 * do not chain and which operands need parentheses. Addresses and tag selections are
 * single tokens there; here they are rules, whose tokens must touch each other.
 *
 * After a change: `npm run generate`, then `npm test`.
 */

/// <reference types="tree-sitter-cli/dsl" />
// @ts-check

const NAME = /[A-Za-z_][A-Za-z0-9_]*/;
const NUMBER = /[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?/;

/** Words that cannot be names; `to`, `when` and `coarse` can. */
const KEYWORDS = [
  "include", "param", "data", "fn", "kernel", "infer", "report", "export", "as",
  "assume", "let", "observe", "with", "predict", "factor", "force", "freeze", "forget", "sample",
  "for", "in", "if", "else",
  "warmup", "repeat", "every", "mix", "stop", "collect", "propose",
  "or", "and", "not", "true", "false",
];

export default grammar({
  name: "pcad",

  word: $ => $.name,

  reserved: {
    keywords: _ => KEYWORDS,
    nothing: _ => [],
  },

  extras: $ => [/[ \t\r\n\f]/, $.line_comment, $.block_comment],

  externals: $ => [
    // The `/` or `.` between two segments: whether it is one depends on what follows it.
    $._separator,
    // Not used by any rule: valid only while the parser recovers from an error.
    $._recovering,
  ],

  supertypes: $ => [$.statement, $.plan_statement, $.expression],

  rules: {
    program: $ => repeat($._item),

    // ------------------------------------------------------------------------------------
    // items

    _item: $ => choice(
      $.include_declaration,
      $.param_declaration,
      $.data_declaration,
      $.function_declaration,
      $.kernel_declaration,
      $.infer_block,
      $.report_statement,
      $.export_statement,
      $.statement,
    ),

    include_declaration: $ => seq(
      "include", field("path", $.string), optional(seq("as", field("alias", $.name))), ";",
    ),

    param_declaration: $ => seq(
      "param", field("name", $.name), optional($._type),
      "=", field("default", $.expression), optional(field("help", $.string)), ";",
    ),

    data_declaration: $ => seq(
      "data", field("name", $.name), optional($._type),
      optional(seq("=", field("default", $.expression))), optional(field("help", $.string)), ";",
    ),

    function_declaration: $ => seq(
      "fn", field("name", $.name), field("parameters", $.parameters), field("body", $.body),
    ),

    kernel_declaration: $ => seq(
      "kernel", field("name", $.name), field("parameters", $.parameters), field("body", $.plan),
    ),

    infer_block: $ => seq("infer", optional(field("name", $.name)), field("body", $.plan)),

    report_statement: $ => seq(
      "report", sep1($.expression), optional(seq("as", field("file", $.string))), ";",
    ),

    export_statement: $ => seq(
      "export", field("value", $.expression), "to", field("file", $.string), ";",
    ),

    _type: $ => seq(":", field("type", alias($.name, $.type))),

    parameters: $ => seq("(", comma($.parameter), ")"),

    parameter: $ => seq(
      field("name", $.name), optional($._type), optional(seq("=", field("default", $.expression))),
    ),

    // ------------------------------------------------------------------------------------
    // model statements

    /** A function's body: statements and the value. */
    body: $ => seq("{", repeat($.statement), optional(field("value", $._plain_expression)), "}"),

    statement: $ => choice(
      $.assume_statement,
      $.draw_statement,
      $.let_statement,
      $.observe_statement,
      $.predict_statement,
      $.factor_statement,
      $.force_statement,
      $.freeze_statement,
      $.forget_statement,
      $.sample_statement,
      $.for_statement,
      $.if_statement,
      $.expression_statement,
      // Without `;`; as the last statement of a body, it is the body's value.
      $.if_expression,
    ),

    assume_statement: $ => seq(
      "assume", field("name", $.name), $._bind, field("value", $.expression), repeat($.tag), ";",
    ),

    draw_statement: $ => seq(
      field("target", $._postfix), "~", field("value", $.expression), repeat($.tag), ";",
    ),

    let_statement: $ => seq("let", field("name", $.name), "=", field("value", $.expression), ";"),

    observe_statement: $ => seq(
      "observe", field("distribution", $.expression), "=", field("value", $.expression),
      optional(seq("with", "coarse", "=", field("coarse", $.expression))), optional($._as), ";",
    ),

    predict_statement: $ => seq(
      "predict", field("name", $.name), $._bind, field("value", $.expression), ";",
    ),

    factor_statement: $ => seq(
      "factor", "(", field("value", $.expression), ")", optional($._as), ";",
    ),

    force_statement: $ => seq(
      "force", field("target", $.expression), "=", field("value", $.expression), ";",
    ),

    freeze_statement: $ => seq("freeze", $.expression, ";"),

    forget_statement: $ => seq("forget", $.expression, ";"),

    sample_statement: $ => seq("sample", $.expression, ";"),

    for_statement: $ => seq($._for, field("body", $.block)),

    expression_statement: $ => seq($.expression, ";"),

    block: $ => seq("{", repeat($.statement), "}"),

    _for: $ => seq("for", field("variable", $.name), "in", field("values", $.expression)),

    _bind: _ => field("bind", choice("~", "=")),

    _as: $ => seq("as", field("name", $.name)),

    tag: $ => seq(
      "#", field("name", $._any_name), optional(seq(":", field("value", $._tag_value))),
    ),

    _tag_value: $ => choice($._literal, variable($)),

    // ------------------------------------------------------------------------------------
    // inference statements

    plan: $ => seq("{", repeat($.plan_statement), "}"),

    plan_statement: $ => choice(
      $.warmup_statement,
      $.repeat_statement,
      $.every_statement,
      $.mix_statement,
      alias($.plan_for_statement, $.for_statement),
      $.stop_statement,
      $.collect_statement,
      $.propose_statement,
      $.let_statement,
      $.if_statement,
      $.if_expression,
      $.expression_statement,
    ),

    warmup_statement: $ => seq("warmup", field("count", $.expression), field("body", $.plan)),

    repeat_statement: $ => seq("repeat", field("count", $.expression), field("body", $.plan)),

    every_statement: $ => seq("every", field("count", $.expression), field("body", $.plan)),

    mix_statement: $ => seq("mix", "{", repeat1($.mix_arm), "}"),

    mix_arm: $ => seq(field("weight", $.expression), "=>", field("kernel", $.expression), ";"),

    plan_for_statement: $ => seq($._for, field("body", $.plan)),

    stop_statement: $ => seq("stop", "when", field("condition", $.expression), ";"),

    collect_statement: $ => seq("collect", sep1($.expression), ";"),

    propose_statement: $ => seq(
      "propose", field("target", $.expression), $._bind, field("value", $.expression), ";",
    ),

    // ------------------------------------------------------------------------------------
    // expressions

    expression: $ => choice($.if_expression, $._plain_expression),

    /** An expression other than a bare `if`. */
    _plain_expression: $ => choice($.function, $._or),

    function: $ => seq("fn", field("parameters", $.parameters), field("body", $.body)),

    if_expression: $ => seq(
      $._if, "else", field("alternative", choice($.body, $.if_expression)),
    ),

    /** An `if` without its last `else`. */
    if_statement: $ => seq($._if, optional(seq("else", field("alternative", $.if_statement)))),

    _if: $ => seq("if", field("condition", $._or), field("consequence", $.body)),

    _or: $ => choice(binary($._or_or, $), $._and),
    _and: $ => choice(binary($._and_and, $), $._not),
    _not: $ => choice(unary($._not_not, $), $._comparison),
    _comparison: $ => choice(binary($._range_compare_range, $), $._range),
    _range: $ => choice(binary($._sum_range_sum, $), $._sum),
    _sum: $ => choice(binary($._sum_sum, $), $._product),
    _product: $ => choice(binary($._product_product, $), $._negation),
    _negation: $ => choice(unary($._negation_negation, $), $._power),
    _power: $ => choice(binary($._postfix_power, $), $._postfix),

    _or_or: $ => infix($._or, "or", $._and),
    _and_and: $ => infix($._and, "and", $._not),
    _not_not: $ => prefix("not", $._not),
    _range_compare_range: $ => infix(
      $._range, choice("==", "!=", "<", "<=", ">", ">="), $._range,
    ),
    _sum_range_sum: $ => infix($._sum, "..", $._sum),
    _sum_sum: $ => infix($._sum, choice("+", "-"), $._product),
    _product_product: $ => infix($._product, choice("*", "/", "%", "&"), $._negation),
    _negation_negation: $ => prefix("-", $._negation),
    _postfix_power: $ => infix($._postfix, "**", $._negation),

    _postfix: $ => choice($.call, $.index, $.field, $._atom),

    call: $ => seq(field("function", $._postfix), field("arguments", $.arguments)),

    arguments: $ => seq("(", comma(choice($.expression, $.named_argument)), ")"),

    named_argument: $ => seq(field("name", $.name), "=", field("value", $.expression)),

    index: $ => seq(field("base", $._postfix), "[", field("index", $.expression), "]"),

    field: $ => seq(field("base", $._postfix), ".", field("field", $._any_name)),

    _atom: $ => choice(
      $._literal,
      variable($),
      $.address,
      $.tag_selection,
      $.parenthesized,
      $.array,
      $.record,
    ),

    parenthesized: $ => seq("(", $.expression, ")"),

    array: $ => seq("[", comma($.expression), "]"),

    record: $ => seq("{", comma($.record_field), "}"),

    record_field: $ => seq(
      field("name", choice($._any_name, $.string)), ":", field("value", $.expression),
    ),

    _literal: $ => choice($.number, $.string, $.boolean),

    boolean: _ => choice("true", "false"),

    number: _ => NUMBER,

    string: $ => seq('"', $._string_rest),

    _string_rest: $ => seq(
      // Above comments, which do not begin inside a string.
      repeat(choice(
        alias(token.immediate(prec(1, /[^"\\\n]+/)), $.string_content),
        $.escape_sequence,
      )),
      token.immediate('"'),
    ),

    escape_sequence: _ => token.immediate(/\\([ntr"\\]|u\{[0-9A-Fa-f]{1,6}\})/),

    // ------------------------------------------------------------------------------------
    // addresses and tag selections

    address: $ => seq("@", $.segment, repeat(seq($._separator, $.segment))),

    /** A segment's name, and in any order its keys and at most one occurrence `#n`. */
    segment: $ => seq(
      field("name", choice(immediate_name($), $.any, $.deep)),
      repeat($._key),
      optional(seq(field("occurrence", $.occurrence), repeat($._key))),
    ),

    /** Any one segment, or any key. */
    any: _ => token.immediate("*"),

    /** Any number of segments. */
    deep: _ => token.immediate("**"),

    occurrence: _ => token.immediate(/#0*[1-9][0-9]*/),

    _key: $ => seq(
      token.immediate("["),
      field("key", choice(
        $.any,
        immediate_name($),
        alias(token.immediate(/-?[0-9]+(\.[0-9]+)?([eE][+-]?[0-9]+)?/), $.number),
        alias($._immediate_string, $.string),
        $.computed_key,
      )),
      token.immediate("]"),
    ),

    computed_key: $ => seq(token.immediate("{"), $.expression, "}"),

    _immediate_string: $ => seq(token.immediate('"'), $._string_rest),

    tag_selection: $ => seq(
      "$", field("name", immediate_name($)),
      optional(seq(
        token.immediate(":"),
        field("value", choice(
          alias(token.immediate(/[A-Za-z0-9_]+/), $.tag_value),
          alias($._immediate_string, $.string),
        )),
      )),
    ),

    // ------------------------------------------------------------------------------------
    // names and comments

    name: _ => NAME,

    /** A name in a position where keywords are not allowed, so that it may be one of them. */
    _any_name: $ => reserved("nothing", $.name),

    line_comment: _ => token(seq("//", /[^\n]*/)),

    block_comment: _ => token(/\/\*[^*]*\*+([^\/*][^*]*\*+)*\//),
  },
});

/** An infix operator between its operands. */
function infix(left, operator, right) {
  return seq(field("left", left), field("operator", operator), field("right", right));
}

/** A prefix operator and its operand. */
function prefix(operator, operand) {
  return seq(field("operator", operator), field("operand", operand));
}

function binary(rule, $) {
  return alias(rule, $.binary);
}

function unary(rule, $) {
  return alias(rule, $.unary);
}

/** A name that stands for a value. */
function variable($) {
  return alias($.name, $.variable);
}

/** A name, keyword or not, that touches the token before it. */
function immediate_name($) {
  return alias(token.immediate(NAME), $.name);
}

/** Any number of items separated by commas; a comma may follow the last. */
function comma(item) {
  return optional(comma1(item));
}

/** At least one item, separated by commas; a comma may follow the last. */
function comma1(item) {
  return seq(sep1(item), optional(","));
}

/** At least one item, separated by commas; none may follow the last. */
function sep1(item) {
  return seq(item, repeat(seq(",", item)));
}
