"""The one loop over the tape: children first, every kind of node, values dropped when nobody needs them any more."""

from __future__ import annotations

import pytest

import scenegen
from scenegen.lang.formula.core import Apply, Atom, Const, Coord, Core, Junction, children, last_uses
from scenegen.lang.formula.interpret import Algebra, fold

TEXT = "near: closeTo(a, b) & dist(a, b) >= 0.01\napart: !closeTo(a, b) | leftOf(a, b)"


class _Text(Algebra[str]):
    """Nodes as text, with the place of each on the tape."""

    def __init__(self) -> None:
        self.seen: list[int] = []

    def constant(self, index: int, node: Const) -> str:
        self.seen.append(index)
        return f"{node.value:g}"

    def coordinate(self, index: int, node: Coord) -> str:
        self.seen.append(index)
        return f"r{node.row}"

    def apply(self, index: int, node: Apply, args: list[str]) -> str:
        self.seen.append(index)
        return f"{node.primitive}({' '.join(args)})"

    def atom(self, index: int, node: Atom, margin: str) -> str:
        self.seen.append(index)
        return f"[{margin}]"

    def junction(self, index: int, node: Junction, args: list[str]) -> str:
        self.seen.append(index)
        return f"{node.kind}({' '.join(args)})"


def _core() -> Core:
    return scenegen.parse(TEXT).checked.core


def test_every_node_gets_its_children() -> None:
    core, algebra = _core(), _Text()
    values = fold(core.nodes, algebra)
    assert algebra.seen == list(range(len(core.nodes)))
    for node, value in zip(core.nodes, values, strict=True):
        for child in children(node):
            assert values[child] in value
    assert values[core.labels["near"]].startswith("min([")
    assert values[core.labels["apart"]].startswith("max([")


def test_values_are_dropped_after_their_last_use() -> None:
    core = _core()
    dead, freed = last_uses(core), list[str]()
    whole, values = fold(core.nodes, _Text()), fold(core.nodes, _Text(), dead=dead, free=freed.append)
    assert freed == [whole[child] for children_ in dead for child in children_]
    assert [values[node] for node in core.labels.values()] == [whole[node] for node in core.labels.values()]
    assert all(value is None for node, value in enumerate(values) if node not in core.labels.values())


def test_a_check_breaks_off_before_a_node() -> None:
    core, algebra = _core(), _Text()
    left = iter(range(3))

    def check() -> None:
        if next(left, None) is None:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        fold(core.nodes, algebra, before=check)
    assert algebra.seen == [0, 1, 2]


def test_an_algebra_may_see_the_values_so_far() -> None:
    values: list[str] = []
    assert fold(_core().nodes, _Text(), values=values) is values
