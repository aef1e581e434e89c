"""Bad requests, told in one sentence as gymnasium's own errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from numbers import Real

import numpy as np
from gymnasium import error

from scenegen.errors import ScenegenError, suggest


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


def number(name: str, value: object, unit: str) -> float:
    """A number, numpy's included. Raises gymnasium.error.Error."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise error.Error(f"`{name}` is {value!r}; it has to be a number of {unit}")
    return float(value)


def one_of(name: str, value: object, known: Sequence[str]) -> None:
    """Raises gymnasium.error.Error for what is none of the known words."""
    if value not in known:
        otherwise = f"it is {' or '.join(f'`{word}`' for word in known)}"
        raise error.Error(f"unknown {name} `{value}`; {suggest(str(value), known, otherwise)}")


def names(name: str, value: object, kind: str) -> tuple[str, ...]:
    """One name or several, each once. Raises gymnasium.error.Error for what is neither."""
    if isinstance(value, str):
        return (value,)
    if not isinstance(value, list | tuple | set | frozenset) or not all(isinstance(one, str) for one in value):
        raise error.Error(f"`{name}` is {value!r}; write the name of {kind}, or a list of names")
    return tuple(dict.fromkeys(sorted(value) if isinstance(value, set | frozenset) else value))
