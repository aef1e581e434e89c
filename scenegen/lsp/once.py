"""Properties that are computed once per object, by the first thread that needs them; others wait."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")


class Once(Generic[T]):
    """A property that is computed when it is first read, and cached. Unlike `functools.cached_property` (from Python
    3.12 on) two threads never compute the same, and (up to 3.11) two objects never wait for each other."""

    def __init__(self, compute: Callable[[Any], T]) -> None:
        self._compute = compute
        self.__doc__ = compute.__doc__
        self._name = compute.__name__

    @overload
    def __get__(self, owner: None, kind: type) -> Once[T]: ...
    @overload
    def __get__(self, owner: object, kind: type) -> T: ...
    def __get__(self, owner: object | None, kind: type) -> T | Once[T]:
        if owner is None:
            return self
        kept = owner.__dict__
        lock = kept.setdefault(f"_lock of {self._name}", threading.RLock())
        with lock:
            if self._name not in kept:
                kept[self._name] = self._compute(owner)
            found: T = kept[self._name]
            return found


def once(compute: Callable[[Any], T]) -> Once[T]:
    return Once(compute)
