"""Lists of names in a sentence, and suggestions for misspelt names."""

from __future__ import annotations

import difflib
import heapq
from collections.abc import Iterable

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
