"""Random numbers of things: a spec with `object block[3..8]` is a family of ordinary specs, one for each combination.

Every member is checked as if its numbers stood in the text, so whatever works on ordinary specs works on members.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from scenegen.errors import Diagnostic, SpecError
from scenegen.errors.counts import DEPENDS_ON_NUMBER, NOT_OF_CATEGORY, NUMBERS_OVER_TIME, ONE_NUMBER
from scenegen.errors.declarations import SPEC_TOO_LARGE
from scenegen.lang import ast
from scenegen.lang.scope import Scope
from scenegen.lang.spec import CheckedSpec, Count

MOST_NODES = 2_000_000  # of the formulas of all members together


class Picked(int):
    """The number of an asset, which knows its name."""

    asset: str = ""


def _numbers(one: Count) -> list[int]:
    if not one.assets:
        return list(one.numbers)
    found = [Picked(number) for number in one.numbers]
    for number, asset in zip(found, one.assets, strict=True):
        number.asset = asset
    return list(found)


def combinations(counts: Sequence[Count]) -> Iterator[dict[str, int]]:
    """Every combination of numbers by name, in lexicographic order."""
    names = [one.name for one in counts]
    for numbers in itertools.product(*map(_numbers, counts)):
        yield dict(zip(names, numbers, strict=True))


def written(numbers: Mapping[str, int]) -> str:
    """Numbers of things as a spec has them, assets as objects are called: `block[3] and mug:red`."""
    each = numbers.items()
    return " and ".join(f"{name}:{one.asset}" if isinstance(one, Picked) else f"{name}[{one}]" for name, one in each)


def file_stem(numbers: Mapping[str, int]) -> str:
    """Numbers of things as part of a file's name: `block=3,mug=red`."""
    each = numbers.items()
    named = (f"{name}={one.asset.replace('/', '_') if isinstance(one, Picked) else one}" for name, one in each)
    return ",".join(named)


def family(module: ast.Module, last: CheckedSpec, member: Callable[[dict[str, int]], CheckedSpec]) -> CheckedSpec:
    """The spec with its members; `last` was checked with the most there can be. Raises SpecError for what is wrong in a
    member, and for what is not the same in all though scene files say it once."""
    if last.timed is not None:
        first = last.counts[0]
        if first.assets:
            raise SpecError(NOT_OF_CATEGORY(name=first.name, what="the spec is one of motions"))
        raise SpecError(NUMBERS_OVER_TIME(name=first.name, most=first.most))
    members: list[CheckedSpec] = []
    nodes = 0
    for numbers in combinations(last.counts):
        try:
            made = member(numbers)
        except SpecError as error:
            raise SpecError(*(one.but(counted=written(numbers)) for one in error.diagnostics)) from None
        nodes += len(made.core.nodes)
        if nodes > MOST_NODES:
            reason = f"has more than {MOST_NODES:,} formulas in its combinations of numbers"
            raise SpecError(SPEC_TOO_LARGE(file=module.source.name, reason=reason))
        members.append(made)
    for numbers, made in zip(combinations(last.counts), members, strict=True):
        what = _differs(made, last)
        if what is not None:
            *_, most = map(written, combinations(last.counts))
            asset = next((one.name for one in last.counts if one.assets), None)
            raise SpecError(DEPENDS_ON_NUMBER(what=what, counted=written(numbers), most=most, asset=asset))
    return replace(last, members=tuple(replace(one, title=last.title, name=last.name) for one in members))


def always_the_same(scope: Scope, alone: Mapping[str, int]) -> Iterator[Diagnostic]:
    """A warning for each range of one number."""
    for name, number in alone.items():
        declaration = scope.things[name].declaration
        if declaration is not None and declaration.count is not None:
            yield ONE_NUMBER(declaration.count.span(scope.things[name].source), name=name, least=number)


def _differs(one: CheckedSpec, last: CheckedSpec) -> str | None:
    """What a member says otherwise than the one with all objects, of things that both have."""
    if (one.workspace.x, one.workspace.y) != (last.workspace.x, last.workspace.y):
        return "the workspace"
    if one.regions != last.regions:
        return "a region"
    place = {name: number for number, name in enumerate(last.objects)}
    for number, name in enumerate(one.objects):
        there = place[name]
        if one.shapes[number] != last.shapes[there]:
            return f"the shape of `{name}`"
        if one.fixed.get(number) != last.fixed.get(there):
            return f"the place of `{name}`"
        if _standing(one, number) != _standing(last, there):
            return f"what `{name}` stands on"
    return None


def _standing(spec: CheckedSpec, which: int) -> object:
    """What is known of an object's support, in names."""
    if not spec.declares_heights:
        return None

    def named(one: object) -> object:
        carrier = getattr(one, "carrier", None)
        return (getattr(one, "name", None), None if carrier is None else spec.objects[carrier])

    choice = spec.choices.get(which)
    options = None if choice is None else (tuple(map(named, choice.options)), choice.ends)
    return spec.heights[which], named(spec.supports.get(which)), options
