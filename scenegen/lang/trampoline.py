"""Recursion without Python's stack.

A recursive function is written as a generator that yields the calls it wants made and is sent their results. So the
checker reads like the recursive function it is, and a formula 10,000 levels deep is no different from one with two.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, TypeVar

T = TypeVar("T")
Call = Generator[Any, Any, T]


def run(call: Call[T]) -> T:
    """The value that a generator of calls returns; exceptions travel up the calls as they would in functions."""
    stack: list[Call[Any]] = [call]
    value: Any = None
    error: BaseException | None = None
    while True:
        try:
            wanted = stack[-1].throw(error) if error is not None else stack[-1].send(value)
        except StopIteration as done:
            value, error = done.value, None
            stack.pop()
            if not stack:
                result: T = value
                return result
        except BaseException as raised:
            error = raised
            stack.pop()
            if not stack:
                raise
        else:
            stack.append(wanted)
            value, error = None, None
