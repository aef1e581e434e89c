"""What all formats of scene files share: JSON read with care, the header, and what is said about damage."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from pydantic import ValidationError

from scenegen.errors import DataError, Diagnostic, Source, Span, quoted
from scenegen.formats.blocks import Block
from scenegen.scene.data import FORMAT, VERSION, SceneFile

HEADING = ("format", "version")  # what is looked at before all else
HELP = "make one with `scenegen sample ... --out scenes.json`"


class _Twice(Exception):  # noqa: N818 - a signal from the JSON reader to `parse`
    """A key that stands twice in one JSON object."""


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise _Twice(key)
            seen.add(key)
    return found


def parse(data: bytes, name: str) -> tuple[Any, str]:
    """The value that some bytes hold as JSON, and their text; `name` is what errors call them. Raises DataError."""
    try:
        text = data.decode("utf-8-sig")
        return json.loads(text, object_pairs_hook=_unique), text
    except UnicodeDecodeError as error:
        raise DataError(not_scenes(name, f"byte {error.start} is not UTF-8 text")) from None
    except json.JSONDecodeError as error:
        span = Span(Source(name, text), error.pos, error.pos + 1)
        said = (error.msg[:1].lower() + error.msg[1:]).removesuffix(" starting at")
        raise DataError(Diagnostic(f"{name} is not valid JSON", span, said, HELP)) from None
    except _Twice as error:
        raise DataError(not_scenes(name, f"`{error}` stands twice in one object")) from None
    except ValueError:  # the one left: Python refuses to read integers of more than 4,300 digits
        raise DataError(not_scenes(name, "a number in it has thousands of digits")) from None
    except RecursionError:
        raise DataError(not_scenes(name, "it is nested too deeply")) from None


def scene_file(raw: Any, text: str, name: str) -> SceneFile:
    """The scene file that a JSON value and its text stand for; no look at its scenes. Raises DataError."""
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise DataError(not_scenes(name, f'its "format" is not "{FORMAT}"'))
    if raw.get("version") != VERSION:
        title = f"{name} has version {raw.get('version')!r} of the scene format"
        raise DataError(Diagnostic(title, help=f"this scenegen reads version {VERSION}"))
    try:
        file = SceneFile.model_validate_json(text)
    except ValidationError as error:
        raise DataError(first_problem(name, error)) from None
    names = [one.name for one in file.objects]
    if len(set(names)) < len(names):
        raise DataError(Diagnostic(f"{name} names an object twice", help=HELP))
    return file


def labelled(header: SceneFile, labels: Sequence[str], blocks: Iterable[Block]) -> tuple[SceneFile, Iterator[Block]]:
    """The header as it is to be written before these scenes, and the scenes: where there are none it names the labels,
    which are in the scenes otherwise."""
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
    """The other way round. Raises DataError."""
    raw, _ = parse(data, name)
    if isinstance(raw, dict):
        if "scenes" in raw:
            raise DataError(not_scenes(name, "its header holds scenes"))
        raw = {**raw, "scenes": []}
    return scene_file(raw, json.dumps(raw), name)


def not_scenes(name: str, why: str) -> Diagnostic:
    return Diagnostic(f"{name} is not a scenes file: {why}", help=HELP)


def first_problem(name: str, error: ValidationError) -> Diagnostic:
    """The first of what pydantic found wrong."""
    problems = error.errors(include_url=False)
    first = problems[0]
    where = ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in first["loc"])
    more = f" ({len(problems) - 1} more problems)" if len(problems) > 1 else ""
    place = f" at `{where}`" if where else ""
    return Diagnostic(f"{name} is damaged{place}: {first['msg'].lower()}{more}", help="counting starts at 1")


def odd_objects(scene: str, found: set[str], wanted: list[str]) -> Diagnostic:
    """A scene that lacks an object of its file, or places another one."""
    title = f"{scene} does not place the file's objects: `{min(found ^ set(wanted))}`"
    return Diagnostic(title, help=f"every scene places {quoted(wanted)}")
