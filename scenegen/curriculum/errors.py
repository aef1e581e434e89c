"""Bad requests as gymnasium's own errors, in one sentence. Their `diagnostic` has the code and the facts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np
from gymnasium import error

from scenegen.errors import Diagnostic, ScenegenError
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE


def sentence(problem: Diagnostic, more: str = "") -> str:
    """A problem in one line: what is wrong, why, what to do, and its code."""
    text = "; ".join(part for part in (problem.title, problem.note, problem.help, more) if part)
    return f"{text} [{problem.code}]"


def refused(problem: Diagnostic, kind: type[error.Error] = error.Error, more: str = "") -> error.Error:
    """A problem as an error of gymnasium, with `more` text at the end."""
    made: Any = kind(sentence(problem, more))
    made.diagnostic = problem
    found: error.Error = made
    return found


@contextmanager
def as_gymnasium(kind: type[error.Error] = error.Error) -> Iterator[None]:
    """Turns scenegen's errors into errors of gymnasium."""
    try:
        yield
    except ScenegenError as problem:
        raise refused(problem.diagnostics[0], kind) from problem


def count(name: str, value: object) -> int:
    """A whole number from 1 up. Raises gymnasium.error.Error."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise refused(WRONG_VALUE(argument=name, value=repr(value), wanted="a whole number from 1 up"))
    return int(value)


def number(name: str, value: object, unit: str) -> float:
    """A number, numpy's included. Raises gymnasium.error.Error."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise refused(WRONG_VALUE(argument=name, value=repr(value), wanted=f"a number of {unit}"))
    return float(value)


def one_of(name: str, value: object, known: Sequence[str]) -> None:
    """Raises gymnasium.error.Error for a word that is not known."""
    if value not in known:
        raise refused(UNKNOWN_CHOICE(what=name, name=str(value), known=known, plural=f"values of `{name}`"))


def names(name: str, value: object, kind: str) -> tuple[str, ...]:
    """One name or several, each once. Raises gymnasium.error.Error for anything else."""
    if isinstance(value, str):
        return (value,)
    if not isinstance(value, list | tuple | set | frozenset) or not all(isinstance(one, str) for one in value):
        wanted = f"the name of {kind}, or a list of names"
        raise refused(WRONG_VALUE(argument=name, value=repr(value), wanted=wanted))
    return tuple(dict.fromkeys(sorted(value) if isinstance(value, set | frozenset) else value))
