"""`object mug of category("mug")`: an object that is another asset of an index in each scene.

Which asset is drawn as numbers of things are: each object of a category counts as a number, that of the asset. In files
and cores the object is called after its asset, `mug:025_mug`; the spec of all members has an object for each asset.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from scenegen.errors import Diagnostic, Span, SpecError
from scenegen.errors.declarations import (
    ASSET_INDEX,
    DEPENDS_ON_NUMBER,
    FILE_WITHOUT_QUOTES,
    NOT_A_CATEGORY,
    NOT_OF_CATEGORY,
    ONE_NUMBER,
    SPEC_TOO_LARGE,
    TOO_MANY_COUNTS,
    UNKNOWN_ASSET,
    UNUSABLE_SHAPE_FILE,
)
from scenegen.errors.language import NO_PLACE_OVER_TIME
from scenegen.lang.check.imports import Project
from scenegen.lang.check.names import bind
from scenegen.lang.check.regions import SIGNATURES
from scenegen.lang.check.scope import DeclaredObject, Scope
from scenegen.lang.check.weights import refuse_fine_weights, whole_weights
from scenegen.lang.spec import CheckedSpec, Count, Support, combinations, numbers_text
from scenegen.lang.syntax import ast
from scenegen.things import Shape
from scenegen.things.library import INDEX

if TYPE_CHECKING:
    from scenegen.things.indexed import AssetEntry


# Random numbers of things: a spec with `object block[3..8]` is a family of ordinary specs, one for each combination.
#
# Every member is checked as if its numbers stood in the text, so whatever works on ordinary specs works on members.


MAX_CATEGORY_NODES = 2_000_000  # of the formulas of all members together


def family(module: ast.Module, last: CheckedSpec, member: Callable[[dict[str, int]], CheckedSpec]) -> CheckedSpec:
    """The spec with its members; `last` was checked with the most there can be. Raises SpecError for what is wrong in a
    member, and for what is not the same in all though scene files say it once."""
    if last.timed is not None:
        first = last.counts[0]
        if first.assets:
            raise SpecError(NOT_OF_CATEGORY(name=first.name, what="the spec is one of motions"))
        raise SpecError(NO_PLACE_OVER_TIME(name=first.name, most=first.most))
    members: list[CheckedSpec] = []
    nodes = 0
    for numbers in combinations(last.counts):
        try:
            made = member(numbers)
        except SpecError as error:
            raise SpecError(*(one.but(counted=numbers_text(numbers)) for one in error.diagnostics)) from None
        nodes += len(made.core.nodes)
        if nodes > MAX_CATEGORY_NODES:
            reason = f"has more than {MAX_CATEGORY_NODES:,} formulas in its combinations of numbers"
            raise SpecError(SPEC_TOO_LARGE(file=module.source.name, reason=reason))
        members.append(made)
    for numbers, made in zip(combinations(last.counts), members, strict=True):
        what = _differs(made, last)
        if what is not None:
            *_, most = map(numbers_text, combinations(last.counts))
            asset = next((one.name for one in last.counts if one.assets), None)
            raise SpecError(DEPENDS_ON_NUMBER(what=what, counted=numbers_text(numbers), most=most, asset=asset))
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

    def identity(one: object) -> object:
        carrier = getattr(one, "carrier", None)
        return (getattr(one, "name", None), None if carrier is None else spec.objects[carrier])

    choice = spec.choices.get(which)
    options = None if choice is None else (tuple(map(identity, choice.options)), choice.ends)
    return spec.heights[which], identity(spec.supports.get(which)), options


MAX_SHOWN_ASSETS = 8  # names that a help line lists


def index_of(path: str) -> tuple[str, str]:
    """Where the index of `ycb/025_mug` is, and the name in it."""
    folder, _, name = path.replace("\\", "/").rpartition("/")
    return f"{folder}/{INDEX}" if folder else INDEX, name


def entries_of(path: str, here: Span, project: Project) -> Mapping[str, AssetEntry]:
    """The entries of the index that `path` names. Raises SpecError."""
    from scenegen.things.indexed import IndexFileError, read_index

    where, name = index_of(path)
    file = project.find(where, here)
    with contextlib.suppress(OSError):  # of a folder that is closed to us, which reading names
        if not file.exists():
            raise SpecError(ASSET_INDEX(here, path=where, name=name))
    try:
        return read_index(project.read(where, here, "an index of assets"))
    except IndexFileError as error:
        raise SpecError(ASSET_INDEX(here, path=where, reason=str(error))) from None


def asset_shape(path: str, here: Span, project: Project) -> Shape:
    """What the asset looks like: its outline and height, scaled and turned upright. Raises SpecError."""
    where, name = index_of(path)
    key = project.find(where, here), name
    if key not in project.shapes:
        project.shapes[key] = _read(path, here, project)
    return replace(project.shapes[key], path=path)


def _read(path: str, here: Span, project: Project) -> Shape:
    from scenegen.things.indexed import AssetSizeError, fit_asset
    from scenegen.things.outline import MeshError

    where, name = index_of(path)
    entries = entries_of(path, here, project)
    entry = entries.get(name)
    if entry is None:
        some, more = list(entries)[:MAX_SHOWN_ASSETS], max(0, len(entries) - MAX_SHOWN_ASSETS)
        raise SpecError(
            UNKNOWN_ASSET(here, path=where, name=name, known=entries, some=some, more=more or None, asset=True)
        )
    file = str(PurePosixPath(where).parent / entry.file.replace("\\", "/"))

    def read_other(other: str) -> bytes:
        return project.read_beside(file, other, here)

    try:
        kind = "a URDF file" if entry.is_robot else "a mesh file"
        found = fit_asset(entry, project.read(file, here, kind), read_other)
    except AssetSizeError as error:
        raise SpecError(UNUSABLE_SHAPE_FILE(here, name=name, size=error.size, hint=error.hint or None)) from None
    except MeshError as error:
        raise SpecError(UNUSABLE_SHAPE_FILE(here, path=file, reason=str(error))) from None
    return Shape("asset", found.footprint, found.height, path)


WORD = "category"
USAGE = 'category("mug")'
SIGNATURE = SIGNATURES[WORD]
MOST_COMBINATIONS = 64  # of numbers of things and assets: each is a spec of its own


@dataclass(frozen=True, slots=True)
class Category:
    """What an object, or each element of an array, can be: one of `assets`; `picks` (one each, from 1) says which, 0 is
    drawn, as often as `weights` say; none: all are equally likely. `path` is what the spec calls the category."""

    path: str
    assets: tuple[Shape, ...]
    picks: tuple[int, ...]
    weights: tuple[int, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the assets."""
        return tuple(index_of(one.path)[1] for one in self.assets)


def is_category(expr: ast.Expr | None) -> bool:
    """Whether a shape is a category."""
    return isinstance(expr, ast.Call) and expr.function.id == WORD


def category_of(
    thing: DeclaredObject, count: int, project: Project, outline_of: Callable[[ast.Expr], Shape]
) -> Category | None:
    """The category of an object, or of an array of `count`; None where it has another shape. `outline_of` gives the
    shape of an asset with its outline. Raises SpecError."""
    one = thing.declaration
    if one is None or not isinstance(one.shape, ast.Call) or not is_category(one.shape):
        return None
    here = one.shape.span(thing.source)
    if isinstance(one.count, ast.Range | ast.Weighted):
        raise SpecError(NOT_OF_CATEGORY(here, name=thing.name.id, what="how many there are of it is drawn as well"))
    given = bind(one.shape, SIGNATURE, thing.source)
    if not isinstance(given, dict):
        raise SpecError(given)
    path = given["name"]
    if not isinstance(path, ast.Text):
        raise SpecError(FILE_WITHOUT_QUOTES(path.span(thing.source), what="a category", usage=USAGE))
    most, seed = (_number(given.get(name), thing, default) for name, default in (("most", 0), ("seed", 0)))
    if "most" in given and most < 1:
        raise SpecError(NOT_A_CATEGORY(given["most"].span(thing.source), usage=SIGNATURE.usage))
    for name in ("most", "seed"):
        if "assets" in given and name in given:  # which has chosen already
            raise SpecError(NOT_A_CATEGORY(given[name].span(thing.source), usage=SIGNATURE.usage))
    weights: tuple[int, ...] = ()
    if "assets" in given:
        assets, weights = _listed_shapes(given["assets"], thing, outline_of)
    else:
        names = _category_folders(path.value, path.span(thing.source), project)
        folder = path.value.replace("\\", "/").rpartition("/")[0]
        chosen = _pick_names(names, most or len(names), seed)
        _refuse_many(len(chosen) ** count, here, thing)  # before any mesh is read
        at = path.span(thing.source)
        assets = tuple(asset_shape(f"{folder}/{name}" if folder else name, at, project) for name in chosen)
        entries = entries_of(path.value, at, project)
        weights = _unequal([Fraction(repr(entries[name].weight)) for name in chosen])
    picks = _picks(given.get("pick"), count, len(assets), thing)
    return Category(path.value, assets, picks, weights)


@dataclass(frozen=True, slots=True)
class Variants:
    """What objects of categories are, by their places: their `names` and `shapes`. `more` are the objects behind those
    of the spec, one for each further asset that can be drawn: the place of the spec's object, its name and shape."""

    names: dict[int, str] = field(default_factory=dict)
    shapes: dict[int, Shape] = field(default_factory=dict)
    more: list[tuple[int, str, Shape]] = field(default_factory=list)

    def all_names(self, objects: Mapping[str, int]) -> tuple[str, ...]:
        """The names of all objects, by the places of those of the spec."""
        return (*(self.names.get(place, name) for name, place in objects.items()), *(name for _, name, _ in self.more))

    def behind(self, first: int) -> dict[int, int]:
        """The places of the objects behind those of the spec, from `first` on, and whom each takes the place of."""
        return {first + number: place for number, (place, _, _) in enumerate(self.more)}


def variants(scope: Scope, found: Mapping[str, Category], counts: Mapping[str, int]) -> Variants:
    """Names and shapes of the objects of categories, where `counts` says which asset some of them are. Puts what is
    drawn into the counts of the scope. Raises SpecError where there are too many combinations."""
    made = Variants()
    for name, category in found.items():
        thing = scope.things[name]
        for number, place in enumerate(scope.arrays.get(name) or (scope.objects[name],)):
            element = f"{name}[{number + 1}]" if thing.is_array else name
            pick = category.picks[number] or counts.get(element, 0) or (1 if len(category.assets) == 1 else 0)
            if not category.picks[number] and len(category.assets) > 1:
                each = category.names, (), category.weights
                scope.counts[element] = Count(element, 1, len(category.assets), *each)
            known = [(f"{element}:{one}", shape) for one, shape in zip(category.names, category.assets, strict=True)]
            made.names[place], made.shapes[place] = known[max(0, pick - 1)]
            if not pick:
                made.more.extend((place, *one) for one in known[1:])
        assert thing.declaration is not None and thing.declaration.shape is not None
        drawn = [one for one in scope.counts.values() if one.name not in counts]
        here = thing.declaration.shape.span(thing.source)
        _refuse_many(math.prod(len(one.numbers) for one in drawn), here, thing)
        refuse_fine_weights(drawn, here)
    return made


def refuse_surfaces(thing: DeclaredObject, options: Sequence[Sequence[Support]], here: Span) -> None:
    """Raises SpecError for an object of a category that stands on one of several surfaces."""
    kind = thing.declaration is not None and is_category(thing.declaration.shape)
    if kind and any(len(one) > 1 for one in options):
        what = "it stands on another surface in each scene"
        raise SpecError(NOT_OF_CATEGORY(here, name=thing.name.id, what=what))


def category_picks(name: str, category: Category, arrayed: bool, counts: Mapping[str, int]) -> tuple[int, ...]:
    """The picks of a category with those of `counts`; 0 is drawn."""
    elements = [f"{name}[{k}]" for k in range(1, len(category.picks) + 1)] if arrayed else [name]
    return tuple(pick or counts.get(one, 0) for pick, one in zip(category.picks, elements, strict=True))


def _refuse_many(combinations: int, here: Span, thing: DeclaredObject) -> None:
    if combinations > MOST_COMBINATIONS:
        shown = min(combinations, 10**15)
        raise SpecError(TOO_MANY_COUNTS(here, combinations=shown, limit=MOST_COMBINATIONS, asset=thing.name.id))


def _category_folders(path: str, here: Span, project: Project) -> list[str]:
    from scenegen.things.indexed import categories

    where, name = index_of(path)
    known = categories(entries_of(path, here, project))
    if name not in known:
        raise SpecError(UNKNOWN_ASSET(here, path=where, name=name, known=tuple(known)))
    return known[name]


def _pick_names(names: Sequence[str], most: int, seed: int) -> list[str]:
    """`most` of the names in their order, drawn by `seed`: which are drawn depends little on what else there is."""
    if most >= len(names):
        return list(names)
    drawn = sorted(names, key=lambda name: hashlib.sha256(f"{seed}:{name}".encode()).digest())[:most]
    return [name for name in names if name in set(drawn)]


def _number(expr: ast.Expr | None, thing: DeclaredObject, default: int) -> int:
    if expr is None:
        return default
    written = expr.number if isinstance(expr, ast.Quantity) and not expr.unit else ""
    if not (written.isascii() and written.isdigit() and len(written) <= 9):
        raise SpecError(NOT_A_CATEGORY(expr.span(thing.source), usage=SIGNATURE.usage))
    return int(written)


def _picks(expr: ast.Expr | None, count: int, most: int, thing: DeclaredObject) -> tuple[int, ...]:
    items = (expr.items if isinstance(expr, ast.List) else (expr,)) if expr is not None else ()
    picks = tuple(_number(item, thing, 0) for item in items) or (0,) * count
    if len(picks) != count or max(picks) > most:
        assert expr is not None
        raise SpecError(NOT_A_CATEGORY(expr.span(thing.source), usage=SIGNATURE.usage))
    return picks


def _unequal(weights: Sequence[Fraction]) -> tuple[int, ...]:
    """Weights as whole numbers; none where they are all the same."""
    return whole_weights(weights) if len(set(weights)) > 1 else ()


def _listed_shapes(
    expr: ast.Expr, thing: DeclaredObject, outline_of: Callable[[ast.Expr], Shape]
) -> tuple[tuple[Shape, ...], tuple[int, ...]]:
    """The assets of a canonical text, and their weights."""
    found: list[Shape] = []
    for item in expr.items if isinstance(expr, ast.List | ast.Weighted) else ():
        if not isinstance(item, ast.Call) or item.function.id != "asset" or len(item.arguments) != 2:
            raise SpecError(NOT_A_CATEGORY(item.span(thing.source), usage=SIGNATURE.usage))
        found.append(outline_of(item))
    if not found or len({index_of(one.path)[1] for one in found}) < len(found):
        raise SpecError(NOT_A_CATEGORY(expr.span(thing.source), usage=SIGNATURE.usage))
    weights = expr.weights if isinstance(expr, ast.Weighted) else ()
    return tuple(found), tuple(_number(one, thing, 0) for one in weights)
