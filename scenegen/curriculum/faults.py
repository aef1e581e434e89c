"""Bad requests, told in one sentence as gymnasium's own errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from gymnasium import error

from scenegen.errors import ScenegenError


def sentence(problem: ScenegenError) -> str:
    """A problem in one line: what is wrong, why, what to do."""
    first = problem.diagnostics[0]
    return "; ".join(part for part in (first.title, first.note, first.help) if part)


@contextmanager
def as_gymnasium(kind: type[error.Error] = error.Error) -> Iterator[None]:
    """Raises what scenegen finds wrong as an error of gymnasium."""
    try:
        yield
    except ScenegenError as problem:
        raise kind(sentence(problem)) from problem


def count(name: str, value: object) -> int:
    """A whole number from 1 up. Raises gymnasium.error.Error."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise error.Error(f"`{name}` is {value!r}; it has to be a whole number from 1 up")
    return int(value)
