"""The words of the language, for the lexer of outputs."""

DECLARATIONS = [
    "include",
    "param",
    "data",
    "fn",
    "kernel",
    "infer",
    "report",
    "export",
    "as",
    "to",
    "assume",
    "let",
    "observe",
    "with",
    "coarse",
    "predict",
    "factor",
    "force",
    "freeze",
    "forget",
    "sample",
]
CONTROL = [
    "for",
    "in",
    "if",
    "else",
    "warmup",
    "repeat",
    "every",
    "mix",
    "stop",
    "when",
    "collect",
    "propose",
]
OPERATORS = ["or", "and", "not"]
CONSTANTS = ["true", "false"]

SEGMENT = r"[A-Za-z_*][A-Za-z0-9_*]*(?:#[0-9]+)?(?:\[[^\]]*\])*"
ADDRESS = rf"@{SEGMENT}(?:/{SEGMENT})*"
TAG = r"[#$][A-Za-z_][A-Za-z0-9_]*(?::[A-Za-z_][A-Za-z0-9_]*)?"
NUMBER = r"[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?"
NAME = r"[A-Za-z_][A-Za-z0-9_]*"
