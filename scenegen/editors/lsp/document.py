"""One version of an open file: its names, its tree, its meaning; each is computed when first needed, and cached."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

from scenegen.editors.lsp import names
from scenegen.editors.lsp.names import Binding, NameIndex, Occurrence, index
from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.lang.check.imports import MAX_IMPORTED_FILES, Project
from scenegen.lang.check.lowering import Lowering
from scenegen.lang.check.scope import BUILT_IN
from scenegen.lang.checker import check_module
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse_tolerant, plain_breaks, read_source
from scenegen.resources import grammar_file

SALVAGES = 4  # how often faulty statements are left out before giving up


@dataclass(slots=True)
class EditedProject(Project):
    """A project with files that are open in the editor: the editor's texts are used, not those on the disk."""

    open_texts: Mapping[Path, str] = field(default_factory=dict)

    def read(self, path: str, here: Span, what: str) -> bytes:
        wanted = self.find(path, here)
        text = self.open_texts.get(wanted)
        return text.encode() if text is not None else Project.read(self, path, here, what)


@cache
def prelude_index() -> NameIndex:
    """The names of the prelude."""
    path = grammar_file("prelude.spec")
    return index(Source("prelude.spec", path.read_text(encoding="utf-8")), path)


class Document:
    """A spec's text in the editor. `path` is its file, None if it has none yet; `open_texts` are the texts of all open
    files by their resolved path; nothing outside `root` is read (default: the file's folder)."""

    def __init__(
        self,
        text: str,
        path: Path | None = None,
        name: str = "<spec>",
        open_texts: Mapping[Path, str] | None = None,
        root: Path | None = None,
    ) -> None:
        self.path = path
        self.source = Source(str(path) if path is not None else name, plain_breaks(text))
        self.open_texts = dict(open_texts or {})
        self._root = root
        self.lowering: Lowering | None = None  # what hovers have expanded so far: see hover.py

    @property
    def text(self) -> str:
        return self.source.text

    def project(self) -> EditedProject:
        """Where the spec may read from, with nothing read yet."""
        return EditedProject(self.path, self._root, open_texts=self.open_texts)

    @cached_property
    def index(self) -> NameIndex:
        return index(self.source, self.path)

    @cached_property
    def imported_files(self) -> list[NameIndex]:
        """The files that this one imports, directly or indirectly; unreadable ones are left out."""
        project = self.project()
        found: dict[Path, NameIndex] = {}
        waiting = [self.index]
        while waiting and len(found) < MAX_IMPORTED_FILES:
            one = waiting.pop(0)
            for link in one.imports:
                here = Span(one.source, link.start, link.end)
                try:
                    path = project.find(link.name, here)
                    if path in found or (self.path is not None and path == self.path.resolve()):
                        continue
                    source = read_source(str(path), project.read(link.name, here, "a .spec file"))
                except SpecError:
                    continue
                project.sources[source.name] = path
                found[path] = index(source, path)
                waiting.append(found[path])
        return list(found.values())

    @cached_property
    def values(self) -> dict[str, Binding]:
        """Names with a meaning of their own anywhere in the spec: objects, regions, constants, labels."""
        return {one.name: one for one in self._declarations() if one.kind != "definition"} | self._inferred_objects

    @cached_property
    def functions(self) -> dict[str, Binding]:
        """The definitions, those of the prelude included."""
        return {one.name: one for one in self._declarations() if one.kind == "definition"}

    def _declarations(self) -> Iterator[Binding]:
        """All declarations; of two with one name the first counts, and any takes precedence over the prelude's."""
        own = [one for file in (self.index, *self.imported_files) for one in file.declarations]
        yield from prelude_index().declarations
        yield from reversed(own)

    @cached_property
    def _inferred_objects(self) -> dict[str, Binding]:
        """Without an `object` statement, undefined names in formulas are objects."""
        files = (self.index, *self.imported_files)
        if any(statement.kind == "object" for file in files for statement in file.statements):
            return {}
        known = {*BUILT_IN, *(one.name for one in self._declarations() if one.kind != "definition")}
        found: dict[str, Binding] = {}
        for file in files:
            for statement in file.statements:
                if statement.kind not in ("def", "label", "require", "formula"):
                    continue
                for one in file.names_between(statement.start, statement.end):
                    if one.role == "value" and one.local is None and one.name not in known:
                        place = (one.start, one.end, one.start, one.end)
                        binding = Binding("object", one.name, file.source, file.path, *place, inferred=True)
                        found.setdefault(one.name, binding)
        return found

    @cached_property
    def notes(self) -> dict[Binding, tuple[str, str]]:
        """For every declaration what completion shows beside it: its usage or value, and its purpose."""
        return {one: names.notes(one) for one in (*self.values.values(), *self.functions.values())}

    def meaning(self, occurrence: Occurrence) -> Binding | None:
        """The declaration of a name; None for built-in names, members and assets, and undeclared names."""
        match occurrence.role:
            case "declaration":
                return occurrence.local
            case "value":
                return occurrence.local or self.values.get(occurrence.name)
            case "call":
                return self.functions.get(occurrence.name)
            case "argument":
                return self._parameter(occurrence)
            case _:
                return None

    def _parameter(self, argument: Occurrence) -> Binding | None:
        definition = self.functions.get(argument.of)
        if definition is None:
            return None
        return next((one for one in self.parameters(definition) if one.name == argument.name), None)

    def parameters(self, definition: Binding) -> list[Binding]:
        """The parameters of a definition, in order."""
        for file in (self.index, *self.imported_files, prelude_index()):
            if file.source is definition.source:
                inside = (one.local for one in file.names_between(definition.opens, definition.closes))
                return [one for one in inside if one is not None and one.kind == "parameter" and one.owner]
        return []

    def occurrence(self, offset: int) -> Occurrence | None:
        """The name at an offset, or the one that ends there."""
        at = [*self.index.names_between(offset - 1, offset + 1), *self.index.imports]
        touching = [one for one in at if one.start <= offset <= one.end]
        return touching[-1] if touching else None

    @cached_property
    def parse_result(self) -> tuple[ast.Module | None, list[Diagnostic]]:
        """The statements that parse, and the errors of the rest."""
        return parse_tolerant(self.source)

    @cached_property
    def check_result(self) -> CheckedSpec | tuple[Diagnostic, ...]:
        """The checked spec, or all errors."""
        module, problems = self.parse_result
        if problems or module is None:
            return tuple(problems)
        try:
            return check_module(module, self.project())
        except SpecError as error:
            return error.diagnostics

    @cached_property
    def salvage(self) -> tuple[ast.Module, CheckedSpec] | None:
        """The largest part of the text that has a meaning, found by leaving out the statements that are wrong."""
        module = self.parse_result[0]
        if module is None:
            return None
        if isinstance(self.check_result, CheckedSpec):
            return module, self.check_result
        problems: tuple[Diagnostic, ...] = () if self.parse_result[1] else self.check_result
        for _ in range(SALVAGES):
            wrong = [one.span.start for one in problems if one.span is not None and one.span.source is self.source]
            kept = tuple(one for one in module.statements if not any(one.start <= at < one.end for at in wrong))
            if problems and len(kept) == len(module.statements):
                return None
            module = ast.Module(module.source, kept, module.bare)
            try:
                return module, check_module(module, self.project())
            except SpecError as error:
                problems = error.diagnostics
        return None
