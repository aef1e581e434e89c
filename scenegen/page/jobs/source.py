"""The spec that a message is about; errors, formulas and active atoms in the form that the page takes."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from scenegen.api.outline import OutlinePart
from scenegen.api.scene_arrays import make_header
from scenegen.api.spec import Spec
from scenegen.arrays import Array
from scenegen.errors import DataError, Diagnostic, ScenegenError, Span
from scenegen.errors.diagnostic import render_all
from scenegen.errors.program import NO_MESSAGE
from scenegen.lang.checker import check_file
from scenegen.lang.formula.core import REQUIRE, Atom, Core, Junction
from scenegen.looks.stage import PictureSetup, stage_of
from scenegen.page.limits import control, without_command_line
from scenegen.pictures.figures.dimensions import Dimension, Guide, Mark, Turn, dimensions
from scenegen.scenes.data import RequestData, SceneFile

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
        return _check(path, root, text, wanted)
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


def _check(path: Path, root: Path, text: str, wanted: Counts) -> Spec:
    try:
        data = text.encode()
    except UnicodeEncodeError:
        raise DataError(NO_MESSAGE(reason="half of a character in the text")) from None
    return with_numbers(Spec(check_file(path, data, root)), wanted)[0]


_kept = lru_cache(maxsize=2)(_check)


def numbers_of(value: object) -> Array:
    """Numbers as they come from a page; an empty array for what are none."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        return np.empty(0)


def inside(text: str, root: str | None) -> str:
    """A text that names files of the folder as the page does, without the folder."""
    return text.replace(f"{str(root).rstrip('/')}/", "") if root else text


def _part_text(one: Diagnostic, part: str, root: str | None) -> str:
    told = inside(one.text(part, control), root)
    # a range stands in every part, and where something lies, as in `my.spec:2:28`, in notes
    return told if part == "note" else without_command_line(told)


def refusal(error: ScenegenError, root: str | None = None) -> dict[str, Any]:
    """What the page shows of an error: the first problem in parts, and all of them as text. Files of the folder `root`
    are named as the page names them."""
    one = error.diagnostics[0]
    found: dict[str, Any] = {
        "code": one.code,
        **{part: _part_text(one, part, root) for part in ("title", "label", "note", "help")},
    }
    if one.span is not None:
        found["span"] = [one.span.start, one.span.end]
    return {**found, "text": inside(render_all(error.diagnostics, spell=control), root)}


@lru_cache(maxsize=2)
def header_of(spec: Spec) -> SceneFile:
    """A scene file of a spec without any scene."""
    return make_header(spec.definition, {}, RequestData(phi={}, n=1, spread="flat"))


@lru_cache(maxsize=2)
def stage_of_spec(spec: Spec) -> PictureSetup:
    """The table of a spec without any scene on it."""
    return stage_of(header_of(spec), held=spec.definition.fixed)


Result = TypeVar("Result")

NICE = 10  # of 19: how far work gives way that nobody waits for
SLIGHTLY = 2  # and work that somebody waits for, after a first look


def run_calmly(work: Callable[[], Result], nice: int = NICE) -> Result:
    """Do work in a thread of its own that gives way to other processes. A process could not take that back afterwards,
    and its next job may be urgent; on Linux a thread has a priority of its own. Raises what the work raises."""
    _own_priority()
    with ThreadPoolExecutor(1, initializer=give_way, initargs=(nice,)) as pool:
        return pool.submit(work).result()


def give_way(nice: int = NICE) -> None:
    """Let the thread that calls this give way by so much, for good."""
    with contextlib.suppress(OSError):  # elsewhere, threads are no processes: the work is urgent then
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), min(_own_priority() + nice, 19))


@cache
def _own_priority() -> int:
    """What this process began with."""
    return os.getpriority(os.PRIO_PROCESS, 0)


def mark_data(mark: Mark) -> dict[str, Any]:
    """A dimension line, an angle or a guide, as plain data."""
    match mark:
        case Dimension(start, end, text, good):
            return {"kind": "line", "start": start, "end": end, "text": text, "good": good}
        case Turn(center, start_angle, stop_angle, text, good):
            return {
                "kind": "turn", "center": center, "from": start_angle, "to": stop_angle, "text": text, "good": good,
            }  # fmt: skip
        case Guide(start, end):
            return {"kind": "guide", "start": start, "end": end}


def decider_json(
    core: Core, index: int, label: str, value: float, lines: list[int], rows: Sequence[float]
) -> dict[str, Any]:
    """What the page shows of the atom (its node) that decides phi of a label in a scene, and of the lines that it
    stands in."""
    atom = cast(Atom, core.nodes[index])
    return {
        "text": atom.text,
        "spans": _places(atom),
        "value": value,
        "lines": lines,
        "marks": [mark_data(one) for one in dimensions(core, index, rows)],
        "required": label == REQUIRE,
        "unit": str(atom.unit),
    }


MAX_TREE_LINES = 300  # lines of one label
MAX_LINE_NODES = 400  # nodes of one line whose values are looked at

Json = dict[str, Any]


Part = TypeVar("Part")


def tree_of(root: Part, line_of: Callable[[Part, bool], tuple[Json, list[Part]]]) -> Json:
    """The line of a part with those below it, of MOST lines the first. `line_of` makes the line of a part, of which the
    least counts for the line above it, or the largest, and says what lies below it."""
    made, below = line_of(root, True)
    waiting, count = [(made, below)], 1
    while waiting:
        line, parts = waiting.pop(0)
        least = line["kind"] != "one"
        for part in parts:
            count += 1
            if count > MAX_TREE_LINES:
                line["more"] = line.get("more", 0) + 1
                continue
            one, further = line_of(part, least)
            line["parts"].append(one)
            waiting.append((one, further))
    return made


def line_of(core: Core, part: OutlinePart, number: int) -> Json:
    """A line of a formula of scenes."""
    node, line = core.nodes[part.nodes[0]], part.line
    kind = ("all" if node.kind == "min" else "one") if isinstance(node, Junction) else "atom"
    return {
        "line": number, "kind": kind, "text": line.text, "margin": line.margin, "unit": line.unit, "count": part.count,
        "bounds": [line.low, line.high], "spans": _places(node), "parts": [],
    }  # fmt: skip


def _places(node: object) -> list[list[int]]:
    """Where in the text itself an atom stands: its use first, then outwards."""
    places = own_spans(node.spans) if isinstance(node, Atom) and node.spans else []
    return [[one.start, one.end] for one in places]


def own_spans(found: Sequence[Span]) -> list[Span]:
    """Those places that lie in the text itself: the outermost use always does, unless the label was imported."""
    main = found[-1].source
    return [one for one in found if one.source is main]
