"""What the things of a problem are in a spec: ground, furniture held in place, objects; and what names refer to."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

from scenegen.errors import DataError, Diagnostic
from scenegen.errors.diagnostic import nearest
from scenegen.errors.worlds import PDDL_UNKNOWN_NAME, UNKNOWN_CATEGORY
from scenegen.geometry import Box, Circle
from scenegen.lang.check.scope import BUILT_IN, prelude
from scenegen.lang.checker import check_text
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.tokens import KEYWORDS
from scenegen.planning.goal import NameMap, key
from scenegen.planning.problem import Node, PddlProblem, PddlRegion, TypedName
from scenegen.things.library import ALIASES, ASSETS, Shape
from scenegen.things.surfaces import fits, surfaces_of

# What things look like: by category a shape of the language, or furniture that is held in place.
# Sizes are in metres and of our own choosing, after everyday things: a map of one's own takes their place. Furniture
# has a body, which is solid, and sites, at which things can be: the top of the body, or a board at a height, in the
# furniture's frame.
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Board:
    """A rectangle x0, y0, x1, y1 at a height, in metres. `pulled` boards are drawers: they are out where something of
    the problem is in them."""

    outline: Rectangle
    height: float
    pulled: bool = False


@dataclass(frozen=True, slots=True)
class Furniture:
    """`body`: length along x, width along y and height, or None if there are only boards. A site is a board, or
    None for the top of the body. The first site is meant by the name of the furniture alone."""

    body: tuple[float, float, float] | None = None
    sites: dict[str, Board | None] = field(default_factory=dict)


def _chest() -> Furniture:
    drawer = (-0.10, -0.30, 0.10, -0.10)
    return Furniture(
        (0.25, 0.19, 0.22),
        {
            "top_side": None,
            "top_region": Board(drawer, 0.15, pulled=True),
            "middle_region": Board(drawer, 0.085, pulled=True),
            "bottom_region": Board(drawer, 0.02, pulled=True),
        },
    )


def _square(x: float, y: float, half_x: float, half_y: float) -> Rectangle:
    return (x - half_x, y - half_y, x + half_x, y + half_y)


def _boards(length: float, width: float, *heights: float) -> Furniture:
    names = ("", "shelf_2", "shelf_3")
    return Furniture(
        None,
        {
            name: Board(_square(0.0, 0.0, length / 2, width / 2), height)
            for name, height in zip(names, heights, strict=False)
        },
    )


FURNITURE: dict[str, Furniture] = {
    "wooden_cabinet": _chest(),
    "white_cabinet": _chest(),
    "flat_stove": Furniture((0.15, 0.15, 0.03), {"cook_region": None}),
    "microwave": Furniture(
        None,
        {
            "top_side": Board(_square(0.0, 0.0, 0.12, 0.09), 0.21),
            "heating_region": Board(_square(0.0, 0.0, 0.12, 0.09), 0.03),
        },
    ),
    "wine_rack": Furniture((0.20, 0.16, 0.215), {"top_region": None}),
    "desk_caddy": Furniture(
        None,
        {
            "front_contain_region": Board(_square(-0.035, 0.0, 0.028, 0.062), 0.02),
            "back_contain_region": Board(_square(0.035, 0.0, 0.028, 0.062), 0.02),
            "left_contain_region": Board(_square(0.0, 0.145, 0.062, 0.062), 0.02),
            "right_contain_region": Board(_square(0.0, -0.145, 0.062, 0.062), 0.02),
        },
    ),
    "wooden_two_layer_shelf": Furniture(
        None,
        {
            "top_side": Board(_square(0.0, 0.0, 0.17, 0.09), 0.24),
            "top_region": Board(_square(0.0, 0.0, 0.17, 0.09), 0.12),
            "bottom_region": Board(_square(0.0, 0.0, 0.17, 0.09), 0.02),
        },
    ),
    "table": _boards(1.2, 0.7, 0.75),
    "breakfast_table": _boards(1.0, 0.8, 0.75),
    "coffee_table": _boards(1.0, 0.6, 0.45),
    "desk": _boards(1.2, 0.6, 0.75),
    "countertop": _boards(1.4, 0.6, 0.9),
    "bed": _boards(2.0, 1.4, 0.5),
    "sofa": _boards(1.6, 0.7, 0.45),
    "chair": _boards(0.45, 0.45, 0.45),
    "shelf": _boards(0.9, 0.35, 0.3, 0.65, 1.0),
    "bookcase": _boards(0.9, 0.35, 0.3, 0.65, 1.0),
    "cabinet": _boards(0.8, 0.45, 0.4, 0.8),
    "electric_refrigerator": _boards(0.6, 0.6, 0.4, 0.8, 1.2),
    "fridge": _boards(0.6, 0.6, 0.4, 0.8, 1.2),
    "sink": _boards(0.6, 0.45, 0.75),
    "stove": _boards(0.6, 0.6, 0.9),
    "dishwasher": _boards(0.55, 0.55, 0.3),
    "oven": _boards(0.5, 0.45, 0.4),
}

GROUNDS: dict[str, Rectangle] = {  # what the workspace is
    "kitchen_table": (-0.5, -0.6, 0.5, 0.6),
    "main_table": (-0.5, -0.6, 0.5, 0.6),
    "study_table": (-0.5, -0.6, 0.5, 0.6),
    "living_room_table": (-0.35, -0.8, 0.35, 0.8),
    "coffee_table": (-0.35, -0.8, 0.35, 0.8),
    "floor": (-0.75, -0.75, 0.75, 0.75),
}
ROOM_FLOOR = (0.0, 0.0, 5.0, 4.0)  # the floor of a household, where furniture stands

THINGS: dict[str, str] = {
    "akita_black_bowl": "bowl",
    "white_bowl": "bowl",
    "glazed_rim_porcelain_ramekin": "cylinder(5 cm, 4.5 cm)",
    "porcelain_mug": "mug",
    "red_coffee_mug": "mug",
    "white_yellow_mug": "mug",
    "wine_bottle": "bottle",
    "ketchup": "cylinder(3 cm, 15 cm)",
    "bbq_sauce": "cylinder(3 cm, 15 cm)",
    "salad_dressing": "cylinder(3 cm, 15 cm)",
    "new_salad_dressing": "cylinder(3 cm, 15 cm)",
    "alphabet_soup": "cylinder(3.3 cm, 9 cm)",
    "tomato_sauce": "cylinder(3.3 cm, 9 cm)",
    "milk": "box(6 cm, 6 cm, 14 cm)",
    "orange_juice": "box(6 cm, 6 cm, 14 cm)",
    "butter": "box(9 cm, 5 cm, 3 cm)",
    "cream_cheese": "box(9 cm, 5 cm, 3 cm)",
    "chocolate_pudding": "box(8 cm, 6 cm, 3 cm)",
    "cookies": "box(13 cm, 9 cm, 3 cm)",
    "popcorn": "box(10 cm, 6 cm, 4 cm)",
    "macaroni_and_cheese": "box(12 cm, 8 cm, 3.5 cm)",
    "chefmate_8_frypan": "cylinder(9 cm, 5 cm)",
    "moka_pot": "cylinder(4.5 cm, 11 cm)",
    "basket": "bin",
    "wooden_tray": "tray",
    "black_book": "box(16 cm, 11 cm, 3 cm)",
    "yellow_book": "box(16 cm, 11 cm, 3 cm)",
    "block": "block",
    "cube": "block",
    "book": "book",
    "bucket": "bin",
    "hardback": "book",
    "notebook": "book",
    "candle": "cylinder(3 cm, 10 cm)",
    "cookie": "cylinder(3 cm, 1.5 cm)",
    "cheese": "box(8 cm, 6 cm, 4 cm)",
    "bow": "box(6 cm, 4 cm, 2 cm)",
    "sweater": "box(30 cm, 25 cm, 4 cm)",
    "scrub_brush": "box(20 cm, 6 cm, 4 cm)",
    "rag": "box(20 cm, 20 cm, 1 cm)",
    "dishtowel": "box(30 cm, 20 cm, 1 cm)",
    "saucepan": "pot",
    "pan": "cylinder(13 cm, 5 cm)",
    "sandwich": "box(12 cm, 12 cm, 5 cm)",
    "sack": "carton",
    "package": "carton",
}


BODILESS = ("agent", "robot", "gripper", "arm", "hand", "room", "location", "waypoint")  # kinds without a place here
FURNITURE_GAP = 0.05  # metres between pieces of furniture that no region places


@dataclass(frozen=True, slots=True)
class Referent:
    """What a name refers to: `argument` of a relation, and the `surfaces` that it offers. `kind` tells which; `owner`
    is a thing's name in the problem."""

    argument: str
    surfaces: tuple[str, ...]
    kind: str  # ground, region, thing, boards
    owner: str = ""


@dataclass(frozen=True, slots=True)
class PddlArea:
    """A region that the spec needs, as text; its `box` where that is along the axes; whether it is a `board`, which has
    a height."""

    text: str
    box: Rectangle | None
    board: bool = False


@dataclass(slots=True)
class Setting:
    """The parts of a problem by what becomes of them. `shapes` are those of objects, `poses` (x, y, heading in radians)
    of furniture; `used` the regions that the spec needs, by identifier."""

    problem: PddlProblem
    table: NameMap
    ids: dict[str, str] = field(default_factory=dict)
    grounds: list[str] = field(default_factory=list)
    space: Rectangle = (0.0, 0.0, 1.0, 1.0)
    shapes: dict[str, str] = field(default_factory=dict)
    furniture: dict[str, Furniture] = field(default_factory=dict)
    poses: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    without: list[str] = field(default_factory=list)  # things without a body
    used: dict[str, PddlArea] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)

    def classify(self) -> None:
        """Sort the things. Raises DataError for kinds of which no size is known, all at once."""
        problems: list[Diagnostic] = []
        targets = {one.target for one in self.problem.regions.values() if one.ranges}
        mapped = {key.lower(): shape for key, shape in self.table.objects.items()}
        for name, thing in self.problem.things.items():
            kind, known = self._kind(thing, mapped)
            self.ids[name] = self._identifier(re.sub(r"\.n\.\d+", "", name, flags=re.IGNORECASE))
            if name in targets or (not targets and known in ("floor", "ground", "lawn", "driveway")):
                self.grounds.append(name)
                fallback = GROUNDS["kitchen_table"] if targets else ROOM_FLOOR
                self.space = GROUNDS.get(known) or GROUNDS.get(name.lower()) or fallback if targets else ROOM_FLOOR
            elif (shape := _map_entry(mapped, name, kind, known)) is not None:
                self.shapes[name] = shape
                shape_from(shape)
            elif known in BODILESS:
                self.without.append(name)
            elif known in THINGS:
                self.shapes[name] = THINGS[known]
            elif known in FURNITURE and (name in self.problem.fixtures or not targets):
                self.furniture[name] = FURNITURE[known]
            else:
                asset = _asset(known) or (_asset(category(name)) or "block" if known == "object" else None)
                if asset is None:
                    near = [one for one in (nearest(known, {*THINGS, *FURNITURE, *ASSETS}),) if one]
                    if not any(one.facts["name"] == kind for one in problems):
                        problems.append(UNKNOWN_CATEGORY(thing.node.span, name=kind, key=key(kind), near=near))
                    continue
                self.shapes[name] = asset
        if problems:
            raise DataError(*problems)
        for region in self.problem.regions.values():  # the sizes of grounds are ours: regions lie on them
            if region.target in self.grounds:
                self.space = enclosing([self.space, *region.ranges])
        self._lay_out()

    def _kind(self, thing: TypedName, mapped: Mapping[str, str]) -> tuple[str, str]:
        """A thing's type and its category; of several types the first of which a size is known."""
        kinds = [(kind, category(kind)) for kind in thing.kinds]
        sized = (one for one in kinds if _map_entry(mapped, *one) or one[1] in (THINGS | FURNITURE) or _asset(one[1]))
        return next(sized, kinds[0])

    def _identifier(self, name: str) -> str:
        """An identifier like a name, which no thing has and the language does not use."""
        made = re.sub(r"\W", "_", name, flags=re.ASCII)
        made = made if re.match(r"[A-Za-z_]", made) else f"a_{made}"
        while made in _own_names() or made in self.ids.values():
            made += "_"
        return made

    def _lay_out(self) -> None:
        """Furniture that no region places stands in rows, from the lower left corner of the room."""
        if any(one.ranges for one in self.problem.regions.values()):
            return
        x = y = row = 0.0
        if self.furniture and not self.grounds:
            self.space = ROOM_FLOOR
        for name, made in self.furniture.items():
            boards = [one.outline for one in made.sites.values() if one is not None]
            body = made.body or (0.1, 0.1, 0.1)
            length = max([body[0], *(one[2] - one[0] for one in boards)])
            width = max([body[1], *(one[3] - one[1] for one in boards)])
            if x + length > self.space[2]:
                x, y, row = 0.0, y + row + FURNITURE_GAP, 0.0
            self.poses[name] = (round(x + length / 2, 4), round(y + width / 2, 4), 0.0)
            x, row = x + length + FURNITURE_GAP, max(row, width)
        self.space = (*self.space[:3], max(self.space[3], y + row + 1.0))

    def place(self, name: str, region: PddlRegion) -> None:
        """Hold furniture in the middle of a region, at its middle heading."""
        x0, y0, x1, y1 = region.ranges[0]
        low, high = region.yaw[0] if region.yaw else (0.0, 0.0)
        self.poses[name] = (round((x0 + x1) / 2, 4), round((y0 + y1) / 2, 4), (low + high) / 2)

    def resolve(self, name: str, node: Node) -> Referent:
        """Raises DataError for a name that is not declared, or without a place."""
        if name in self.grounds:
            return Referent("workspace", ("workspace",), "ground")
        if name in self.shapes:
            return Referent(self.ids[name], (self.ids[name],), "thing", name)
        if name in self.furniture:
            found = [self._site(name, one) for one in self.furniture[name].sites if self._usable(name, one)]
            return Referent(self.ids[name] if self.furniture[name].body else found[0], tuple(found), "boards")
        region = self.problem.regions.get(name)
        if region is not None and region.ranges:
            names = self._rectangles(name, region)
            return Referent(names[0], names, "region")
        if region is not None and region.target in self.shapes:  # the inside of a basket, say
            return Referent(self.ids[region.target], (self.ids[region.target],), "thing", region.target)
        for owner in sorted(self.ids, key=len, reverse=True):
            if not name.lower().startswith(f"{owner.lower()}_"):
                continue
            rest = name[len(owner) + 1 :].lower()
            if owner in self.furniture and rest in self.furniture[owner].sites:
                site = self._site(owner, rest)
                return Referent(site, (site,), "region")
        known = [*self.shapes, *self.furniture, *self.problem.regions, *self.grounds]
        raise DataError(PDDL_UNKNOWN_NAME(node.span, what="thing or region", name=name, known=known))

    def _usable(self, name: str, site: str) -> bool:
        board = self.furniture[name].sites[site]
        return board is None or not board.pulled

    def _site(self, name: str, site: str) -> str:
        board = self.furniture[name].sites[site]
        if board is None:
            return self.ids[name]
        made = self._identifier(f"{self.ids[name]}_{site}" if site else f"{self.ids[name]}_board")
        self.used[made] = _area(made, board, self.poses.get(name, (0.0, 0.0, 0.0)))
        return made

    def fill(self) -> None:
        """All boards of furniture, but for drawers, are there, used or not."""
        for name, made in self.furniture.items():
            for site in made.sites:
                if self._usable(name, site):
                    self._site(name, site)

    def _rectangles(self, name: str, region: PddlRegion) -> tuple[str, ...]:
        names = []
        for number, (x0, y0, x1, y1) in enumerate(region.ranges, start=1):
            made = self._identifier(name if len(region.ranges) == 1 else f"{name}_part{number}")
            left, right, bottom, top = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
            right, top = max(right, left + 0.001), max(top, bottom + 0.001)
            box = (left, bottom, right, top)
            self.used[made] = PddlArea(f"region {made} = rect({', '.join(map(_number_text, box))})", _round(box))
            line = self.problem.source.position(region.node.span.start)[0]
            self.notes[made] = f"line {line}: (:ranges ...) of {region.name}"
            names.append(made)
        return tuple(names)

    def carries(self, upper: str, lower: str, *, inside: bool) -> float:
        """How far the height of `upper` on `lower` may be off, in metres. What cannot carry it becomes solid."""
        off = self.height_error(upper, lower, inside=inside)
        if off is not None:
            return off
        under = shape_from(self.shapes[lower])
        self.notes[lower] = f"solid: {self.shapes[lower]} has no surface that carries {upper}"
        self.shapes[lower] = _solid(under)
        return 0.001

    def height_error(self, upper: str, lower: str, *, inside: bool) -> float | None:
        """How far the height of `upper` on `lower` may be off, in metres; None where it cannot be carried."""
        over, under = shape_from(self.shapes[upper]), shape_from(self.shapes[lower])
        found = surfaces_of(under, over)
        if inside or (found and (not found[0].walled or fits(over.footprint, found[0].outline))):
            return 0.001 + (abs(found[0].height - surfaces_of(under)[0].height) if found else 0.0)
        return None


def category(kind: str) -> str:
    """`bowl` of `bowl.n.01` and `bowl_1`, in lower case."""
    return re.sub(r"_?\d+$", "", re.sub(r"\.n\.\d+.*$", "", kind.lower())).replace("-", "_")


def _map_entry(table: Mapping[str, str], *names: str) -> str | None:
    """What a map, whose keys are in lower case, says of the first of some names that it has."""
    return next((table[name.lower()] for name in names if name.lower() in table), None)


@cache
def _own_names() -> frozenset[str]:
    """What no object of a spec can be called."""
    constants = (one.name.id for one in prelude().statements if isinstance(one, ast.Constant))
    return frozenset({*KEYWORDS, *BUILT_IN, *constants, "goal", "start"})


@cache
def shape_from(text: str) -> Shape:
    """The shape that a text of the language means. Raises SpecError."""
    return check_text(f"object a = {text}\ntask: x(a) <= 10 m\n", "[objects]").shapes[0]


def _asset(name: str) -> str | None:
    for word in (name.replace("_", ""), name.rsplit("_", 1)[-1]):
        found = ALIASES.get(word, word)
        if found in ASSETS:
            return found
    return None


def enclosing(boxes: Iterable[Sequence[float]]) -> Rectangle:
    """The rectangle round some others, (x, y, x, y) each, in any order of their ends."""
    x0, y0, x1, y1 = zip(*boxes, strict=True)
    return min(x0 + x1), min(y0 + y1), max(x0 + x1), max(y0 + y1)


def _solid(shape: Shape) -> str:
    match shape.footprint:
        case Circle(radius):
            return f"cylinder({_number_text(radius)}, {_number_text(shape.height)})"
        case Box(length, width):
            return f"box({_number_text(length)}, {_number_text(width)}, {_number_text(shape.height)})"
        case _:
            return "block"


def _area(name: str, board: Board, pose: tuple[float, float, float]) -> PddlArea:
    x, y, turn = pose
    cos, sin = math.cos(turn), math.sin(turn)
    x0, y0, x1, y1 = board.outline
    corners = [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
    xs, ys = zip(*corners, strict=True)
    height = f"at {_number_text(board.height)} m"
    if abs(math.sin(2 * turn)) < 1e-6:
        box = (min(xs), min(ys), max(xs), max(ys))
        return PddlArea(f"region {name} = rect({', '.join(map(_number_text, box))}) {height}", _round(box), board=True)
    outline = ", ".join(f"({_number_text(u)}, {_number_text(v)})" for u, v in corners)
    return PddlArea(f"region {name} = polygon([{outline}]) {height}", None, board=True)


def _round(box: Rectangle) -> Rectangle:
    """As the text has it."""
    x0, y0, x1, y1 = (float(_number_text(one)) for one in box)
    return x0, y0, x1, y1


def _number_text(value: float) -> str:
    return f"{round(value, 4) + 0.0:.10g}"


def supports_of(edges: Mapping[str, list[str]], start: str, goal: str) -> bool:
    """Whether `start` stands on `goal`, directly or not."""
    stack, seen = [start], set[str]()
    while stack:
        one = stack.pop()
        if one == goal:
            return True
        if one not in seen:
            seen.add(one)
            stack.extend(edges.get(one, ()))
    return False
