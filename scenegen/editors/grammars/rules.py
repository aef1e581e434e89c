"""A context-free grammar as data. The writers of the dialects, and the tests' own walker, read the same rules."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from json import dumps


@dataclass(frozen=True, slots=True)
class Terminal:
    """These characters."""

    text: str


@dataclass(frozen=True, slots=True)
class RuleRef:
    """What the rule of that name makes."""

    name: str


@dataclass(frozen=True, slots=True)
class IntegerRange:
    """A whole number from `low` to `high` >= low >= 0, without leading zeros."""

    low: int
    high: int


@dataclass(frozen=True, slots=True)
class Seq:
    """One part after the other."""

    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class Alternation:
    """One of at least one option."""

    options: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class Repeat:
    """`part` so many times, both ends included: (0, 1) makes it optional."""

    part: Part
    least: int
    most: int


Part = Terminal | RuleRef | IntegerRange | Seq | Alternation | Repeat


@dataclass(frozen=True, slots=True)
class Grammar:
    """Rules by name; `start` is where a text begins. Names are lower-case letters and digits."""

    rules: Mapping[str, Part]
    start: str = "start"
    notes: tuple[str, ...] = ()


def seq(*parts: Part) -> Part:
    """One part after the other; neighbouring texts become one."""
    joined: list[Part] = []
    for part in parts:
        for one in part.parts if isinstance(part, Seq) else (part,):
            if isinstance(one, Terminal) and joined and isinstance(last := joined[-1], Terminal):
                joined[-1] = Terminal(last.text + one.text)
            elif one != Terminal(""):
                joined.append(one)
    return joined[0] if len(joined) == 1 else Seq(tuple(joined))


def choice(options: Sequence[Part]) -> Part:
    """One of the options, each once."""
    different = tuple(dict.fromkeys(options))
    return different[0] if len(different) == 1 else Alternation(different)


def digits(low: int, high: int) -> list[tuple[tuple[str, str], ...]]:
    """The whole numbers from low to high >= low >= 0 as patterns: each a row of ranges of digits, first to last.

    >>> digits(8, 25)
    [(('8', '9'),), (('1', '1'), ('0', '9')), (('2', '2'), ('0', '5'))]
    """
    found: list[tuple[tuple[str, str], ...]] = []
    for length in range(len(str(low)), len(str(high)) + 1):
        least = max(low, 10 ** (length - 1) if length > 1 else 0)
        most = min(high, 10**length - 1)
        if least <= most:
            found += _same_length(str(least), str(most))
    return found


def _same_length(low: str, high: str) -> list[tuple[tuple[str, str], ...]]:
    """The numbers between two of equally many digits."""
    if len(low) == 1:
        return [((low, high),)]
    zeros, nines = "0" * (len(low) - 1), "9" * (len(low) - 1)
    if low[0] == high[0]:
        return [((low[0], low[0]), *rest) for rest in _same_length(low[1:], high[1:])]
    found: list[tuple[tuple[str, str], ...]] = []
    first, last = int(low[0]), int(high[0])
    if low[1:] != zeros:
        found += [((low[0], low[0]), *rest) for rest in _same_length(low[1:], nines)]
        first += 1
    if high[1:] != nines:
        last -= 1
    if first <= last:
        found.append(((str(first), str(last)), *((("0", "9"),) * len(zeros))))
    if high[1:] != nines:
        found += [((high[0], high[0]), *rest) for rest in _same_length(zeros, high[1:])]
    return found


_ESCAPES = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"})


def gbnf(grammar: Grammar) -> str:
    """The grammar in GBNF, ending in a line break; its first rule is called `root`."""

    def leaf(part: Terminal | RuleRef | IntegerRange) -> str:
        match part:
            case Terminal(text):
                return f'"{text.translate(_ESCAPES)}"'
            case RuleRef(name):
                return "root" if name == grammar.start else name
            case IntegerRange(low, high):
                rows = [" ".join(f"[{first}-{last}]" for first, last in row) for row in digits(low, high)]
                return f"({' | '.join(rows)})"

    notes = [f"# {note}" for note in grammar.notes]
    rules = [f"{leaf(RuleRef(name))} ::= {write_part(part, leaf)}" for name, part in grammar.rules.items()]
    return "\n".join([*notes, *rules]) + "\n"


def lark(grammar: Grammar) -> str:
    """The grammar in the Lark dialect, ending in a line break."""

    def leaf(part: Terminal | RuleRef | IntegerRange) -> str:
        match part:
            case Terminal(text):
                return dumps(text, ensure_ascii=False)
            case RuleRef(name):
                return name
            case IntegerRange(low, high):
                return f"/{pattern(low, high)}/"

    head = ["%llguidance {}", *(f"// {note}" for note in grammar.notes)]
    return "\n".join([*head, *(f"{name}: {write_part(part, leaf)}" for name, part in grammar.rules.items())]) + "\n"


def json(grammar: Grammar) -> str:
    """The JSON document in which llguidance, and servers built on it, take a grammar."""
    return dumps({"grammars": [{"lark_grammar": lark(grammar)}]}, ensure_ascii=False) + "\n"


def write_part(part: Part, leaf: Callable[[Terminal | RuleRef | IntegerRange], str], *, inside: bool = False) -> str:
    """A part as the right side of a rule; `inside` a sequence or a repetition, choices stand in parentheses."""
    match part:
        case Seq(parts):
            line = " ".join(write_part(one, leaf, inside=True) for one in parts)
        case Alternation(options):
            line = " | ".join(write_part(one, leaf) for one in options)
        case Repeat(one, least, most):
            mark = "?" if (least, most) == (0, 1) else f"{{{least},{most}}}"
            body = write_part(one, leaf, inside=True)
            return f"({body}){mark}" if isinstance(one, Repeat) else body + mark
        case _:
            return leaf(part)
    return f"({line})" if inside else line


def pattern(low: int, high: int) -> str:
    """A regular expression for the whole numbers from low to high."""
    rows = ["".join(_class(*ends) for ends in row) for row in digits(low, high)]
    return rows[0] if len(rows) == 1 else f"({'|'.join(rows)})"


def _class(first: str, last: str) -> str:
    return first if first == last else f"[{first}-{last}]"
