"""The spec that a message is about."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from scenegen.api.spec import Spec
from scenegen.errors import DataError, Diagnostic, ScenegenError
from scenegen.errors.page import NO_MESSAGE
from scenegen.errors.render import render_all
from scenegen.lang.check import check_file
from scenegen.view.control import control, without_command_line

UNTITLED = "untitled.spec"
Counts = tuple[tuple[str, int], ...]


def path_of(message: dict[str, Any]) -> Path:
    """Where the spec of a message lies, or would lie if it were saved."""
    return Path(message["root"]) / (message.get("path") or UNTITLED)


def spec_of(message: dict[str, Any]) -> Spec:
    """The checked spec. What it imports is read from the folder that was opened. Of one that draws how many things
    there are, that with the numbers of the message. Raises SpecError."""
    path, root, text = path_of(message), Path(message["root"]), str(message["text"])
    wanted = wanted_counts(message)
    if "import" in text:  # the files it imports may change between two messages
        return _checked(path, root, text, wanted)
    return _kept(path, root, text, wanted)


def wanted_counts(message: Mapping[str, Any]) -> Counts:
    """The numbers of things that a message asks for, by name. Raises DataError for what are no numbers."""
    given = message.get("counts") or {}
    if not isinstance(given, dict) or not all(type(one) is int for one in given.values()):
        raise DataError(NO_MESSAGE(reason="no numbers of things"))
    return tuple(sorted(given.items()))


def with_numbers(spec: Spec, wanted: Counts) -> tuple[Spec, dict[str, int]]:
    """The spec with as many things as wanted, and these numbers. Of what the message does not say, or what the spec no
    longer allows, there are as many as there can be."""
    asked = dict(wanted)
    numbers = {
        name: asked[name] if least <= asked.get(name, least - 1) <= most else most
        for name, (least, most) in spec.counts.items()
    }
    if not numbers:
        return spec, numbers
    for known, member in spec.members:  # they are checked already, and their formulas point into the text
        if known == numbers:
            return member, numbers
    raise AssertionError("every combination of numbers has a member")


def _checked(path: Path, root: Path, text: str, wanted: Counts) -> Spec:
    try:
        data = text.encode()
    except UnicodeEncodeError:
        raise DataError(NO_MESSAGE(reason="half of a character in the text")) from None
    return with_numbers(Spec(check_file(path, data, root)), wanted)[0]


_kept = lru_cache(maxsize=2)(_checked)


def inside(text: str, root: str | None) -> str:
    """A text that names files of the folder as the page does, without the folder."""
    return text.replace(f"{str(root).rstrip('/')}/", "") if root else text


def _said(one: Diagnostic, part: str, root: str | None) -> str:
    told = inside(one.text(part, control), root)
    # a range stands in every part, and where something lies, as in `my.spec:2:28`, in notes
    return told if part == "note" else without_command_line(told)


def refusal(error: ScenegenError, root: str | None = None) -> dict[str, Any]:
    """What the page shows of an error: the first problem in parts, and all of them as text. Files of the folder `root`
    are named as the page names them."""
    one = error.diagnostics[0]
    found: dict[str, Any] = {
        "code": one.code,
        **{part: _said(one, part, root) for part in ("title", "label", "note", "help")},
    }
    if one.span is not None:
        found["span"] = [one.span.start, one.span.end]
    return {**found, "text": inside(render_all(error.diagnostics, spell=control), root)}
