"""Smaller inputs with the same fault: delta debugging (Zeller and Hildebrandt 2002) over lines, then tokens, then
characters."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .generate import Case
from .mutate import pieces

MOST_TRIES = 600


def minimise(case: Case, same: Callable[[Case], bool]) -> Case:
    """The case with as much left out as still has the fault, after at most MOST_TRIES trials."""
    tries = 0

    def still(candidate: Case) -> bool:
        nonlocal tries
        tries += 1
        return tries <= MOST_TRIES and same(candidate)

    for name in list(case.beside):
        smaller = Case(case.main, {other: data for other, data in case.beside.items() if other != name})
        case = smaller if still(smaller) else case
    try:
        text = case.main.decode("utf-8")
    except UnicodeDecodeError:
        return case
    for cut in (lambda text: text.splitlines(keepends=True), pieces, list):
        text = "".join(_ddmin(cut(text), lambda parts: still(Case("".join(parts).encode(), case.beside))))
    return Case(text.encode(), case.beside)


def _ddmin(parts: Sequence[str], still: Callable[[Sequence[str]], bool]) -> Sequence[str]:
    chunks = 2
    while len(parts) >= 2:
        size = max(1, len(parts) // chunks)
        for start in range(0, len(parts), size):
            smaller = [*parts[:start], *parts[start + size :]]
            if smaller and still(smaller):
                parts, chunks = smaller, max(chunks - 1, 2)
                break
        else:
            if size == 1:
                break
            chunks = min(len(parts), chunks * 2)
    return parts
