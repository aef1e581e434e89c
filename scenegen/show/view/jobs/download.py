"""The scenes on the page as files."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from scenegen.api.spec import Spec
from scenegen.errors import RequestError
from scenegen.errors.program import LONG_GIF
from scenegen.errors.requests import NO_SCENES, UNKNOWN_CHOICE
from scenegen.needs import need
from scenegen.scenes.data import RequestData
from scenegen.show.view.jobs.evaluate import scene_set
from scenegen.show.view.jobs.sample import request_of
from scenegen.show.view.jobs.source import spec_of
from scenegen.show.view.limits import MAX_PLAYED

FILES = ("json", "jsonl", "parquet")
FOLDERS = ("mjcf", "sdf", "usd")
PLAYED = "gif"  # of motions alone


def download(message: dict[str, Any]) -> Iterator[Any]:
    """Write the scenes of `poses` as `format` into the folder `into`, which the server has made; yields the file's
    name. phi is computed again: what a page sends is not taken on trust. Simulators' files come as one archive."""
    wanted = str(message.get("format"))
    spec = spec_of(message)
    known = (*FILES, *(FOLDERS if spec.over_time is None else (PLAYED,)))
    if wanted not in known:
        raise RequestError(UNKNOWN_CHOICE(what="format", name=wanted, known=known))
    if spec.over_time is not None:
        yield _motions(spec, message, wanted)
        return
    request = request_of(message, spec)
    sampler = message.get("sampler")
    scenes = scene_set(spec, message["poses"], sampler if isinstance(sampler, dict) else None, message.get("on"))
    if not len(scenes):
        raise RequestError(NO_SCENES())
    ends = {name: (low, high) for name, (low, high) in request["phi"].items()}
    data = RequestData(phi=ends, n=max(1, request["n"]), spread=request["spread"])
    scenes = replace(scenes, header=scenes.header.model_copy(update={"request": data}), trusted=True)
    into = Path(message["into"])
    if wanted in FILES:
        yield scenes.save(into / f"scenes.{wanted}").name
        return
    with tempfile.TemporaryDirectory(dir=into) as folder:
        scenes.export(Path(folder) / wanted, wanted)
        archive = into / f"scenes_{wanted}.zip"
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
            for path in sorted((Path(folder) / wanted).rglob("*")):
                out.write(path, path.relative_to(folder))
    yield archive.name


def _motions(spec: Spec, message: dict[str, Any], wanted: str) -> str:
    """Motions as a file, or the first of them as a GIF."""
    from scenegen.show.view.jobs import motions

    given = message.get("sampler")
    poses = motions.motions_of(spec, message["poses"])
    found = motions.motion_set(spec, poses, given if isinstance(given, dict) else {}, request_of(message, spec))
    into = Path(message["into"])
    if wanted != PLAYED:
        return found.save(into / f"motions.{wanted}").name
    if poses.shape[1] > MAX_PLAYED:
        raise RequestError(LONG_GIF(moments=poses.shape[1], most=MAX_PLAYED))
    need("pybullet", "to draw pictures")
    return replace(found, poses=poses[:1]).animate(into / "motion.gif", 1, workers=1).name
