"""The stages of checking: each runs to its end and then refuses with all that it found wrong."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.errors import Diagnostic, Source, SpecError
from scenegen.lang.parse import MOST_ERRORS


def refusal(problems: Sequence[Diagnostic], main: Source) -> SpecError:
    """All problems once, those of the spec itself first, each file's in the order of its text."""

    def place(problem: Diagnostic) -> tuple[bool, str, int]:
        span = problem.span
        return (False, "", 0) if span is None else (span.source is not main, span.source.name, span.start)

    return SpecError(*sorted(dict.fromkeys(problems), key=place)[:MOST_ERRORS])


class Stage:
    """Runs the steps of a stage and keeps what each found wrong, so that one mistake does not hide another."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.problems: list[Diagnostic] = []

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, SpecError):
            self.problems.extend(error.diagnostics)
            return True
        return False

    @property
    def full(self) -> bool:
        """Whether nobody would read any more."""
        return len(self.problems) >= MOST_ERRORS

    def close(self) -> None:
        """Raises SpecError where anything was wrong."""
        if self.problems:
            raise refusal(self.problems, self.source)
