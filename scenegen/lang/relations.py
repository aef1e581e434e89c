"""The definitions of the prelude with what its comments say of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from scenegen.lang.check.scope import prelude, signature_of
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.pieces import print_expr


@dataclass(frozen=True)
class RelationEntry:
    """A definition with the comment above it, which is its meaning."""

    definition: ast.Definition
    meaning: str

    @property
    def name(self) -> str:
        return self.definition.name.id

    @property
    def usage(self) -> str:
        """How it is called: `closeTo(a, b, e = EPS_CLOSE)`."""
        return signature_of(self.definition).usage


@dataclass(frozen=True)
class RelationGroup:
    """The definitions under one heading of the prelude."""

    title: str
    entries: list[RelationEntry]


def groups() -> Iterator[RelationGroup]:
    """The definitions under the headings `# ---- title` of the prelude, in its order."""
    module = prelude()
    definitions = {one.start: one for one in module.statements if isinstance(one, ast.Definition)}
    title, entries, comment, place = "", list[RelationEntry](), list[str](), 0
    for line in module.source.text.splitlines(keepends=True):
        if line.startswith("# ---- "):
            if entries:
                yield RelationGroup(title, entries)
            title, entries, comment = line.removeprefix("# ---- ").strip(), [], []
        elif line.startswith("#"):
            comment.append(line.removeprefix("#").strip())
        elif place in definitions:
            entries.append(RelationEntry(definitions[place], " ".join(comment)))
        elif not line.strip():
            comment = []
        place += len(line)
    yield RelationGroup(title, entries)


def defaults(definition: ast.Definition) -> dict[str, str]:
    """The constants of the prelude that stand for parameters left out, with their values."""
    values = {one.name.id: print_expr(one.value) for one in prelude().statements if isinstance(one, ast.Constant)}
    used = dict.fromkeys(print_expr(one.default) for one in definition.parameters if one.default is not None)
    return {name: values[name] for name in used if name in values}
