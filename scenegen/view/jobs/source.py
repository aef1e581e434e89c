"""The spec that a message is about."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from scenegen.api.spec import Spec
from scenegen.errors import DataError, ScenegenError
from scenegen.errors.page import NO_MESSAGE
from scenegen.errors.render import render_all
from scenegen.lang.check import check_file
from scenegen.view.control import control

UNTITLED = "untitled.spec"


def path_of(message: dict[str, Any]) -> Path:
    """Where the spec of a message lies, or would lie if it were saved."""
    return Path(message["root"]) / (message.get("path") or UNTITLED)


def spec_of(message: dict[str, Any]) -> Spec:
    """The checked spec. What it imports is read from the folder that was opened. Raises SpecError."""
    path, root, text = path_of(message), Path(message["root"]), str(message["text"])
    if "import" in text:  # the files it imports may change between two messages
        return _checked(path, root, text)
    return _kept(path, root, text)


def _checked(path: Path, root: Path, text: str) -> Spec:
    try:
        data = text.encode()
    except UnicodeEncodeError:
        raise DataError(NO_MESSAGE(reason="half of a character in the text")) from None
    return Spec(check_file(path, data, root))


@lru_cache(maxsize=2)
def _kept(path: Path, root: Path, text: str) -> Spec:
    return _checked(path, root, text)


def refusal(error: ScenegenError) -> dict[str, Any]:
    """What the page shows of an error: the first problem in parts, and all of them as text."""
    one = error.diagnostics[0]
    found: dict[str, Any] = {
        "code": one.code,
        **{part: one.text(part, control) for part in ("title", "label", "note", "help")},
    }
    if one.span is not None:
        found["span"] = [one.span.start, one.span.end]
    return {**found, "text": render_all(error.diagnostics, spell=control)}
