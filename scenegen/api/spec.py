"""Specs: load one, look at it, compile it."""

from __future__ import annotations

import dataclasses
import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, RequestError, Source, Span, SpecError
from scenegen.errors.declarations import NUMBERS_NOT_HERE, WRONG_COUNT
from scenegen.errors.language import PHI_TOO_LARGE
from scenegen.errors.requests import (
    ARGUMENT_SYNTAX,
    CHOICES_NOT_HERE,
    NEEDED_HERE,
    NOT_OVER_TIME,
    TIME_NOT_HERE,
    WRONG_VALUE,
)
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_file, check_text
from scenegen.lang.formula.timed import Horizon, Movers, Timed
from scenegen.lang.spec import CheckedSpec, combinations
from scenegen.scenes.files import is_stream, read_bytes, read_stream
from scenegen.validation import as_int, as_path

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from scenegen.api.scenes import SceneSet
    from scenegen.learn.robustness import Robustness
    from scenegen.learn.robustness.traces import TraceRobustness
    from scenegen.sampling.proposer import Proposer
    from scenegen.sampling.request import Range, SampleRequest

MAX_SPEC_BYTES = 64_000_000


class Spec:
    """A checked spec.

    >>> spec = scenegen.parse("leftOf(mug, plate)")
    >>> spec.objects, spec.labels
    (('mug', 'plate'), ('task',))
    """

    def __init__(self, definition: CheckedSpec) -> None:
        self.definition = definition  # over time or not, with numbers of things or without: read no `core` from it
        if definition.timed is None:
            self._refuse_overflow()

    def __repr__(self) -> str:
        return f"<Spec {self.definition.name}: {len(self.objects)} objects, labels {', '.join(self.labels)}>"

    @property
    def checked(self) -> CheckedSpec:
        """What the spec means for single scenes, all of the same things. Raises RequestError for a spec over time, and
        for one that draws how many things there are."""
        if self.counts:
            first = self.definition.counts[0]
            asset = first.assets[0] if first.assets else None
            facts = {"file": self.definition.name, "name": first.name, "most": first.most, "asset": asset}
            raise RequestError(NUMBERS_NOT_HERE(**facts))
        return self.require_scenes()

    def require_scenes(self) -> CheckedSpec:
        """The definition of a spec that may draw how many things there are: read no `core` from it, but from its
        members. Raises RequestError for a spec over time."""
        if self.definition.timed is not None:
            raise RequestError(TIME_NOT_HERE(file=self.definition.name))
        return self.definition

    @property
    def counts(self) -> dict[str, tuple[int, int]]:
        """The arrays whose number of elements is drawn, and the least and the most there can be."""
        return {one.name: (one.least, one.most) for one in self.definition.counts}

    @property
    def assets(self) -> dict[str, tuple[str, ...]]:
        """The objects of categories, and the assets of which each scene draws one."""
        return {one.name: one.assets for one in self.definition.counts if one.assets}

    def with_counts(self, counts: Mapping[str, int | str]) -> Spec:
        """The spec with these numbers of things, by name; it draws the others. With all of them it is an ordinary spec.
        Of an object of a category the asset is given by its name, or by its number in `Spec.assets`, from 1.

        >>> spec = scenegen.parse("object block[3..8], mug task: forall b in block: leftOf(b, mug)")
        >>> spec.counts, spec.with_counts({"block": 3}).objects
        ({'block': (3, 8)}, ('block[1]', 'block[2]', 'block[3]', 'mug'))

        Raises RequestError for a name whose number is not drawn, and for a number that cannot be.
        """
        if not isinstance(counts, Mapping):
            raise RequestError(
                WRONG_VALUE(argument="counts", value=repr(counts), wanted='numbers by name: {"block": 5}')
            )
        numbers: dict[str, int] = {}
        for name, given in counts.items():
            if name not in self.counts:
                each = tuple(one for one in self.counts if one.startswith(f"{name}["))
                raise RequestError(WRONG_COUNT(name=name, each=each, known=tuple(self.counts)))
            drawn = next(one for one in self.definition.counts if one.name == name)
            number = _number_of(name, given, drawn.assets)
            if number not in drawn.numbers:
                raise RequestError(WRONG_COUNT(name=name, number=number, words=drawn.words))
            numbers[name] = number
        if not counts:
            return self
        made = check_text(self.source, self.definition.name, numbers)
        return Spec(dataclasses.replace(made, title=self.definition.title))

    @property
    def members(self) -> Iterator[tuple[dict[str, int], Spec]]:
        """An ordinary spec for each combination of numbers of things, with the numbers: itself where it draws none."""
        if not self.counts:
            yield {}, self
            return
        for numbers, member in zip(combinations(self.definition.counts), self.definition.members, strict=True):
            yield numbers, Spec(member)

    @property
    def over_time(self) -> Timed | None:
        """What a spec over time means, in two layers; None for one of single scenes."""
        return self.definition.timed

    @property
    def horizon(self) -> Horizon | None:
        """How many steps a motion has, and how long one takes; None where the spec has no `time`."""
        return None if self.definition.timed is None else self.definition.timed.horizon

    @property
    def moves(self) -> Movers:
        """Whether one object moves in each step, or all."""
        return "one" if self.definition.timed is None else self.definition.timed.moves

    def _repr_html_(self) -> str:
        """For notebooks: the formula of every label as a tree."""
        if self.definition.timed is not None or self.counts:
            from html import escape

            return f"<pre>{escape(self.source)}</pre>"
        from scenegen.pictures.notebook import spec_page

        return spec_page(self.checked)

    def _refuse_overflow(self) -> None:
        """phi must be a number everywhere in the workspace. Raises SpecError where its bounds are not."""
        for label, bounds in self.bounds().items():
            if not all(map(math.isfinite, bounds)):
                raise SpecError(PHI_TOO_LARGE(file=self.definition.name, label=label))

    @property
    def objects(self) -> tuple[str, ...]:
        """The names of the N objects, in the order of every array of poses."""
        return self.definition.objects

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the L formulas, in the order of every array of phi."""
        return self.definition.labels

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """What the checker noticed and let pass: unused names, names that hide others."""
        return self.definition.warnings

    @property
    def workspace(self) -> Workspace:
        return self.definition.workspace

    @property
    def source(self) -> str:
        """The canonical text."""
        return self.definition.source

    def scenes(self, poses: object, *, on: object = None) -> SceneSet:
        """Scenes from elsewhere, with phi: to be shown, rendered, settled, exported and saved as sampled ones are.

        `poses` is an array (n, N, 3), or (N, 3) for one scene, of numpy, torch or lists, in the order of `objects`; or
        by name, {"mug": (x, y, theta) or an array (n, 3), ...}; or a table (dict, pandas, polars) with the columns
        mug.x, mug.y, mug.theta, ...; or a list of scenes by name. Metres and radians. Objects that the spec holds in
        place can be left out, and things that are not there are NaN. `on` (n, M) says for each object that stands on
        one of several surfaces on which, as `SceneSet.on` does; tables have columns mug.on.

        >>> spec = scenegen.parse("leftOf(mug, plate)")
        >>> spec.scenes({"mug": (0.2, 0.5, 0), "plate": (0.6, 0.5, 0)}).phi["task"].round(3).tolist()
        [0.4]

        Raises RequestError for what says no poses, and DataError for scenes that are not of this spec, such as those
        with an object elsewhere than the spec holds it.
        """
        from scenegen.api.reading import own_scenes

        return own_scenes(self.require_scenes(), poses, on)

    def robustness(self) -> Robustness:
        """phi as a differentiable torch function: (B, N, 3) poses -> (B, L). Raises ValueError for NaN and infinity,
        and where an object that the spec holds stands elsewhere: phi takes its place for granted.

        See Robustness. Raises RequestError where torch is not installed.
        """
        refuse_choices(self, "`robustness()`")
        from scenegen.needs import need

        need("torch", "for `robustness()`")
        from scenegen.learn.robustness import Robustness

        return Robustness(self.checked.core, held=self.checked.fixed)

    def trace_robustness(self) -> TraceRobustness:
        """phi over motions as a differentiable torch function: (B, T + 1, N, 3) poses -> (B, L), for a spec with
        `time`. See TraceRobustness. Raises RequestError for a spec without, and where torch is not installed."""
        if self.definition.timed is None:
            raise RequestError(NOT_OVER_TIME(file=self.definition.name))
        from scenegen.needs import need

        need("torch", "for `trace_robustness()`")
        from scenegen.learn.robustness.traces import TraceRobustness

        return TraceRobustness(self.definition.timed, held=self.definition.fixed)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """What phi of each label can be at least and at most, anywhere in the workspace (interval bounds: never too
        narrow)."""
        from scenegen.search import spec_bounds

        if self.definition.timed is not None:
            from scenegen.sampling.motions.bounds import phi_bounds
            from scenegen.search.effort import Effort

            return phi_bounds(self.definition.timed, *self.definition.box(), Effort())

        each = [spec_bounds(one) for one in self.definition.members or (self.definition,)]
        return {
            label: (min(one[label][0] for one in each), max(one[label][1] for one in each)) for label in self.labels
        }

    def infeasible(self) -> list[Diagnostic]:
        """A warning for each label that no scene seems to satisfy, and for a requirement that no scene meets.

        Each names the smallest set of conjuncts that clash, and says whether bounds prove it or a short search failed.
        """
        from scenegen.api.feasibility import infeasible

        return infeasible(self.require_scenes())


def refuse_choices(spec: Spec, what: str) -> None:
    """Raises RequestError for a spec in which an object stands on one of several surfaces: `what` has no place for the
    surface chosen."""
    for which in spec.definition.choices:
        raise RequestError(CHOICES_NOT_HERE(what=what, name=spec.objects[which]))


LOAD_FIRST = "load it first: scenegen.load(FILE) reads a spec, scenegen.load_model(FILE) a model, which has a `spec`"


def check_spec(spec: object, what: str = "a Spec") -> None:
    """Raises RequestError for what is no Spec: most often the path of one."""
    if not isinstance(spec, Spec):
        raise RequestError(NEEDED_HERE(what=what, value=repr(spec), remedy=LOAD_FIRST))


def parse(text: str, name: str = "<spec>") -> Spec:
    """Check a spec's text. Raises SpecError; `name` is what its diagnostics call the text."""
    if not isinstance(text, str):
        raise RequestError(
            NEEDED_HERE(
                what="the text of a spec",
                value=repr(text),
                remedy="write the spec itself; scenegen.load(FILE) reads a file",
            )
        )
    return Spec(check_text(text, name))


def _number_of(name: str, given: int | str, assets: tuple[str, ...]) -> int:
    """A number of things, or that of an asset, which has the name or the number that was given. Raises RequestError."""
    if given in assets:
        return assets.index(str(given)) + 1
    if not isinstance(given, str):
        return as_int("counts", given)
    if re.fullmatch("[0-9]{1,9}", given, re.ASCII):
        return int(given)
    if assets:
        raise RequestError(WRONG_COUNT(object=name, name=given, known=assets))
    text = f"{name}={given}"
    here = Span(Source("count", text, argument=True), 0, len(text))
    raise RequestError(ARGUMENT_SYNTAX(here, what="a number of things", form="NAME=NUMBER", example="block=5"))


def load(path: str | Path, root: str | Path | None = None) -> Spec:
    """Read and check a spec file. Raises SpecError, and DataError where the file cannot be read.

    What it imports must lie in its own folder, or in the folder `root`. "-" and "/dev/stdin" are standard input,
    "/dev/fd/N" is a pipe that is open already; what these import lies in the current folder.
    """
    folder = None if root is None else as_path("root", root)
    return Spec(check_file(*read_spec(path), folder))


def read_spec(path: str | Path) -> tuple[Path, bytes]:
    """What a spec's file is called in messages, and its bytes. Raises DataError."""
    path = as_path("path", path)
    if is_stream(path):
        return Path("<stdin>"), read_stream(path, "a spec", limit=MAX_SPEC_BYTES)
    return path, read_bytes(path, "a spec", limit=MAX_SPEC_BYTES)


class LearnedModel(ABC):
    """What draws scenes in place of a spec: all that sampling knows of trained models (scenegen.learn.model)."""

    spec: Spec

    @abstractmethod
    def proposer_of(self, checked: CheckedSpec, ranges: Mapping[str, Range]) -> Proposer:
        """What proposes scenes of a spec with these numbers of things, asked for ranges of phi."""

    @abstractmethod
    def advice(self, request: SampleRequest, rows: npt.NDArray[np.float64] | None) -> tuple[Diagnostic, ...]:
        """Warnings about scenes (3N, n) that it made for a request; None where they are no longer in memory."""


def spec_of(source: Spec | LearnedModel) -> Spec:
    """The spec that scenes are drawn of. Raises RequestError for what is neither a spec nor a model."""
    if isinstance(source, LearnedModel):
        return source.spec
    check_spec(source, "a Spec or a Model")
    return source


def model_of(source: Spec | LearnedModel) -> LearnedModel | None:
    """What proposes the scenes, if a model does."""
    return source if isinstance(source, LearnedModel) else None
