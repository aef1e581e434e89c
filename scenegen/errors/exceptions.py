"""Exceptions for problems that the user can fix."""

from __future__ import annotations

from scenegen.errors.diagnostic import Diagnostic
from scenegen.errors.render import render_all


class ScenegenError(Exception):
    """A problem that the user can mend. Carries at least one diagnostic; `str()` is their rendering."""

    def __init__(self, *diagnostics: Diagnostic) -> None:
        if not diagnostics:
            raise ValueError("a ScenegenError needs a diagnostic")
        super().__init__(*diagnostics)
        self.diagnostics = diagnostics

    def __str__(self) -> str:
        return render_all(self.diagnostics)


class SpecError(ScenegenError, ValueError):
    """The spec's text is wrong."""


class RequestError(ScenegenError, ValueError):
    """The request is wrong: a range, a count, a label, an option's value."""


class DataError(ScenegenError, ValueError):
    """A scenes file, a model file or an array of poses is wrong."""


class OutputError(ScenegenError, OSError):
    """Something could not be written."""
