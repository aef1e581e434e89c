"""Grammars in the Lark dialect of llguidance, and in its JSON form."""

from __future__ import annotations

from json import dumps

from scenegen.grammars.rules import Choice, Grammar, Part, Ref, Repeat, Seq, Text, Whole, digits


def lark(grammar: Grammar) -> str:
    """The grammar in the Lark dialect, ending in a line break."""
    head = ["%llguidance {}", *(f"// {note}" for note in grammar.notes)]
    return "\n".join([*head, *(f"{name}: {written(part)}" for name, part in grammar.rules.items())]) + "\n"


def json(grammar: Grammar) -> str:
    """The JSON document in which llguidance, and servers built on it, take a grammar."""
    return dumps({"grammars": [{"lark_grammar": lark(grammar)}]}, ensure_ascii=False) + "\n"


def written(part: Part, *, inside: bool = False) -> str:
    """A part as the right side of a rule; `inside` a sequence or a repetition, choices stand in parentheses."""
    match part:
        case Text(text):
            return dumps(text, ensure_ascii=False)
        case Ref(name):
            return name
        case Whole(low, high):
            return f"/{pattern(low, high)}/"
        case Seq(parts):
            line = " ".join(written(one, inside=True) for one in parts)
            return f"({line})" if inside else line
        case Choice(options):
            line = " | ".join(written(one) for one in options)
            return f"({line})" if inside else line
        case Repeat(one, least, most):
            mark = "?" if (least, most) == (0, 1) else f"{{{least},{most}}}"
            body = written(one, inside=True)
            return f"({body}){mark}" if isinstance(one, Repeat) else body + mark


def pattern(low: int, high: int) -> str:
    """A regular expression for the whole numbers from low to high."""
    rows = ["".join(_class(*ends) for ends in row) for row in digits(low, high)]
    return rows[0] if len(rows) == 1 else f"({'|'.join(rows)})"


def _class(first: str, last: str) -> str:
    return first if first == last else f"[{first}-{last}]"
