"""The language for Pygments."""

from pygments.lexer import RegexLexer, words  # type: ignore[import-untyped]
from pygments.token import (  # type: ignore[import-untyped]
    Comment,
    Keyword,
    Name,
    Number,
    Operator,
    Punctuation,
    String,
    Text,
    Whitespace,
)

from pcadlang.notebook import words as language


class PcadLexer(RegexLexer):  # type: ignore[misc]
    """A lexer of programs. It accepts any text: mistakes are the compiler's to report."""

    name = "pcad"
    aliases = ("pcad",)
    filenames = ("*.pcad",)
    mimetypes = ("text/x-pcad",)
    url = ""

    tokens = {  # noqa: RUF012 (so Pygments has it)
        "root": [
            (r"\s+", Whitespace),
            (r"//[^\n]*", Comment.Single),
            (r"/\*", Comment.Multiline, "comment"),
            (r'"', String.Double, "string"),
            (language.ADDRESS, Name.Label),
            (language.TAG, Name.Decorator),
            (language.NUMBER, Number),
            (words(language.CONSTANTS, prefix=r"\b", suffix=r"\b"), Keyword.Constant),
            (words(language.OPERATORS, prefix=r"\b", suffix=r"\b"), Operator.Word),
            (words(language.CONTROL, prefix=r"\b", suffix=r"\b"), Keyword),
            (words(language.DECLARATIONS, prefix=r"\b", suffix=r"\b"), Keyword.Declaration),
            (rf"{language.NAME}(?=\s*\()", Name.Function),
            (language.NAME, Name),
            (r"=>|==|!=|<=|>=|\*\*|\.\.|[-+*/%&<>=~]", Operator),
            (r"[()\[\]{},;:.]", Punctuation),
            (r".", Text),
        ],
        "comment": [
            (r"\*/", Comment.Multiline, "#pop"),
            (r"[^*]+|\*", Comment.Multiline),
        ],
        "string": [
            (r'"', String.Double, "#pop"),
            (r"\\.", String.Escape),
            (r'[^"\\]+|\\', String.Double),
        ],
    }
