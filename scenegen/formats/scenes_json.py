"""Scenes as JSON: the header indented, then one scene a line, so that files can be read, grepped and diffed."""

from __future__ import annotations

import json
from typing import Any

from pydantic import ValidationError

from scenegen.errors import DataError, Diagnostic, Source, Span, quoted
from scenegen.scene.data import FORMAT, VERSION, SceneFile


def dump(file: SceneFile) -> bytes:
    """The bytes of a scene file; floats are written so that they read back bit for bit."""
    data = file.model_dump(mode="json")
    scenes = data.pop("scenes")
    header = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)
    lines = ",\n".join("  " + json.dumps(scene, ensure_ascii=False, allow_nan=False) for scene in scenes)
    body = f"[\n{lines}\n ]" if scenes else "[]"
    return f'{header.removesuffix("}").rstrip()},\n "scenes": {body}\n}}\n'.encode()


_HELP = "make one with `scenegen sample ... --out scenes.json`"


class _Twice(Exception):  # noqa: N818 - a signal from the JSON reader to `load`
    """A key that stands twice in one JSON object."""


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise _Twice(next(key for key in keys if keys.count(key) > 1))
    return found


def load(data: bytes, name: str) -> SceneFile:
    """The scene file in some bytes; `name` is what errors call it. Raises DataError."""
    try:
        text = data.decode("utf-8-sig")
        raw = json.loads(text, object_pairs_hook=_unique)
    except UnicodeDecodeError as error:
        raise DataError(_not_scenes(name, f"byte {error.start} is not UTF-8 text")) from None
    except json.JSONDecodeError as error:
        span = Span(Source(name, text), error.pos, error.pos + 1)
        said = (error.msg[:1].lower() + error.msg[1:]).removesuffix(" starting at")
        raise DataError(Diagnostic(f"{name} is not valid JSON", span, said, _HELP)) from None
    except _Twice as error:
        raise DataError(_not_scenes(name, f"`{error}` stands twice in one object")) from None
    except ValueError:  # the one left: Python refuses to read integers of more than 4,300 digits
        raise DataError(_not_scenes(name, "a number in it has thousands of digits")) from None
    except RecursionError:
        raise DataError(_not_scenes(name, "it is nested too deeply")) from None
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise DataError(_not_scenes(name, f'its "format" is not "{FORMAT}"'))
    if raw.get("version") != VERSION:
        title = f"{name} has version {raw.get('version')!r} of the scene format"
        raise DataError(Diagnostic(title, help=f"this scenegen reads version {VERSION}"))
    try:
        file = SceneFile.model_validate_json(text)
    except ValidationError as error:
        raise DataError(_first_problem(name, error)) from None
    _check_consistent(file, name)
    return file


def _not_scenes(name: str, why: str) -> Diagnostic:
    return Diagnostic(f"{name} is not a scenes file: {why}", help=_HELP)


def _first_problem(name: str, error: ValidationError) -> Diagnostic:
    problems = error.errors(include_url=False)
    first = problems[0]
    where = ".".join(str(part + 1) if isinstance(part, int) else str(part) for part in first["loc"])
    more = f" ({len(problems) - 1} more problems)" if len(problems) > 1 else ""
    return Diagnostic(f"{name} is damaged at `{where}`: {first['msg'].lower()}{more}", help="counting starts at 1")


def _check_consistent(file: SceneFile, name: str) -> None:
    """Every scene places every object, and no others, and carries the same labels."""
    names = [one.name for one in file.objects]
    if len(set(names)) < len(names):
        raise DataError(Diagnostic(f"{name} names an object twice", help=_HELP))
    for number, scene in enumerate(file.scenes, 1):
        if scene.poses.keys() != set(names):
            odd = sorted(scene.poses.keys() ^ set(names))
            title = f"scene {number} of {name} does not place the file's objects: `{odd[0]}`"
            raise DataError(Diagnostic(title, help=f"every scene places {quoted(names)}"))
        if scene.phi.keys() != file.scenes[0].phi.keys():
            help_ = f"scene 1 has {quoted(file.scenes[0].phi)}"
            raise DataError(Diagnostic(f"scene {number} of {name} has other labels than scene 1", help=help_))
