"""Shared by all formats of scene files: strict reading of JSON, the header, and the errors for damaged files."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from pydantic import ValidationError

from scenegen.errors import DataError, Diagnostic, Source, Span
from scenegen.errors.files import DAMAGED_SCENES, NOT_JSON, NOT_SCENES, OTHER_OBJECTS
from scenegen.scenes.blocks import Block, check_counts, objects_of
from scenegen.scenes.data import SCENES_FORMAT, SCENES_VERSION, VERSION_WITH_HEIGHTS, SceneData, SceneFile

TAGS = ("pose", "resting")  # pydantic's names of the two kinds of poses, in the place of an error
HEADING = ("format", "version")  # is checked first


class _DuplicateKey(Exception):  # noqa: N818 - a signal from the JSON reader to `parse`
    """A key that occurs twice in one JSON object."""


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise _DuplicateKey(key)
            seen.add(key)
    return found


def parse(data: bytes, name: str) -> tuple[Any, str]:
    """The value of some bytes as JSON, and their text; `name` is the file's name in errors. Raises DataError."""
    try:
        text = data.decode("utf-8-sig")
        return json.loads(text, object_pairs_hook=_unique), text
    except UnicodeDecodeError as error:
        raise DataError(not_scenes(name, f"byte {error.start} is not UTF-8 text")) from None
    except json.JSONDecodeError as error:
        span = Span(Source(name, text), error.pos, error.pos + 1)
        said = (error.msg[:1].lower() + error.msg[1:]).removesuffix(" starting at")
        raise DataError(NOT_JSON(span, file=name, reason=said)) from None
    except _DuplicateKey as error:
        raise DataError(not_scenes(name, f"`{error}` stands twice in one object")) from None
    except ValueError:  # the only remaining cause: Python refuses integers of more than 4,300 digits
        raise DataError(not_scenes(name, "a number in it has thousands of digits")) from None
    except RecursionError:
        raise DataError(not_scenes(name, "it is nested too deeply")) from None


def scene_file(raw: Any, text: str, name: str) -> SceneFile:
    """The scene file from a JSON value and its text; its scenes are not checked. Raises DataError."""
    if not isinstance(raw, dict) or raw.get("format") != SCENES_FORMAT:
        poses = True if not isinstance(raw, dict) or raw.get("format") is None else None
        raise DataError(NOT_SCENES(file=name, reason=f'its "format" is not "{SCENES_FORMAT}"', poses=poses))
    if raw.get("version") not in (SCENES_VERSION, VERSION_WITH_HEIGHTS):
        wanted = f"{SCENES_VERSION} or {VERSION_WITH_HEIGHTS}"
        reason = f"it has version {raw.get('version')!r} of the format"
        raise DataError(NOT_SCENES(file=name, reason=reason, version=wanted))
    try:
        file = SceneFile.model_validate_json(text)
    except ValidationError as error:
        raise DataError(first_problem(name, error)) from None
    names = [one.name for one in file.objects]
    if len(set(names)) < len(names):
        raise DataError(DAMAGED_SCENES(file=name, place="objects", reason="two of them have the same name"))
    return file


def with_labels(header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> tuple[SceneFile, Iterator[Block]]:
    """The header to write before these scenes, and the scenes. Labels are read from the scenes; if there are none, the
    header names them."""
    found = (block for block in blocks if block.count)
    first = next(found, None)
    if first is None:
        return header.without_scenes(labels), iter(())
    return header.without_scenes(), itertools.chain([first], found)


def dump_header(header: SceneFile) -> str:
    """The header in one line of JSON, without the list of scenes."""
    data = header.model_dump(mode="json", exclude={"scenes"})
    return json.dumps(data, ensure_ascii=False, allow_nan=False)


def load_header(data: bytes, name: str) -> SceneFile:
    """The scene file from this line, the inverse of the function above. Raises DataError."""
    raw, _ = parse(data, name)
    if isinstance(raw, dict):
        if "scenes" in raw:
            raise DataError(not_scenes(name, "its header holds scenes"))
        raw = {**raw, "scenes": []}
    return scene_file(raw, json.dumps(raw), name)


def not_scenes(name: str, why: str) -> Diagnostic:
    return NOT_SCENES(file=name, reason=why)


def first_problem(name: str, error: ValidationError) -> Diagnostic:
    """The first error that pydantic found."""
    problems = error.errors(include_url=False)
    first = problems[0]
    place = [part for number, part in enumerate(first["loc"]) if not (part in TAGS and number > 1)]
    where = ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in place)
    more = len(problems) - 1 or None
    return DAMAGED_SCENES(file=name, place=where, reason=first["msg"].lower(), more=more)


def check_objects(header: SceneFile, scene: SceneData, name: str) -> None:
    """A scene has the objects of its file, or those that are there by its numbers of things; `name` is the scene's in
    errors. Raises DataError."""
    try:
        check_counts(header, scene)
    except ValueError as error:
        raise DataError(DAMAGED_SCENES(file=name, place="counts", reason=str(error))) from None
    wanted = objects_of(header, scene.counts or {})
    if scene.poses.keys() != set(wanted):
        raise DataError(OTHER_OBJECTS(scene=name, odd=min(scene.poses.keys() ^ set(wanted)), wanted=tuple(wanted)))
