"""Scenes of a file as a spec has them: its objects in its order, in its workspace, as it requires. Plain numpy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, Diagnostic, quoted
from scenegen.lang.core import REQUIRE, gated
from scenegen.lang.interpret import phi as score
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]

HELD = 1e-9  # metres and radians by which an object that is held in place may be off in a file
OUTSIDE = 1e-6  # metres by which a centre may lie outside of the workspace: files of other programs round
UNMET = 1e-6  # by which a requirement may be missed, for the same reason


def order_of(spec: CheckedSpec, objects: Sequence[str]) -> list[int]:
    """Where each object of the spec stands among `objects`. Raises DataError unless they are the same."""
    if set(objects) != set(spec.objects):
        missing = sorted(set(spec.objects) - set(objects))
        extra = sorted(set(objects) - set(spec.objects))
        parts = [f"the scenes lack {quoted(missing)}"] if missing else []
        parts += [f"the spec does not know {quoted(extra)}"] if extra else []
        help_ = f"the spec is about {quoted(spec.objects)}, the scenes are about {quoted(objects)}"
        raise DataError(Diagnostic(f"these scenes are not of this spec: {'; '.join(parts)}", help=help_))
    place = {name: index for index, name in enumerate(objects)}
    return [place[name] for name in spec.objects]


def arranged(rows: Array, order: Sequence[int]) -> Array:
    """(3N, m) storage with its objects in another order."""
    if list(order) == sorted(order):
        return rows
    return rows[[3 * place + axis for place in order for axis in range(3)]]


def check_held(spec: CheckedSpec, rows: Array, before: int = 0) -> None:
    """Raises DataError where an object that the spec holds in place stands elsewhere in `rows` (3N, m), the spec's
    objects in order; `before` scenes of the file came before these."""
    for index, pose in spec.fixed.items():
        moved = (np.abs(rows[3 * index : 3 * index + 3].T - pose) > HELD).any(axis=1)
        if moved.any():
            name, first = spec.objects[index], before + int(moved.argmax())
            where = ", ".join(f"{number:g}" for number in pose)
            title = f"`{name}` is held at ({where}) by the spec, but stands elsewhere in scene {first + 1}"
            raise DataError(Diagnostic(title, help="use scenes that were sampled from this spec"))


def check_scenes(spec: CheckedSpec, rows: Array, before: int = 0) -> None:
    """Raises DataError for a scene that the base distribution of the spec does not have: with an object that is held
    elsewhere, a centre outside of the workspace, or something required that is not met."""
    check_held(spec, rows, before)
    low, high = spec.box()
    for axis in range(2):
        part = slice(axis, None, 3)
        over = np.maximum(low[part, None] - rows[part], rows[part] - high[part, None])
        if over.size and over.max() > OUTSIDE:
            index, scene = np.unravel_index(int(over.argmax()), over.shape)
            title = f"`{spec.objects[int(index)]}` is outside of the workspace in scene {before + int(scene) + 1}"
            raise DataError(Diagnostic(title, help="use scenes that were sampled from this spec"))
    if spec.core.requirement is None:
        return
    margin = np.broadcast_to(score(gated(spec.core), list(rows), NUMPY)[REQUIRE], rows.shape[1])
    if (margin < -UNMET).any():
        first = before + int((margin < -UNMET).argmax())
        title = f"scene {first + 1} does not meet what the spec requires"
        raise DataError(Diagnostic(title, help="use scenes that were sampled from this spec"))
