"""What a scene shows of its cameras and robots, beside phi: the shares that are seen, and how hands fit.

The numbers are those of formulas (`visibleShare`, `viewRoom`, `handRoom`), lowered by the checker into a core of their
own, so a spec need not ask for them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import Source, SpecError
from scenegen.geometry import NUMPY
from scenegen.lang.check.heights import boards_of
from scenegen.lang.check.lowering import Lowering
from scenegen.lang.check.sight import room_of, share_of
from scenegen.lang.checker import check_module
from scenegen.lang.formula.core import Core
from scenegen.lang.formula.interpret import evaluate
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax.parse import parse

MOST_HIDERS = 1_000  # pairs of what is seen and what hides: beyond, only shares that formulas ask for are measured


@dataclass(frozen=True, slots=True)
class Seen:
    """What a camera sees of an object in B scenes: the share of its silhouette that nothing hides, from 0 to 1, (B,),
    whether all of it is in the picture, and whether any of it is, (B,) each."""

    camera: str
    thing: int
    share: Array
    whole: npt.NDArray[np.bool_]
    any: npt.NDArray[np.bool_]

    def words(self, scene: int) -> str:
        """The share in per cent, and whether the picture has all of the object; 0 and 100 are only what is that."""
        if not self.any[scene]:
            return "out of view"
        share = float(self.share[scene])
        rounded = round(100.0 * share) if share in (0.0, 1.0) else min(max(round(100.0 * share), 1), 99)
        return f"{rounded} %" + ("" if self.whole[scene] else ", partly out of view")


@dataclass(frozen=True, slots=True)
class Grip:
    """The open hand of a robot over an object in B scenes: of the yaws that formulas try, that with the most room, in
    radians of the object's frame, (B,), and this room in metres, (B,)."""

    thing: int
    robot: int
    yaw: Array
    room: Array


@dataclass(slots=True)
class Sights:
    """The numbers of a spec's scenes; made by `sights_of`."""

    of_shares: Core = field(default_factory=lambda: Core((), {}, ()))
    of_hands: Core = field(default_factory=lambda: Core((), {}, ()))
    shares: tuple[tuple[int, str], ...] = ()  # object and camera
    hands: tuple[tuple[int, int, float, float], ...] = ()  # object, robot, yaw, depth

    def __call__(self, lowering: Lowering) -> None:
        """Take what a lowering knows: its hook."""
        things = [one for one, shape in enumerate(lowering.shapes) if shape.arm is None]
        cameras = lowering.cameras
        wanted = list(lowering.seen)
        hiders = len(lowering.shapes) + len(boards_of(lowering))
        if not wanted and len(things) * hiders * len(cameras) <= MOST_HIDERS:
            wanted = [(thing, name) for name in cameras for thing in things]
        labels: dict[str, int] = {}
        for thing, name in wanted:
            share = share_of(lowering, thing, cameras[name])
            if share is None:  # what things stand on allows too many cases
                continue
            self.shares += ((thing, name),)
            labels[f"share {thing} {name}"] = share
            labels[f"whole {thing} {name}"] = room_of(lowering, thing, cameras[name])
            labels[f"any {thing} {name}"] = room_of(lowering, thing, cameras[name], farthest=True)
        self.hands = tuple(lowering.hands)
        self.of_shares = lowering.builder.finish(labels)
        rooms = {f"hand {place}": number for place, number in enumerate(lowering.hands.values())}
        self.of_hands = lowering.builder.finish(rooms)

    def views(self, rows: Array) -> list[Seen]:
        """In scenes with the core's rows, (3M, B): what formulas ask for, or where none asks, each object."""
        values = label_values(self.of_shares, rows)
        found = []
        for thing, name in self.shares:
            share, whole, part = (values[f"{what} {thing} {name}"] for what in ("share", "whole", "any"))
            found.append(Seen(name, thing, np.clip(share, 0.0, 1.0), whole >= 0.0, part > 0.0))
        return found

    def grips(self, rows: Array) -> list[Grip]:
        """In scenes with the core's rows, (3M, B): one for each object, robot and depth of which formulas ask."""
        values = label_values(self.of_hands, rows)
        tried: dict[tuple[int, int, float], list[tuple[float, Array]]] = {}
        for place, (thing, robot, yaw, depth) in enumerate(self.hands):
            tried.setdefault((thing, robot, depth), []).append((yaw, values[f"hand {place}"]))
        found = []
        for (thing, robot, _), some in tried.items():
            rooms = np.stack([room for _, room in some])
            best = rooms.argmax(axis=0)
            found.append(Grip(thing, robot, np.array([yaw for yaw, _ in some])[best], rooms.max(axis=0)))
        return found


def label_values(core: Core, rows: Array) -> dict[str, Array]:
    """The numbers of a core by name in scenes with rows (3M, B), (B,) each."""
    if not core.labels:
        return {}
    one = rows.shape[1] == 1  # plain floats are faster
    values = evaluate(core, rows[:, 0].tolist()) if one else evaluate(core, list(rows), NUMPY)
    return {name: np.broadcast_to(values[at], rows.shape[1]) for name, at in core.labels.items()}


@lru_cache(maxsize=8)
def _sights(source: str) -> Sights | None:
    found = Sights()
    try:
        check_module(parse(Source("the spec of the scenes", source)), hook=found)
    except SpecError:  # its own formulas leave no room for more: what was checked before has no other mistake
        return None
    return found


def sights_of(spec: CheckedSpec) -> Sights | None:
    """The sights of a spec; None where it declares neither cameras nor robots, draws numbers of things, is about
    motions, or is too large for more."""
    if spec.timed is not None or spec.counts or not (spec.cameras or any(shape.arm for shape in spec.shapes)):
        return None
    return _sights(spec.source)
