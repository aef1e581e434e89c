"""Words of everyday language for what stands on what, and what to write for them."""

from __future__ import annotations

import re
from collections.abc import Sequence

THE_TABLE = "the table is called `workspace`; things stand on it if nothing is declared"

ON = "restsOn({a}, {b}); what {a} stands on is declared: object {a} on {b}"
RELATIONS = {  # of a and b
    **dict.fromkeys(
        ("above", "over"), "if it stands on it, write restsOn({a}, {b}), else z({a}) >= top({b}); `aboveOf` is along y"
    ),
    **dict.fromkeys(("below", "under", "beneath"), "write underneath({a}, {b}); `belowOf` is along y"),
    **dict.fromkeys(("ontop", "onTop", "onTopOf", "ontopof", "atop", "upon"), "write " + ON),
    **dict.fromkeys(("into", "within", "isIn", "inOf"), "write insideOf({a}, {b})"),
}
INFIX = RELATIONS | {
    "on": "write " + ON,
    "in": "write insideOf({a}, {b}); what {a} stands in is declared: object {a} on {b}",
}
DECLARED = ("in", "into", "inside", "within", "onto", "atop", "upon", "over", "above")  # instead of `on`


OVER_A_HEIGHT = {  # of a and a height b
    **dict.fromkeys(("above", "over"), "write z({a}) >= {b}, of the lowest point of {a}"),
    **dict.fromkeys(("below", "under", "beneath"), "write top({a}) <= {b}, of the highest point of {a}"),
}


def one_list(text: str) -> str | None:
    """The members of a list in which there are lists, as one list without its brackets; None where it is not closed.
    `text` begins with the bracket, and may go on after the list."""
    kept, opened = "", list[bool]()  # whether each open bracket is one of an index, as in shelf[1]
    for place, char in enumerate(text):
        if char == "[":
            opened.append(re.match(r"\w", text[place - 1 : place]) is not None)
            kept += char if opened[-1] else ""
        elif char == "]":
            kept += char if opened.pop() else ""
            if not opened:
                return " ".join(re.sub(r"\bany\s+of\b", "", kept).split())
        else:
            kept += char
    return None


def of_heights(name: str, arguments: Sequence[str]) -> str | None:
    """What to write instead of a call of a relation that there is not; None of other names."""
    if name not in RELATIONS or len(arguments) < 2:
        return None
    of_number, to_number = (re.match(r"[\d.]", one) for one in arguments[:2])
    if of_number:
        return None
    words = OVER_A_HEIGHT if name in OVER_A_HEIGHT and to_number else RELATIONS
    return words[name].format(a=arguments[0], b=arguments[1])


def between(name: str, first: str, second: str, *, declared: bool) -> str | None:
    """What to write instead of `first name second`, in an object statement or in a formula; None of other words."""
    if declared:
        return f"write `{first} on {second}`" if name in DECLARED else None
    if name not in INFIX:
        return None
    if second == "table":
        return f"things stand on the table if nothing is declared: leave this out, or write restsOn({first}, workspace)"
    if second == "any":
        return f"a choice is declared, object {first} on any of [...]; each surface is asked for with restsOn"
    return INFIX[name].format(a=first, b=second)
