"""`import "table.spec"`: the statements of other files, put in place of the statement that names them.

A file may only reach what lies in its project's folder: the folder of the first file, unless the caller names another.
Links are followed before that is judged; devices, pipes and folders are not read; a circle of imports is refused. What
two files import both is taken once.
"""

from __future__ import annotations

import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.lang import ast
from scenegen.lang.parse import parse, read_source

MAX_BYTES = 64_000_000
MAX_FILES = 1000


@dataclass(frozen=True, slots=True)
class Placed:
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

    def find(self, path: str, here: Span) -> Path:
        """The file that `path`, written in the source of `here`, names. Raises SpecError where it must not be read."""
        base = self.sources.get(here.source.name, self.file)
        if base is None:
            raise SpecError(
                Diagnostic("a spec without a file cannot read files", here, "", "save it as a .spec file and load that")
            )
        root = (self.root or (self.file or base).parent).resolve()
        try:
            wanted = (base.resolve().parent / path).resolve()
        except (OSError, RuntimeError, ValueError):
            raise SpecError(Diagnostic(f"cannot find {path}", here)) from None
        if not wanted.is_relative_to(root):
            help_ = f"copy it there, or name a wider folder with --root; the folder is {root}"
            raise SpecError(Diagnostic("a spec cannot read outside its folder", here, f"this is {wanted}", help_))
        return wanted

    def read(self, path: str, here: Span, what: str) -> bytes:
        """The bytes of that file. Raises SpecError."""
        wanted = self.find(path, here)
        try:
            info = wanted.stat()
            if not stat.S_ISREG(info.st_mode):
                raise SpecError(Diagnostic(f"{path} is not a file", here, "", f"name {what}"))
            if info.st_size > MAX_BYTES:
                raise SpecError(Diagnostic(f"{path} is too large: {info.st_size:,} bytes", here))
            return wanted.read_bytes()
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            near = sorted(one.name for one in wanted.parent.glob("*.*"))[:5] if wanted.parent.is_dir() else []
            found = f"beside it are {', '.join(near)}" if near else "the path is relative to this file"
            raise SpecError(Diagnostic(f"cannot read {path}: {reason}", here, "", found)) from None

    def read_beside(self, path: str, other: str, here: Span) -> bytes:
        """The bytes of a file that the file `path` names, relative to it: the mesh of a URDF. Raises SpecError."""
        plain = other.removeprefix("file://")
        if plain.startswith("package://"):  # package://name/meshes/a.stl: packages lie beside the file
            plain = plain.removeprefix("package://").partition("/")[2]
        return self.read(str(Path(path).parent / plain), here, "a mesh")


def inline(module: ast.Module, project: Project) -> tuple[list[Placed], list[Diagnostic]]:
    """All statements in order, imports replaced by what they import, and what was wrong with the imports."""
    problems: list[Diagnostic] = []
    out: list[Placed] = []
    seen: set[Path] = set()
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
            out.append(Placed(source, statement))
            continue
        here = statement.path.span(source)
        try:
            path = project.find(statement.path.value, here)
            if path in open_files:
                raise SpecError(
                    Diagnostic(f"{statement.path.value} imports itself", here, "this closes a circle of imports")
                )
            if path in seen:
                continue
            if len(seen) >= MAX_FILES:
                raise SpecError(Diagnostic(f"more than {MAX_FILES} files are imported", here))
            imported = _imported(statement.path.value, path, here, project)
        except SpecError as error:
            problems.extend(error.diagnostics)
            continue
        seen.add(path)
        open_files.append(path)
        walks.append((imported.source, iter(imported.statements)))
    return out, problems


def _imported(written: str, path: Path, here: Span, project: Project) -> ast.Module:
    data = project.read(written, here, "a .spec file")
    shown = _shown(path, project)
    project.sources[shown] = path
    module = parse(read_source(shown, data))
    if module.bare is not None:
        help_ = "give its formula a name there: task: ..."
        raise SpecError(Diagnostic(f"{written} has no statements to import", here, "it is one unnamed formula", help_))
    return module


def _shown(path: Path, project: Project) -> str:
    """What diagnostics call an imported file: beside the importing spec's own path where it lies below it."""
    if project.file is not None:
        folder = project.file.resolve().parent
        if path.is_relative_to(folder):
            return str(project.file.parent / path.relative_to(folder))
    return str(path)
