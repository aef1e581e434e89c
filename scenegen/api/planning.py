"""Planning problems as specs."""

from __future__ import annotations

from pathlib import Path

from scenegen.pddl.compile import Imported, compile_problem
from scenegen.pddl.mapping import Map, read_map
from scenegen.pddl.problem import Domain, domain_of, problem_of
from scenegen.pddl.read import read

__all__ = ["Imported", "import_problem"]


def import_problem(problem: str | Path, domain: str | Path | None = None, table: str | Path | None = None) -> Imported:
    """The spec that a PDDL or BDDL problem is: its text, and what of the problem has no geometry.

    `domain` is the PDDL file of types, constants and predicates, `table` a TOML file that maps kinds of objects to
    shapes and predicates to relations (docs/pddl.md). Raises DataError for files that cannot be read, and for problems
    without places.
    """
    known = Domain() if domain is None else domain_of(*read(Path(domain), "a PDDL domain"))
    mapped = Map() if table is None else read_map(Path(table))
    return compile_problem(problem_of(*read(Path(problem), "a PDDL problem"), known), mapped)
