"""Motions as arrays: written, read, and taken apart into scenes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.api.request import Phi, check_request, read_phi
from scenegen.api.sample import partial
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec, check_spec, refuse_choices
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.errors.time import NOT_FOR_MOTIONS, NOT_OVER_TIME, TOO_FEW_MOTIONS
from scenegen.pose import X
from scenegen.sampling.request import FixedPose, SampleRequest
from scenegen.scenes.data import RequestData
from scenegen.scenes.formats.motions.table import MotionArrays, scenes_header
from scenegen.scenes.formats.motions.table import read_motions as read
from scenegen.scenes.formats.motions.table import write_motions as write
from scenegen.scenes.motions import MotionFile, MotionRequestData, TimeData
from scenegen.validation import as_path

if TYPE_CHECKING:
    from scenegen.processes.ahead import IdleWorkers
    from scenegen.sampling.motions.schedule import Watch

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MotionSet:
    """n motions of N objects over T steps: `poses` (n, T + 1, N, 3), x and y in metres and theta in radians, objects in
    the order of `objects`, NaN for those that are not there. `phi` and `facts` map names to (n,) values. `header` is
    the motion file without motions."""

    poses: Array
    phi: Mapping[str, Array]
    facts: Mapping[str, Array]
    header: MotionFile
    warnings: tuple[Diagnostic, ...] = field(default=())

    def __len__(self) -> int:
        return int(self.poses.shape[0])

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    @property
    def counts(self) -> dict[str, npt.NDArray[np.intp]]:
        """How many things there are, (n,) by array of objects, where that is drawn, in pairs. Of an object of a
        category the number of its asset, from 1."""
        if not self.header.counts:
            return {}
        return dict(zip((one.name for one in self.header.counts), self._arrays().numbers, strict=True))

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

    def _arrays(self) -> MotionArrays:
        return MotionArrays(self.header, self.poses, self.phi, self.facts)

    def save(self, path: str | Path) -> Path:
        """Write the motions, as .json, .jsonl, .parquet or .csv by the path's ending; the file appears whole or not at
        all. A .csv file holds numbers alone. Raises RequestError, OutputError."""
        path = as_path("path", path)
        write(path, self._arrays())
        return path

    def dump(self) -> bytes:
        """The bytes of the .json file."""
        import io

        from scenegen.scenes.formats.motions.text import write as write_text

        sink = io.BytesIO()
        write_text(sink, self._arrays(), ".json")
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
        from scenegen.show.scenes import motion_figures

        return motion_figures(
            self._arrays(), out, *kinds, view=view, size=size, distinct=distinct, label=label, workers=workers
        )

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
        from scenegen.show.scenes import animate

        return animate(
            self._arrays(), path, motion, view=view, size=size, distinct=distinct, label=label, workers=workers
        )


def read_motions(path: str | Path) -> MotionSet:
    """The motions of a .json, .jsonl or .parquet file. Raises DataError, RequestError."""
    found = read(as_path("path", path))
    return MotionSet(found.poses, found.phi, found.facts, found.header)


METHODS = ("auto", "rejection", "splitting")


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
    workers: int | None = None,
) -> MotionSet:
    """n motions of a spec over time whose phi lies in the wanted range of every label; each is scored once more.

    Arguments are as of `sample`; `method` is `rejection`, `splitting`, or `auto`. The distribution is described in
    docs/motions.md: steps are uniform over what the spec allows, conditioned on requirement, limits and range. An
    object that `fix` names stays where it is, all the time. `facts` holds `moved`, the number of objects that ever
    move, and `way`, the metres that all go together. The same arguments give the same motions, whatever `workers`.
    Raises RequestError for a request that is wrong or out of reach, for a spec without `time`, and where fewer than n
    motions were found, unless `keep_partial`.
    """
    request = SampleRequest(
        read_phi(spec, phi), n, seed=seed, method=method, spread=spread, timeout=timeout, keep_partial=keep_partial,
        fix={} if fix is None else fix, workers=workers,
    )  # fmt: skip
    return draw_motions(spec, request)


def draw_motions(
    spec: Spec, request: SampleRequest, *, reserve: IdleWorkers | None = None, watch: Watch | None = None
) -> MotionSet:
    """The motions of a request, by the processes of `reserve` if there is one; `watch` is shown what comes near it
    meanwhile. Raises what `sample_motions` raises."""
    from scenegen.sampling.engine.run import MOTIONS, open_budget
    from scenegen.sampling.motions.sampler import sample
    from scenegen.sampling.motions.scores import make_problem

    check_spec(spec)
    if spec.over_time is None:
        raise RequestError(NOT_OVER_TIME(file=spec.declared.name))
    refuse_choices(spec, "a motion")
    for argument in ("settle", "raw"):
        if getattr(request, argument):
            raise RequestError(NOT_FOR_MOTIONS(argument=argument))
    if request.method not in METHODS:
        raise RequestError(UNKNOWN_CHOICE(what="method", name=request.method, known=METHODS))
    request = replace(check_request(spec, replace(request, method="auto")), method=request.method)
    with open_budget(request, load=MOTIONS, reserve=reserve) as budget:
        problem, warnings = make_problem(spec.declared, request, budget)
        made = sample(problem, budget, method=request.method, watch=watch)
    if not made.complete:
        reason = "time is up" if budget.spent else "the search did not reach the range"
        shortfall = TOO_FEW_MOTIONS(found=made.count, wanted=request.n, reason=reason)
        if not (request.keep_partial and made.count):
            raise RequestError(shortfall)
        warnings = (*warnings, partial(shortfall))
    phi = dict(zip(spec.labels, np.ascontiguousarray(made.phi.T), strict=True))
    steps = np.hypot(*np.moveaxis(np.diff(made.poses[..., :2], axis=1), -1, 0))
    facts = {"moved": (steps > 0.0).any(axis=1).sum(axis=1).astype(np.float64), "way": steps.sum(axis=(1, 2))}
    ranges = {name: (one.low, one.high) for name, one in request.phi.items()}
    info = dict(made.info)
    scenes = make_header(spec.declared, info, RequestData(phi={}, n=request.n))
    header = MotionFile(
        spec=scenes.spec, workspace=scenes.workspace, objects=scenes.objects, regions=scenes.regions, sampler=info,
        time=TimeData(steps=problem.steps, dt=problem.dt), motions=[],
        request=MotionRequestData(phi=ranges, n=request.n),
    )  # fmt: skip
    return MotionSet(made.poses, phi, facts, header, warnings)
