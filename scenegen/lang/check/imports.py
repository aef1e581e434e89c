"""`import "table.spec"`: the statements of other files, put in place of the statement that names them.

A file may only reach what lies in its project's folder: the folder of the first file, unless the caller names another.
Links are followed before that is judged; devices, pipes and folders are not read; a circle of imports is refused. What
two files import both is taken once.
"""

from __future__ import annotations

import contextlib
import dataclasses
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.declarations import (
    CANNOT_READ_IMPORT,
    IMPORT_CYCLE,
    NOTHING_TO_IMPORT,
    OUTSIDE_FOLDER,
    SPEC_WITHOUT_FILE,
)
from scenegen.errors.language import SPEC_TOO_LONG, TIME_IN_IMPORT
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import MAX_CHARACTERS, parse, read_source
from scenegen.lang.syntax.tokens import has_time
from scenegen.resources import note_input
from scenegen.things.library import Shape

MAX_IMPORTED_BYTES = 64_000_000
MAX_IMPORTED_FILES = 1000


@dataclass(frozen=True, slots=True)
class SourcedStatement:
    """A statement and the source that it stands in."""

    source: Source
    statement: ast.Statement


@dataclass(slots=True)
class Project:
    """Where a spec may read from: `file` is the spec itself, None where it is a text without a file, and `root` the
    folder that nothing it names may lie outside of."""

    file: Path | None = None
    root: Path | None = None
    sources: dict[str, Path] = field(default_factory=dict)
    shapes: dict[tuple[Path, str], Shape] = field(default_factory=dict)  # of assets, by their index and name

    def find(self, path: str, here: Span) -> Path:
        """The file that `path`, written in the source of `here`, names. Raises SpecError where it must not be read."""
        base = self.sources.get(here.source.name, self.file)
        if base is None:
            raise SpecError(SPEC_WITHOUT_FILE(here))
        try:
            root = self._root(base.resolve().parent)
            wanted = (base.resolve().parent / path.replace("\\", "/")).resolve()  # as folders are separated elsewhere
        except (OSError, RuntimeError, ValueError):
            raise SpecError(CANNOT_READ_IMPORT(here, path=path)) from None
        with contextlib.suppress(OSError):  # a name that no file can have
            if wanted.is_symlink():  # links in a circle, which `resolve` leaves as they are from Python 3.13 on
                raise SpecError(CANNOT_READ_IMPORT(here, path=path))
        if not wanted.is_relative_to(root):
            raise SpecError(OUTSIDE_FOLDER(here, path=wanted, folder=root))
        return wanted

    def read(self, path: str, here: Span, what: str) -> bytes:
        """The bytes of that file. Raises SpecError."""
        wanted = self.find(path, here)
        try:
            info = wanted.stat()
            if not stat.S_ISREG(info.st_mode):
                raise SpecError(CANNOT_READ_IMPORT(here, path=path, what=what))
            note_input(wanted)
            with wanted.open("rb") as file:
                data = file.read(MAX_IMPORTED_BYTES + 1)  # what the system calls its size may be a lie, as in /proc
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise SpecError(CANNOT_READ_IMPORT(here, path=path, reason=reason, beside=_files_beside(wanted))) from None
        if len(data) > MAX_IMPORTED_BYTES:
            raise SpecError(SPEC_TOO_LONG(here, path=path, limit=MAX_IMPORTED_BYTES))
        return data

    def read_beside(self, path: str, other: str, here: Span) -> bytes:
        """The bytes of a file that the file `path` names, relative to it: the mesh of a URDF, a glTF's texture. Raises
        SpecError."""
        from scenegen.things.meshfile import local_name  # the folder's other files need numpy

        folder = self.find(path, here).parent
        return self.read(str(Path(path).parent / local_name(other, folder, self._root(folder))), here, "a mesh")

    def _root(self, folder: Path) -> Path:
        """The folder that nothing may lie outside of. A spec that is a link imports from the folder of the file that it
        points to."""
        return self.root.resolve() if self.root is not None else self.file.resolve().parent if self.file else folder


def _files_beside(wanted: Path) -> list[str]:
    """A few files of the folder that a file was looked for in: those of its ending, if there are any."""
    with contextlib.suppress(OSError):  # the folder may be missing as well, or closed to us
        files = sorted(one for one in wanted.parent.iterdir() if one.suffix)
        return [one.name for one in [one for one in files if one.suffix == wanted.suffix] or files][:5]
    return []


def inline(module: ast.Module, project: Project) -> tuple[list[SourcedStatement], list[Diagnostic]]:
    """All statements in order, imports replaced by what they import, and what was wrong with the imports."""
    problems: list[Diagnostic] = []
    out: list[SourcedStatement] = []
    seen: set[Path] = set()
    characters = len(module.source.text)
    timed = any(isinstance(statement, ast.Time) for statement in module.statements)
    first = project.file.resolve() if project.file is not None else None
    open_files: list[Path | None] = [first]
    walks: list[tuple[Source, Iterator[ast.Statement]]] = [(module.source, iter(module.statements))]
    while walks:
        source, statements = walks[-1]
        statement = next(statements, None)
        if statement is None:
            walks.pop()
            open_files.pop()
            continue
        if not isinstance(statement, ast.Import):
            out.append(SourcedStatement(source, statement))
            continue
        here = statement.path.span(source)
        try:
            path = project.find(statement.path.value, here)
            if path in open_files:
                raise SpecError(IMPORT_CYCLE(here, path=statement.path.value))
            if path in seen:
                continue
            if len(seen) >= MAX_IMPORTED_FILES:
                problems.append(SPEC_TOO_LONG(here, limit=MAX_IMPORTED_FILES, files=True))
                break
            imported = _parse_import(statement.path.value, path, here, project, timed)
        except SpecError as error:
            problems.extend(error.diagnostics)
            continue
        characters += len(imported.source.text)
        if characters > MAX_CHARACTERS:
            problems.append(SPEC_TOO_LONG(here, limit=MAX_CHARACTERS))
            break
        seen.add(path)
        open_files.append(path)
        walks.append((imported.source, iter(imported.statements)))
    return out, problems


def _parse_import(written: str, path: Path, here: Span, project: Project, timed: bool) -> ast.Module:
    data = project.read(written, here, "a .spec file")
    shown = _source_name(path, project)
    project.sources[shown] = path
    try:
        source = read_source(shown, data)
        if not timed and has_time(source.text):
            raise SpecError(TIME_IN_IMPORT(here, path=written))
        module = parse(source, timed)
    except SpecError as error:  # what is wrong with all of a file has no place in it
        found = (one if one.span is not None else dataclasses.replace(one, span=here) for one in error.diagnostics)
        raise SpecError(*found) from None
    if module.bare is not None:
        raise SpecError(NOTHING_TO_IMPORT(here, path=written))
    return module


def _source_name(path: Path, project: Project) -> str:
    """What diagnostics call an imported file: beside the importing spec's own path where it lies below it."""
    if project.file is not None:
        folder = project.file.resolve().parent
        if path.is_relative_to(folder):
            return str(project.file.parent / path.relative_to(folder))
    return str(path)
