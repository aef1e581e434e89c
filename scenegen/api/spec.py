"""Specs: load one, look at it, compile it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen import given
from scenegen.errors import Diagnostic, RequestError, SpecError
from scenegen.formats.files import read_bytes
from scenegen.lang.check import check_file, check_text
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.scene.workspace import Workspace

if TYPE_CHECKING:
    from scenegen.robustness import Robustness

MAX_BYTES = 64_000_000


class Spec:
    """A checked spec.

    >>> spec = scenegen.parse("leftOf(mug, plate)")
    >>> spec.objects, spec.labels
    (('mug', 'plate'), ('task',))
    """

    def __init__(self, checked: CheckedSpec) -> None:
        self.checked = checked
        self._refuse_overflow()

    def __repr__(self) -> str:
        return f"<Spec {self.checked.name}: {len(self.objects)} objects, labels {', '.join(self.labels)}>"

    def _repr_html_(self) -> str:
        """For notebooks: the formula of every label as a tree."""
        from scenegen.api.notebook import spec_page

        return spec_page(self)

    def _refuse_overflow(self) -> None:
        """phi must be a number everywhere in the workspace. Raises SpecError where its bounds are not."""
        for label, bounds in self.bounds().items():
            if not all(map(math.isfinite, bounds)):
                title = f"phi of `{label}` can be larger than a computer's numbers"
                raise SpecError(
                    Diagnostic(f"{self.checked.name}: {title}", help="use smaller constants or fewer products")
                )

    @property
    def objects(self) -> tuple[str, ...]:
        """The names of the N objects, in the order of every array of poses."""
        return self.checked.objects

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the L formulas, in the order of every array of phi."""
        return self.checked.labels

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """What the checker noticed and let pass: unused names, names that hide others."""
        return self.checked.warnings

    @property
    def workspace(self) -> Workspace:
        return self.checked.workspace

    @property
    def source(self) -> str:
        """The canonical text."""
        return self.checked.source

    def robustness(self, *, compiled: bool = False) -> Robustness:
        """phi as a differentiable torch function: (B, N, 3) poses -> (B, L). Raises ValueError for NaN and infinity.

        `compiled` makes machine code of it (seconds, at the first call in each dtype): worth it for millions of scenes
        stored as (3N, B). See Robustness. Raises RequestError where torch is not installed.
        """
        need("torch", "for `robustness()`")
        from scenegen.robustness import Robustness

        return Robustness(self.checked.core, compiled=compiled)

    def bounds(self) -> dict[str, tuple[float, float]]:
        """What phi of each label can be at most, anywhere in the workspace (interval bounds: never too narrow)."""
        from scenegen.bounds import spec_bounds

        return spec_bounds(self.checked)

    def hopeless(self) -> list[Diagnostic]:
        """A warning for each label that no scene seems to satisfy, and for a requirement that no scene meets.

        Each names the smallest set of conjuncts that clash, and says whether bounds prove it or a short search failed.
        """
        from scenegen.api.hopeless import hopeless

        return hopeless(self.checked)


def check_spec(spec: object, what: str = "a Spec") -> None:
    """Raises RequestError for what is no Spec: most often the path of one."""
    if not isinstance(spec, Spec):
        help_ = "load it first: scenegen.load(FILE) reads a spec, scenegen.load_model(FILE) a model, which has a `spec`"
        raise RequestError(Diagnostic(f"{what} is wanted here, not {spec!r}", help=help_))


def parse(text: str, name: str = "<spec>") -> Spec:
    """Check a spec's text. Raises SpecError; `name` is what its diagnostics call the text."""
    if not isinstance(text, str):
        help_ = "write the spec itself; scenegen.load(FILE) reads a file"
        raise RequestError(Diagnostic(f"the text of a spec is wanted here, not {text!r}", help=help_))
    return Spec(check_text(text, name))


def load(path: str | Path, root: str | Path | None = None) -> Spec:
    """Read and check a spec file. Raises SpecError, and DataError where the file cannot be read.

    What it imports must lie in its own folder, or in the folder `root`.
    """
    path = given.path("path", path)
    folder = None if root is None else given.path("root", root)
    return Spec(check_file(path, read_bytes(path, "a spec", limit=MAX_BYTES), folder))
