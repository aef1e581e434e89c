"""The rules of whole answers: labels over given declarations."""

from __future__ import annotations

from typing import Literal

from scenegen.grammars.literals import Literals
from scenegen.grammars.rules import Grammar, Part, Ref, Repeat, Text, Whole, choice, seq
from scenegen.grammars.trial import Findings

Shape = Literal["goals", "formulas"]

GOALS = 8  # labels at most
OPTIONS = 2  # further options of one goal
CONJUNCTS = 8
DEPTH = 3  # of parentheses in free formulas


def grammar(found: Findings, declared: str, names: tuple[str, ...], shape: Shape = "goals") -> Grammar:
    """The grammar of a spec: `declared`, if anything, then labels called `names`, in this order. With the shape "goals"
    each is one statement that some scene satisfies, or a choice of them; with "formulas" anything can be joined."""
    literals = Literals(found, found.statements, "state").rules()
    moving = Literals(found, found.moving, "step").rules()
    timed = found.words is not None and found.words.timed
    rules: dict[str, Part] = {"start": seq(Text(declared), Ref("goal1"))}
    for place, name in enumerate(names, start=1):
        last = place == len(names)
        more = () if last else (Repeat(seq(Text("\n"), Ref(f"goal{place + 1}")), 0, 1),)
        rules[f"goal{place}"] = seq(Text(f"{name}: "), Ref("formula"), *more)
    if shape == "formulas":
        rules.update(_free(timed, found.steps, bool(moving)))
    elif timed:
        rules["formula"] = seq(Ref("timed"), Repeat(seq(Text(" & "), Ref("timed")), 0, CONJUNCTS - 1))
        rules["timed"] = _timed(found.steps, "state", moving=bool(moving))
    else:
        rules["formula"] = seq(Ref("state"), Repeat(seq(Text(" | "), Ref("state")), 0, OPTIONS))
    return Grammar({**rules, **literals, **moving})


def _free(timed: bool, steps: int, moving: bool) -> dict[str, Part]:
    """Formulas that nest: every pair of parentheses is one level."""
    rules: dict[str, Part] = {}
    for depth in range(DEPTH):
        options: list[Part] = [Ref("state"), seq(Text("!"), Ref("state"))]
        if depth:
            inner = Ref(f"nested{depth}")
            both = [seq(Text("("), inner, Repeat(seq(Text(sign), inner), 1, 3), Text(")")) for sign in (" & ", " | ")]
            options += [*both, seq(Text("("), inner, Text(" -> "), inner, Text(")"))]
        rules[f"nested{depth + 1}"] = choice(options)
    top = f"nested{DEPTH}"
    if timed:
        rules["timed"] = _timed(steps, top, moving=moving)
        top = "timed"
    conjunct = Ref(top)
    rules["formula"] = seq(conjunct, Repeat(seq(Text(" & "), conjunct), 0, CONJUNCTS - 1))
    return rules


def _timed(steps: int, inner: str, *, moving: bool) -> Part:
    """A formula over time of formulas of a moment. Windows end with the motion: they begin with the moment, or end with
    the last one; where operators are nested, the inner one takes all moments that are left. What an operator takes
    stands in parentheses, whatever binds how. What needs a step (`moving`) is not asked of the first moment."""
    state = Ref(inner)
    taken = seq(Text(" ("), state, Text(")"))
    windows: list[Part] = [Text(""), seq(Text("[0, "), Whole(1, steps), Text("]"))]
    windows.append(seq(Text("["), Whole(0, steps), Text(f", {steps}]")))
    window = choice(windows)
    always, eventually = Text("(always"), Text("(eventually")
    once = choice([Text("(initially"), Text("(finally")])
    options: list[Part] = [state, seq(once, taken, Text(")"))]
    options += [seq(word, window, taken, Text(")")) for word in (always, eventually)]
    options += [
        seq(Text("(always eventually"), taken, Text(")")),
        seq(Text("(eventually always"), taken, Text(")")),
        seq(Text("("), state, choice([Text(" until"), Text(" until_with")]), window, taken, Text(")")),
    ]
    if moving:
        step = seq(Text(" ("), Ref("step"), Text(")"))
        span = seq(Text("[1, "), Whole(1, steps), Text("]"))
        options += [seq(word, span, step, Text(")")) for word in (always, eventually)]
        options.append(seq(Text("(finally"), step, Text(")")))
    return choice(options)
