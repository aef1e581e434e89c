"""What must hold for every input whatsoever: accepted with a meaning that all readers share, or refused politely."""

from __future__ import annotations

import contextlib
import math
import random
import re
import resource
import signal
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.outline import Outline
from scenegen.api.spec import Spec
from scenegen.errors import Diagnostic, SpecError, render, to_json
from scenegen.errors.declarations import SPEC_TOO_LARGE
from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_file, check_text
from scenegen.lang.formula.core import Atom, Core, Junction, gate
from scenegen.lang.formula.interpret import evaluate
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax.parse import parse_tolerant, read_source
from scenegen.lang.syntax.printer import format_source
from scenegen.resources import grammar_file
from scenegen.search import node_bounds

from .generate import Case

SLOW = 6.0  # seconds of CPU for one check
AT_LIMITS = 20.0  # how much longer it may take to find out that a spec is too large
HANG = 120.0  # seconds of CPU after which a case is broken off
CHECK, SHOW = 25.0, 25.0  # seconds of CPU for a text that attacks by its size: five times what an idle machine needs
MEMORY = 1 << 30  # bytes that it may take,
PER_TEXT = 3_000  # and as many for each of its own
POSES = 3
LARGE = 20_000  # nodes of a core from which on time is allowed in proportion


class Fault(Exception):  # noqa: N818 - found in the program under test, not raised by it
    """A law that an input breaks."""


class Hang(BaseException):
    """An input that takes far too long."""


def grammar_names() -> frozenset[str]:
    """The names of terminals and rules: nobody who writes a spec knows them."""
    grammar = grammar_file("spec.lark").read_text(encoding="utf-8")
    terminals = re.findall(r"^(_?[A-Z]+)(?:\.\d+)?:", grammar, re.MULTILINE)
    return frozenset(
        {*terminals} - {"X"} | {"RPAR", "LPAR", "RSQB", "LSQB", "EQUAL", "COLON", "COMMA", "$END", "ladder"}
    )


@contextlib.contextmanager
def deadline(seconds: float) -> Iterator[None]:
    """Raises Hang inside after that much CPU time."""

    def stop(number: int, frame: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def judge(case: Case, folder: Path, rng: random.Random, names: frozenset[str]) -> bool:
    """Whether the case is accepted. Raises Fault, or whatever the program under test lets out."""
    path = folder / "main.spec"
    for name, data in case.beside.items():
        (folder / name).write_bytes(data)
    try:
        return _sized(case, path) if case.sized else _judge(case, path, rng, names)
    finally:
        for name in case.beside:
            (folder / name).unlink()


def _sized(case: Case, path: Path) -> bool:
    """Only what it takes: to check, and to show what was checked; memory is limited by the process."""
    spec: Spec | None = None
    with limited("check", CHECK, PER_TEXT * len(case.main)), contextlib.suppress(SpecError):
        spec = Spec(check_file(path, case.main))
    if spec is not None:
        with limited("the outline", SHOW):
            outline = Outline(spec.checked)
            for label in outline.labels[:20]:
                outline.lines(label)
        with limited("the search for clashes", SHOW):
            spec.infeasible()
    return spec is not None


@contextlib.contextmanager
def limited(what: str, seconds: float, memory: float = 0.0) -> Iterator[None]:
    """Raises Fault where what is done inside takes more CPU time, or grows the process by more than MEMORY bytes."""
    began, peak = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with deadline(HANG):
        try:
            yield
        except MemoryError:
            raise Fault(f"{what} takes more memory than there is") from None
    if time.process_time() - began > seconds:
        raise Fault(f"{what} takes longer than {seconds:g} s")
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak)
    if grown > MEMORY + memory:
        raise Fault(f"{what} takes more than {MEMORY >> 20} MB")


def _judge(case: Case, path: Path, rng: random.Random, names: frozenset[str]) -> bool:
    began = time.process_time()
    spec: CheckedSpec | None = None
    problems: Sequence[Diagnostic] = ()
    try:
        with deadline(HANG):
            spec = check_file(path, case.main)
            problems = spec.warnings
    except SpecError as refused:
        problems = refused.diagnostics
        if not problems:
            raise Fault("refused without a diagnostic") from None
    seconds = time.process_time() - began
    limited = any(one.kind == SPEC_TOO_LARGE for one in problems)
    if seconds > SLOW * (AT_LIMITS if limited else 1.0) * max(
        1.0, (0 if spec is None else len(spec.core.nodes)) / LARGE
    ):
        raise Fault("check takes longer than it may")
    own = case.main.decode("utf-8", "replace") + b"".join(case.beside.values()).decode("utf-8", "replace")
    for problem in problems:
        _diagnostic(problem, set(re.findall(r"\w+", own)), names)
    with deadline(2 * HANG):
        _format(case, path, spec)
        if spec is not None:
            accepted(spec, rng)
    return spec is not None


def _diagnostic(problem: Diagnostic, own: set[str], names: frozenset[str]) -> None:
    if not problem.title.strip():
        raise Fault("a diagnostic without a title")
    span = problem.span
    if span is not None and not 0 <= span.start <= span.end <= len(span.source.text):
        raise Fault("a place outside its source")
    shown = render(problem)
    if len(shown) > 8000:
        raise Fault("a message of more than 8,000 characters")
    if "Traceback" in shown or (re.search(r"<[\w.]+ object at 0x|\bNone\b|dataclass", shown) and "None" not in own):
        raise Fault("a message that shows the program's insides")
    render(problem, color=True)
    found = to_json(problem)
    if span is not None:
        start, end = found["range"]["start"], found["range"]["end"]
        if (start["line"], start["character"]) > (end["line"], end["character"]):
            raise Fault("a range that ends before it begins")
    said = set(re.findall(r"[$\w]+", f"{problem.title} {problem.label} {problem.help} {problem.note}"))
    leaked = (said & names) - own
    if leaked:
        raise Fault(f"a name of the grammar gets out: {sorted(leaked)}")


def _format(case: Case, path: Path, spec: CheckedSpec | None) -> None:
    """The formatter keeps the meaning and has nothing to add to its own output; what editors use never raises."""
    try:
        source = read_source(str(path), case.main)
    except SpecError:
        return
    module, problems = parse_tolerant(source)
    if module is None and not problems:
        raise Fault("nothing parsed, nothing said")
    try:
        once = format_source(source)
    except SpecError:
        if spec is not None:
            raise Fault("checked, but not formatted") from None
        return
    if format_source(read_source(str(path), once.encode())) != once:
        raise Fault("formatting is not idempotent")
    if spec is not None and check_file(path, once.encode()).source != spec.source:
        raise Fault("formatting changes the canonical text")


def accepted(spec: CheckedSpec, rng: random.Random) -> None:
    """The laws of an accepted spec. Raises Fault."""
    again = check_text(spec.source)
    if again.source != spec.source or again.sha256 != spec.sha256:
        raise Fault("the canonical text is no fixed point")
    if without_places(again.core) != without_places(spec.core):
        raise Fault("the canonical text means something else")
    if (again.workspace, again.shapes, again.fixed, again.regions) != (
        spec.workspace,
        spec.shapes,
        spec.fixed,
        spec.regions,
    ):
        raise Fault("the canonical text declares something else")
    try:
        outline = Outline(spec)
    except SpecError as overflow:
        if "larger than a computer" not in str(overflow):
            raise
        return
    for label in outline.labels:
        outline.lines(label)
    scored(spec, rng)


def without_places(core: Core) -> Core:
    """The core without the places in the text that it came from."""
    return replace(core, nodes=tuple(replace(n, spans=()) if isinstance(n, Atom) else n for n in core.nodes))


def scored(spec: CheckedSpec, rng: random.Random) -> None:
    """The scalar oracle, numpy and the interval bounds agree on a few scenes. Raises Fault."""
    core = gate(spec.core)
    ends = set(core.labels.values())
    lowest, highest = spec.box()
    with np.errstate(all="ignore"):
        bounds = node_bounds(core, lowest, highest)
    scenes = [[rng.uniform(lo, hi) for lo, hi in zip(lowest, highest, strict=True)] for _ in range(POSES)]
    with np.errstate(all="ignore"):
        batch = evaluate(core, list(np.array(scenes).T), NUMPY)
    for number, scene in enumerate(scenes):
        values = evaluate(core, scene)
        for index, value in enumerate(values):
            if math.isnan(value):
                raise Fault(f"not a number: {_kind(core, index)}")
            if index in ends and not math.isfinite(value):
                raise Fault(f"phi that is not finite: {_kind(core, index)}")
            if not bounds[index].lo <= value <= bounds[index].hi:
                raise Fault(f"a value outside its bounds: {_kind(core, index)}")
            array = np.broadcast_to(batch[index], (POSES,))
            if not math.isclose(
                float(array[number]), value, rel_tol=1e-9, abs_tol=1e-9 * (1 + _size(values, core, index))
            ):
                raise Fault(f"numpy and the oracle differ: {_kind(core, index)}")


def _kind(core: Core, index: int) -> str:
    node = core.nodes[index]
    return getattr(node, "primitive", type(node).__name__) if not isinstance(node, Junction) else node.kind


def _size(values: Sequence[float], core: Core, index: int) -> float:
    """How large the numbers are that a node is computed from."""
    return max((abs(values[arg]) for arg in getattr(core.nodes[index], "args", ())), default=0.0)
