"""Templates of prose: the one place that turns the facts of a diagnostic into sentences.

    {name}, {count:,}      a fact, formatted as by str.format
    {names:quoted}         names in a sentence: `a`, `b` and `c`; {names:quoted8} shows the first eight
    {names:list}           names as they are: a, b, c
    {names:members}        the parts of a list or region: .first, .last
    {name:argument}        a fact that names an argument, spelt as the caller knows it: `timeout` or --timeout
    {kept:?}               nothing; the template is for those that have this fact
    <timeout>              an argument by name: `timeout` or --timeout
    <device=cpu>           an argument with a value: device="cpu" or --device cpu
    [[; {more}]]           left out where one of its facts is missing

A fact is missing if it was not given, is None, or is empty.
"""

from __future__ import annotations

import difflib
import heapq
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias

# --------------------------------------------------------------------------------------------------------------------
# Lists of names in a sentence, and suggestions for misspelt names.


MOST_ALIKE = 500  # maximum number of known names with which a misspelt one is compared


def quoted(names: Iterable[str]) -> str:
    """`a`, `b` and `c`, in the order given."""
    items = [f"`{name}`" for name in names]
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + f" and {items[-1]}" if items else "none"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name that `name` most likely means: the same except for case, else a close match, else None."""
    name, names = str(name), sorted(set(known))  # Python callers may pass anything
    folded = {candidate.casefold().replace("_", ""): candidate for candidate in reversed(names)}
    exact = folded.get(name.casefold().replace("_", ""))
    if exact is not None:
        return exact
    wanted, candidates = name.casefold(), list(folded)
    if len(candidates) > MOST_ALIKE:  # difflib is slow: of very many names compare those with the same beginning
        candidates = heapq.nlargest(MOST_ALIKE, candidates, key=lambda one: _alike(one, wanted))
    close = difflib.get_close_matches(wanted, candidates, n=1, cutoff=0.6)
    return folded[close[0]] if close and _near(wanted, close[0]) else None


def _near(one: str, other: str) -> bool:
    """Whether one of two words can be a typo of the other: `usd` is not one of `sdf`, although most letters are the
    same.

    A third of the letters, but at least one, may be wrong, missing or additional; two swapped neighbours count as one.
    Longer words may also differ by an addition at one end (`block` and `block_tower`).
    """
    most = max(1, (max(len(one), len(other)) + 1) // 3)
    if min(len(one), len(other)) >= 3 and (one.startswith(other) or other.startswith(one)):
        return True
    before: list[int] = []
    row = list(range(len(other) + 1))
    for at, letter in enumerate(one, 1):
        older, before, row = before, row, [at]
        for place, char in enumerate(other, 1):
            cost = min(before[place] + 1, row[place - 1] + 1, before[place - 1] + (letter != char))
            if place > 1 and at > 1 and letter == other[place - 2] and one[at - 2] == char:
                cost = min(cost, older[place - 2] + 1)
            row.append(cost)
    return row[-1] <= most


def _alike(one: str, other: str) -> tuple[int, int]:
    """How many characters two words have in common from the start, then how close they are in length."""
    common = next((at for at, (a, b) in enumerate(zip(one, other, strict=False)) if a != b), min(len(one), len(other)))
    return common, -abs(len(one) - len(other))


Spell: TypeAlias = Callable[[str, "str | None"], str]
Text: TypeAlias = "str | tuple[str, ...]"  # of several templates, the first whose facts are all given

_PART = r"(?s)\[\[(.*?)\]\]|\{(\w+)(?::([^{}]*))?\}|<(\w+)(?:=([^<>]*))?>"  # compiled when a text is first needed


def python_name(name: str, value: str | None = None) -> str:
    """An argument as Python callers write it: `timeout`, or `device="cpu"` with a value."""
    if value is None:
        return f"`{name}`"
    label, equals, ends = value.partition("=")
    if name == "phi" and equals:
        low, _, high = ends.partition(":")
        return f'phi={{"{label}": ({low or None}, {high or None})}}'
    return f"{name}={value}" if re.fullmatch(r"True|[\d.]+", value) else f'{name}="{value}"'


def fill(text: Text, facts: Mapping[str, object], spell: Spell = python_name) -> str:
    """The sentence that a template makes of facts; "" if some are missing."""
    for template in (text,) if isinstance(text, str) else text:
        try:
            return _fill(template, facts, spell).removeprefix("; ").removeprefix(", ")
        except KeyError:
            continue
    return ""


def fill_title(text: Text, facts: Mapping[str, object], spell: Spell = python_name) -> str:
    """The same for a title, which is never empty, even for a file without a name."""
    templates = (text,) if isinstance(text, str) else text
    for template in templates if not (said := fill(text, facts, spell)) else ():
        try:
            return _fill(template, facts, spell, empty=True)
        except KeyError:
            continue
    return said


def missing(fact: object) -> bool:
    """Whether a fact that was given counts as missing: None, "" and empty lists."""
    return fact is None or (isinstance(fact, str | tuple | list) and not fact)


def fields(template: str) -> tuple[set[str], set[str]]:
    """The facts that a template needs, and those that it can do without."""
    needed, spare = set(), set()
    for optional, name, _, _, value in re.findall(_PART, template):
        if optional:
            spare |= set.union(*fields(optional))
        elif name:
            needed.add(name)
        elif value:
            needed |= fields(value)[0]
    return needed, spare


def _fill(template: str, facts: Mapping[str, object], spell: Spell, empty: bool = False) -> str:
    def part(found: re.Match[str]) -> str:
        optional, name, how, argument, value = found.groups()
        if optional is not None:
            try:
                return _fill(optional, facts, spell)
            except KeyError:
                return ""
        if argument is not None:
            return spell(argument, None if value is None else _fill(value, facts, spell))
        fact = facts[name]
        if fact is None or (missing(fact) and not empty):
            raise KeyError(name)
        return _shown(fact, how or "", spell)

    return re.sub(_PART, part, template)


def _shown(fact: Any, how: str, spell: Spell) -> str:
    if how == "?":
        return ""
    if how == "argument":
        return spell(str(fact), None)
    if how == "members":
        return ", ".join(f".{one}" for one in fact)
    if how.startswith(("quoted", "list")):
        names = [str(one) for one in fact]
        limit = int(re.sub(r"\D", "", how) or len(names))
        shown, more = names[:limit], len(names) > limit
        if how.startswith("list"):
            return ", ".join(shown) + (", ..." if more else "")
        return ", ".join(f"`{one}`" for one in shown) + ", ..." if more else quoted(shown)
    return format(fact, how) if how else str(fact)
