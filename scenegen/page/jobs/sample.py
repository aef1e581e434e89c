"""Scenes of a request, exactly those that `scenegen sample` makes of it."""

from __future__ import annotations

import queue
import tempfile
import time
import zipfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from scenegen.api import sample as sampling
from scenegen.api.sample import glimpse, partial
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.errors.declarations import NEVER_SATISFIED
from scenegen.errors.program import ANOTHER_SPEC, NO_MESSAGE, PAGE_LIMIT
from scenegen.errors.requests import NO_SCENES, TOO_FEW_MOTIONS, UNKNOWN_CHOICE
from scenegen.needs import need
from scenegen.page.jobs.evaluate import scene_set, scenes_json
from scenegen.page.jobs.source import SLIGHTLY, give_way, run_calmly, spec_of
from scenegen.page.limits import MAX_PLAYED, most_scenes
from scenegen.sampling.request import DEFAULT_SCENES, Range, SampleRequest
from scenegen.scenes.data import RequestData
from scenegen.scenes.formats.registry import FORMATS, MOTION_FORMATS

if TYPE_CHECKING:
    from scenegen.api.motions import MotionSet
    from scenegen.learn.model import Model


MANY_THINGS = 4  # objects from which on a page asks for a first look, which goes before the scenes themselves
FIRST_LOOK_SCENES = 4  # scenes of the first look
SPREAD_SCENES = 32  # and of those over all of a range, at most
SAMPLE_SECONDS = 20.0  # seconds that sampling may take, unless the request says otherwise
MOTION_SECONDS = 45.0  # of motions: those at a rare phi take longer
MAX_SAMPLE_SECONDS = 55.0
BORDER_PHI = 1e-9  # phi, in metres or radians, up to which a formula is met by nothing but rounding
BEAT_SECONDS = 0.4  # seconds between two looks at motions that are being found
LOOK_LIMIT = 5.0  # seconds that the first look may take


def sample(message: dict[str, Any]) -> Iterator[Any]:
    """Verified scenes: poses (n, N, 3), phi by label, and how they were made."""
    spec = spec_of(message)
    request = request_of(message, spec)
    if spec.over_time is not None:
        yield from _motions(spec, request, message)
        return
    named = message.get("model") if request.method == "model" else None
    source = _model_of(str(named), spec) if named else None
    notes: list[str] = []
    began = time.perf_counter()

    def draw() -> SceneSet:
        return sampling.draw_scenes(source or spec, request, on_note=notes.append)

    found = (
        draw() if len(spec.objects) < MANY_THINGS else run_calmly(draw, SLIGHTLY)
    )  # the page asks for a first look, too
    data = scenes_data(spec, found)
    data["warnings"] += [
        {"code": NEVER_SATISFIED.code, "title": f"`{name}` is satisfied only at its border: phi is 0 in all scenes"}
        for name, values in found.phi.items()
        if _touches(request.phi.get(name), values)
    ]
    yield {**data, "notes": notes, "took": time.perf_counter() - began}


def _touches(wanted: Range | None, phi: npt.NDArray[np.float64]) -> bool:
    """Whether scenes that may have any phi from 0 up have no more than rounding makes."""
    if wanted is None or wanted.low != 0.0 or (wanted.high is not None and wanted.high <= BORDER_PHI):
        return False
    return bool(phi.max() < BORDER_PHI)


def _motions(spec: Spec, request: SampleRequest, message: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Motions (n, T + 1, N, 3), phi by label, and how they were made. With `watch`, a `look` now and then until they
    are there: those that come nearest, of which the first `hits` are in the range; `left` seconds remain at most."""
    from scenegen.api.motions import draw_motions
    from scenegen.page.jobs import motions

    began = time.perf_counter()
    news: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
    in_range = np.empty((0,))  # motions
    last = -BEAT_SECONDS  # when something was shown

    def watch(nearest: npt.NDArray[np.float64], hits: int) -> None:
        nonlocal in_range, last
        now = time.perf_counter() - began
        if len(in_range) == request.n or now - last < BEAT_SECONDS:
            return
        in_range, last = nearest[:hits], now
        news.put(
            {"look": motions.motions_json(spec, nearest, {}), "hits": hits, "left": max(0.0, request.timeout - now)}
        )

    def draw() -> MotionSet:
        try:
            return draw_motions(spec, request, watch=watch if message.get("watch") else None)
        finally:
            news.put(None)

    with ThreadPoolExecutor(1) as pool:  # so that what it finds is sent while it works
        under_way = pool.submit(draw)
        while (some := news.get()) is not None:
            yield some
        try:
            data = motions_data(spec, under_way.result())
        except RequestError:
            if not len(in_range):
                raise
            few = partial(TOO_FEW_MOTIONS(found=len(in_range), wanted=request.n, reason="time is up"))
            warnings = [{"code": few.code, "title": f"{few.title}; these are the first that were found, in no order"}]
            data = {**motions.motions_json(spec, in_range, {}), "warnings": warnings}
    yield {**data, "notes": [], "took": time.perf_counter() - began}


def motions_data(spec: Spec, found: MotionSet) -> dict[str, Any]:
    """Motions as the page takes them."""
    from scenegen.page.jobs.motions import motions_json

    warnings = [{"code": one.code, "title": one.title} for one in found.warnings]
    return {**motions_json(spec, found.poses, found.header.sampler), "warnings": warnings}


def first(message: dict[str, Any]) -> Iterator[Any]:
    """A few scenes in the range of a request, soon: something to look at until the scenes themselves are there. None
    where it fails. The page may ask before it knows what the text means: with `others`, the range of all labels that
    the request does not name, its labels are those of the text."""
    wanted = message.get("request") or {}
    if "others" in wanted:
        spec = spec_of(message)
        message = {**message, "request": fit_request(wanted, spec)}
    yield _glimpse(message, FIRST_LOOK_SCENES)


def fit_request(wanted: Mapping[str, Any], spec: Spec) -> dict[str, Any]:
    """A request made before its text was read: of the spec's labels, and with no object held that the spec lacks."""
    try:
        phi = {name: wanted["phi"].get(name, wanted["others"]) for name in spec.labels}
        fix = {name: pose for name, pose in wanted.get("fix", {}).items() if name in spec.objects}
        n = min(int(wanted.get("n", 16)), most_scenes(len(spec.objects)))
    except (TypeError, KeyError, AttributeError, ValueError, OverflowError):
        raise RequestError(NO_MESSAGE(reason="no request for scenes")) from None
    return {**wanted, "phi": phi, "fix": fix, "n": n}


def spread(message: dict[str, Any]) -> Iterator[Any]:
    """Some scenes over all of a range, soon, so that the page has some to show wherever a handle is moved. None where
    it fails."""
    give_way()
    yield _glimpse(message, SPREAD_SCENES)


def _glimpse(message: dict[str, Any], most: int) -> dict[str, Any] | None:
    spec = spec_of(message)
    if spec.over_time is not None:
        return None
    request = request_of(message, spec)
    try:
        found = glimpse(spec, request.phi, min(most, request.n), seed=request.seed, fix=request.fix, timeout=LOOK_LIMIT)
    except RequestError:
        return None
    return scenes_data(spec, found) if len(found) else None


def request_of(message: Mapping[str, Any], spec: Spec) -> SampleRequest:
    """The request of a page: what is found in its time is kept, by one process. Raises RequestError for what is no
    request."""
    wanted = message.get("request") or {}
    patience = SAMPLE_SECONDS if spec.over_time is None else MOTION_SECONDS
    try:
        n, seed = int(wanted.get("n", DEFAULT_SCENES)), int(wanted.get("seed", 0))
        seconds = min(float(message.get("timeout") or patience), MAX_SAMPLE_SECONDS)
        phi = {str(name): Range(_end(ends[0]), _end(ends[1])) for name, ends in dict(wanted.get("phi") or {}).items()}
        fix = {str(name): tuple(float(one) for one in pose) for name, pose in dict(wanted.get("fix") or {}).items()}
    except (TypeError, ValueError, LookupError, AttributeError, OverflowError):
        raise RequestError(NO_MESSAGE(reason="no request for scenes")) from None
    if spec.over_time is not None:
        from scenegen.page.jobs.motions import check_size

        check_size(spec, n)
    most = most_scenes(len(spec.objects))
    if not 1 <= n <= most:
        raise RequestError(PAGE_LIMIT(most=most, count=n, what="scenes"))
    bounded = {name: ends for name, ends in phi.items() if ends != Range()}
    return SampleRequest(
        bounded, n, seed, str(wanted.get("method", "auto")), str(wanted.get("spread", "flat")), fix, timeout=seconds,
        keep_partial=True, workers=1,
    )  # fmt: skip


def _end(value: Any) -> float | None:
    return None if value is None else float(value)


def scenes_data(spec: Spec, found: SceneSet) -> dict[str, Any]:
    """Scenes as the page takes them."""
    warnings = [{"code": one.code, "title": one.title} for one in found.warnings]
    return {**scenes_json(spec, found), "warnings": warnings}


def _model_of(path: str, spec: Spec) -> Model:
    """The model of a spec; in a folder of models, that of its numbers of things. Raises RequestError where it is of
    another spec."""
    each = {one.spec.definition.sha256: one for _, one in _model(path).members}
    if spec.checked.sha256 not in each:
        raise RequestError(ANOTHER_SPEC())
    return each[spec.checked.sha256]


@lru_cache(maxsize=1)
def _model(path: str) -> Model:
    from scenegen.learn.model import load_model

    return load_model(path)


PLAYED = "gif"  # of motions alone


def download(message: dict[str, Any]) -> Iterator[Any]:
    """Write the scenes of `poses` as `format` into the folder `into`, which the server has made; yields the file's
    name. phi is computed again: what a page sends is not taken on trust. Simulators' files come as one archive."""
    from scenegen.worlds.exporting import EXPORTS

    wanted = str(message.get("format"))
    spec = spec_of(message)
    table, more = (FORMATS, tuple(EXPORTS)) if spec.over_time is None else (MOTION_FORMATS, (PLAYED,))
    known = (*(ending[1:] for ending in FORMATS if ending in table), *more)
    if wanted not in known:
        raise RequestError(UNKNOWN_CHOICE(what="format", name=wanted, known=known))
    if spec.over_time is not None:
        yield _motion_file(spec, message, wanted)
        return
    request = request_of(message, spec)
    sampler = message.get("sampler")
    scenes = scene_set(spec, message["poses"], sampler if isinstance(sampler, dict) else None, message.get("on"))
    if not len(scenes):
        raise RequestError(NO_SCENES())
    ranges = {name: (one.low, one.high) for name, one in request.phi.items()}
    data = RequestData(phi=ranges, n=request.n, spread=cast("Any", request.spread))
    header = scenes.header.model_copy(update={"request": data})
    scenes = replace(scenes, header=header, trusted=True)
    into = Path(message["into"])
    if f".{wanted}" in FORMATS:
        yield scenes.save(into / f"scenes.{wanted}").name
        return
    with tempfile.TemporaryDirectory(dir=into) as folder:
        scenes.export(Path(folder) / wanted, wanted)
        archive = into / f"scenes_{wanted}.zip"
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
            for path in sorted((Path(folder) / wanted).rglob("*")):
                out.write(path, path.relative_to(folder))
    yield archive.name


def _motion_file(spec: Spec, message: dict[str, Any], wanted: str) -> str:
    """Motions as a file, or the first of them as a GIF."""
    from scenegen.page.jobs import motions

    given = message.get("sampler")
    poses = motions.motions_of(spec, message["poses"])
    found = motions.motion_set(spec, poses, given if isinstance(given, dict) else {}, request_of(message, spec))
    into = Path(message["into"])
    if wanted != PLAYED:
        return found.save(into / f"motions.{wanted}").name
    if poses.shape[1] > MAX_PLAYED:
        raise RequestError(PAGE_LIMIT(moments=poses.shape[1], most=MAX_PLAYED))
    need("pybullet", "to draw pictures")
    return replace(found, poses=poses[:1]).animate(into / "motion.gif", 1, workers=1).name
