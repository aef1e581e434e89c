"""Motions as arrays: written, read, and taken apart into scenes."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.api.request import Phi, check_request, read_phi
from scenegen.api.sample import run_in_memory
from scenegen.api.scene_arrays import header_of, stored_form
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec, check_spec
from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import NOT_OVER_TIME
from scenegen.pose import X
from scenegen.sampling.request import FixedPose, SampleRequest
from scenegen.scenes.blocks import Block
from scenegen.scenes.formats.motions import MOTION_FACTS, MotionArrays, motions_of, scenes_header, write_json
from scenegen.scenes.formats.registry import read_motions as read
from scenegen.scenes.formats.registry import write_motions
from scenegen.scenes.locations import as_location, is_set
from scenegen.validation import as_path

if TYPE_CHECKING:
    from scenegen.sampling.motions.schedule import Watch


@dataclass(frozen=True, slots=True, eq=False)
class MotionSet(MotionArrays):
    """n motions of N objects over T steps: `poses` (n, T + 1, N, 3), x and y in metres and theta in radians, objects in
    the order of `objects`, NaN for those that are not there. `phi` and `facts` map names to (n,) values. `header` is
    the motion file without motions."""

    warnings: tuple[Diagnostic, ...] = field(default=())

    @property
    def counts(self) -> dict[str, npt.NDArray[np.intp]]:
        """How many things there are, (n,) by array of objects, where that is drawn, in pairs. Of an object of a
        category the number of its asset, from 1."""
        if not self.header.counts:
            return {}
        return dict(zip((one.name for one in self.header.counts), self.numbers, strict=True))

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        """(n, N): which objects are there."""
        return ~np.isnan(self.poses[:, 0, :, X])

    @property
    def times(self) -> Array:
        """The moments in seconds, (T + 1,)."""
        return np.arange(self.poses.shape[1], dtype=np.float64) * self.header.time.dt

    def scenes(self, moment: int) -> SceneSet:
        """All motions at one moment, as a set of scenes: 0 is the first, -1 the last. phi is not kept. Raises
        IndexError."""
        return self._scenes(self.poses[:, moment])

    def motion(self, number: int) -> SceneSet:
        """The moments of one motion, from 0, as a set of scenes, in their order. Raises IndexError."""
        return self._scenes(self.poses[number])

    def _scenes(self, poses: Array) -> SceneSet:
        return SceneSet(poses, {}, scenes_header(self.header))

    def save(self, path: str | Path) -> Path:
        """Write the motions, as .json, .jsonl, .parquet or .csv by the path's ending; the file appears whole or not at
        all. A .csv file holds numbers alone. Raises RequestError, OutputError."""
        path = as_path("path", path)
        write_motions(path, self)
        return path

    def dump(self) -> bytes:
        """The bytes of the .json file."""
        sink = io.BytesIO()
        write_json(sink, self.header, tuple(self.phi), [self.block()], tuple(self.facts))
        return sink.getvalue()

    def figures(
        self,
        out: str | Path,
        *kinds: str,
        view: str = "perspective",
        size: tuple[int, int] | None = None,
        distinct: bool = False,
        label: str | None = None,
        workers: int | None = None,
    ) -> tuple[Path, ...]:
        """Draw every motion into the folder `out`; the paths of the files. `kinds` are of "gif" (motion_0001.gif: the
        motion, with phi below), "mp4" (the same as a video, with the extra `video`), "strip" (motion_0001_strip.png:
        six moments side by side) and "phi" (motion_0001_phi.png: phi over time). The other arguments are those of
        `SceneSet.figures`. phi at a moment is that of the formula from there on. Raises RequestError, OutputError."""
        from scenegen.pictures.scenes import motion_figures

        return motion_figures(self, out, *kinds, view=view, size=size, distinct=distinct, label=label, workers=workers)

    def animate(
        self,
        path: str | Path,
        motion: int | None = None,
        *,
        view: str = "perspective",
        size: tuple[int, int] | None = None,
        distinct: bool = False,
        label: str | None = None,
        workers: int | None = None,
    ) -> Path:
        """Draw one motion, with phi below, into a .gif or .mp4 file; `motion` counts from 1 and may be left out where
        there is only one. The file appears whole or not at all. The other arguments are those of `figures`. Raises
        RequestError, also without the extra `video` for .mp4, and OutputError."""
        from scenegen.pictures.scenes import animate

        return animate(self, path, motion, view=view, size=size, distinct=distinct, label=label, workers=workers)


def read_motions(path: str | Path) -> MotionSet:
    """The motions of a .json, .jsonl or .parquet file, or of a set by its folder or URL. Raises DataError,
    RequestError."""
    if is_set(path):
        from scenegen.scenes.sets import read_motion_set
        from scenegen.scenes.stores import open_store

        found = read_motion_set(open_store(as_location(path)))
    else:
        found = read(as_path("path", path))
    return MotionSet(found.poses, found.phi, found.facts, found.header)


def sample_motions(
    spec: Spec,
    phi: Phi | None = None,
    n: int = 16,
    *,
    seed: int = 0,
    method: str = "auto",
    spread: str = "flat",
    timeout: float = 60.0,
    keep_partial: bool = False,
    fix: Mapping[str, FixedPose | tuple[float, ...]] | None = None,
    settle: bool = False,
    workers: int | None = None,
) -> MotionSet:
    """n motions of a spec over time whose phi lies in the wanted range of every label; each is scored once more.

    Arguments are as of `sample`; `method` is `rejection`, `splitting`, or `auto`. The distribution is described in
    docs/motions.md: steps are uniform over what the spec allows, conditioned on requirement, limits and range. An
    object that `fix` names stays where it is, all the time. With `settle`, the first moment of each is one that stands
    still when dropped. `facts` holds `moved`, the number of objects that ever
    move, and `way`, the metres that all go together. The same arguments give the same motions, whatever `workers`.
    Raises RequestError for a request that is wrong or out of reach, for a spec without `time`, and where fewer than n
    motions were found, unless `keep_partial`.
    """
    request = SampleRequest(
        read_phi(spec, phi), n, seed=seed, method=method, spread=spread, timeout=timeout, keep_partial=keep_partial,
        fix={} if fix is None else fix, settle=settle, workers=workers,
    )  # fmt: skip
    return draw_motions(spec, request)


def draw_motions(spec: Spec, request: SampleRequest, *, watch: Watch | None = None) -> MotionSet:
    """The motions of a request; `watch` is shown what comes near it meanwhile. Raises what `sample_motions` raises."""
    check_spec(spec)
    if spec.over_time is None:
        raise RequestError(NOT_OVER_TIME(file=spec.definition.name))
    plan, drawn, warnings = run_in_memory(spec, check_request(spec, request), watch=watch)
    stored = stored_form(plan.problem)
    assert stored is not None
    found = motions_of(
        header_of(plan.problem, drawn.info), spec.labels, MOTION_FACTS, Block(stored(drawn.rows), drawn.phi)
    )
    return MotionSet(found.poses, found.phi, found.facts, found.header, warnings)
