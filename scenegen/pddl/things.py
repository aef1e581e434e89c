"""What things look like: by category a shape of the language, or furniture that is held in place.

Sizes are in metres and of our own choosing, after everyday things: a map of one's own takes their place. Furniture has
a body, which is solid, and sites, at which things can be: the top of the body, or a board at a height, in the
furniture's frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

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
ROOM = (0.0, 0.0, 5.0, 4.0)  # the floor of a household, where furniture stands

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
