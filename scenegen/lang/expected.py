"""What was found at a place in a text, and what could have stood there, in words."""

from __future__ import annotations

# what can stand at a place, by the tokens that would have been accepted there; the first that fits is said
_EXPECTED = (
    ({"NAME", "QUANTITY", "LPAR"}, "a formula, a name or a number"),
    ({"_AND", "_OR", "COMPARE"}, "an operator such as `&`, `|`, `->` or `<=`, or the end of the formula"),
    ({"RSQB", "COMMA"}, "`,` or `]`"),
    ({"RPAR", "COMMA"}, "`,` or `)`"),
    ({"LABEL", "OBJECT", "CONST"}, "a statement such as `object`, `const`, `def` or `task: ...`"),
    ({"COMMA", "IN"}, "`in` and what to range over"),
    ({"X"}, "`x` and the second interval: workspace [0, 1] x [0, 1]"),
    ({"LSQB", "EQUAL"}, "`=`"),
    ({"LSQB"}, "an interval such as [0, 1]"),
    ({"LPAR"}, "`(`"),
    ({"EQUAL"}, "`=`"),
    ({"COLON"}, "`:`"),
    ({"STRING"}, 'a text in double quotes, such as "table.spec"'),
    ({"NAME"}, "a name"),
    ({"COMMA"}, "`,`"),
    ({"RPAR"}, "`)`"),
    ({"RSQB"}, "`]`"),
)


def shown(text: str) -> str:
    """What was found: the text, or the number of a character that cannot be printed."""
    return f"`{text}`" if text.isprintable() else f"character U+{ord(text[0]):04X}"


def expected(accepts: set[str]) -> str:
    """What could have stood there, from the tokens that would have been accepted."""
    return next((words for needed, words in _EXPECTED if needed <= accepts), "something else")
