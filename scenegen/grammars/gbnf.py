"""Grammars in GBNF, the dialect of llama.cpp."""

from __future__ import annotations

from scenegen.grammars.rules import Choice, Grammar, Part, Ref, Repeat, Seq, Text, Whole, digits

_ESCAPES = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"})


def gbnf(grammar: Grammar) -> str:
    """The grammar in GBNF, ending in a line break; its first rule is called `root`."""
    notes = [f"# {note}" for note in grammar.notes]
    rules = [f"{_name(grammar, name)} ::= {_written(grammar, part)}" for name, part in grammar.rules.items()]
    return "\n".join([*notes, *rules]) + "\n"


def _name(grammar: Grammar, name: str) -> str:
    return "root" if name == grammar.start else name


def _written(grammar: Grammar, part: Part, *, inside: bool = False) -> str:
    match part:
        case Text(text):
            return f'"{text.translate(_ESCAPES)}"'
        case Ref(name):
            return _name(grammar, name)
        case Whole(low, high):
            rows = [" ".join(f"[{first}-{last}]" for first, last in row) for row in digits(low, high)]
            return f"({' | '.join(rows)})"
        case Seq(parts):
            line = " ".join(_written(grammar, one, inside=True) for one in parts)
            return f"({line})" if inside else line
        case Choice(options):
            line = " | ".join(_written(grammar, one) for one in options)
            return f"({line})" if inside else line
        case Repeat(one, least, most):
            mark = "?" if (least, most) == (0, 1) else f"{{{least},{most}}}"
            body = _written(grammar, one, inside=True)
            return f"({body}){mark}" if isinstance(one, Repeat) else body + mark
