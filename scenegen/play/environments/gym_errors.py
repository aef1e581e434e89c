"""Bad requests as gymnasium's own errors, in one sentence; their `diagnostic` has the code and the facts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from numbers import Real

import numpy as np
from gymnasium import error

from scenegen.errors import Diagnostic, ScenegenError
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE


def sentence(problem: Diagnostic, more: str = "") -> str:
    """A problem in one line: what is wrong, why, what to do, and its code."""
    text = "; ".join(part for part in (problem.title, problem.note, problem.help, more) if part)
    return f"{text} [{problem.code}]"


def gym_error(problem: Diagnostic, kind: type[error.Error] = error.Error, more: str = "") -> error.Error:
    """A problem as an error of gymnasium, with `more` text at the end."""
    problem_in_words: error.Error = kind(sentence(problem, more))
    problem_in_words.diagnostic = problem  # type: ignore[attr-defined]
    return problem_in_words


def no_strategy(value: str) -> Diagnostic:
    """The problem with what is given as a strategy."""
    wanted = 'one: strategy("self_paced", env.unwrapped.space, np.random.default_rng(0))'
    return WRONG_VALUE(argument="strategy", value=value, wanted=wanted)


@contextmanager
def as_gym_errors() -> Iterator[None]:
    """Turns scenegen's errors into errors of gymnasium."""
    try:
        yield
    except ScenegenError as problem:
        raise gym_error(problem.diagnostics[0]) from problem


def as_count(name: str, value: object) -> int:
    """A whole number from 1 up. Raises gymnasium.error.Error."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise gym_error(WRONG_VALUE(argument=name, value=repr(value), wanted="a whole number from 1 up"))
    return int(value)


def as_quantity(name: str, value: object, unit: str) -> float:
    """A number, numpy's included. Raises gymnasium.error.Error."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise gym_error(WRONG_VALUE(argument=name, value=repr(value), wanted=f"a number of {unit}"))
    return float(value)


def as_choice(name: str, value: object, known: Sequence[str]) -> None:
    """Raises gymnasium.error.Error for a word that is not known."""
    if value not in known:
        raise gym_error(UNKNOWN_CHOICE(what=name, name=str(value), known=known, plural=f"values of `{name}`"))


def as_names(name: str, value: object, kind: str) -> tuple[str, ...]:
    """One name or several, each once. Raises gymnasium.error.Error for anything else."""
    if isinstance(value, str):
        return (value,)
    if not isinstance(value, list | tuple | set | frozenset) or not all(isinstance(each, str) for each in value):
        wanted = f"the name of {kind}, or a list of names"
        raise gym_error(WRONG_VALUE(argument=name, value=repr(value), wanted=wanted))
    return tuple(dict.fromkeys(sorted(value) if isinstance(value, set | frozenset) else value))
