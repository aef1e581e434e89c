"""What the page needs to know of a spec over time: its formulas, and how many of its motions can be shown."""

from __future__ import annotations

from functools import lru_cache

from scenegen.api.spec import Spec
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.page import MOTION_TOO_LONG, TOO_MANY_SHOWN
from scenegen.lang.timed import Timed
from scenegen.view.jobs.timed_tree import TimedTrees
from scenegen.view.limits import MAX_MOMENTS, MAX_MOTION, MAX_SCENES


def timed_of(spec: Spec) -> Timed:
    """What a spec over time means."""
    assert spec.over_time is not None
    return spec.over_time


def most_of(spec: Spec) -> int:
    """How many motions of a spec the page shows; 0 where a single one is too long."""
    size = timed_of(spec).horizon.moments * max(1, len(spec.objects))
    return 0 if size > MAX_MOTION else min(MAX_SCENES, MAX_MOMENTS // size)


def too_long(spec: Spec) -> Diagnostic:
    """What is said of motions that the page does not show."""
    return MOTION_TOO_LONG(poses=timed_of(spec).horizon.moments * len(spec.objects), most=MAX_MOTION)


def check_size(spec: Spec, count: int) -> None:
    """Raises RequestError for more motions than the page shows."""
    most = most_of(spec)
    if most == 0:
        raise RequestError(too_long(spec))
    if not 1 <= count <= most:
        raise RequestError(TOO_MANY_SHOWN(most=most, count=count, what="motions"))


@lru_cache(maxsize=2)
def trees_of(spec: Spec) -> TimedTrees:
    """The formulas of a spec over time."""
    return TimedTrees(timed_of(spec), *spec.declared.box())
