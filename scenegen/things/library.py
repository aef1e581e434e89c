"""The asset library: real sizes in metres, one row per object, with all that is known of it.

The name of an object picks its row; an array element `block[3]` and a numbered name `block3` or `fork_2` pick the row
of their stem. A name that the library does not know gets a block in a colour of its own.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from scenegen.geometry.footprint import Box, Circle, Footprint, Polygon
from scenegen.things.arms import Arm
from scenegen.things.furniture import CABINET_WIDTH, Cabinet, Crate, Drawer, Form, Rack, RoundSolid, ShelfUnit, Vessel

RGB = tuple[float, float, float]

COLOR_WORDS = ("red", "orange", "yellow", "green", "blue", "purple", "pink", "brown", "white", "grey", "black")


def hex_of(written: str) -> str | None:
    """A colour as people write it, `red` or `#ffdd33`, as "#rrggbb"; None where it is none."""
    from PIL import ImageColor

    if not re.fullmatch(r"#[0-9a-fA-F]{3}([0-9a-fA-F]{3})?|[A-Za-z]+", written):
        return None
    try:
        red, green, blue = ImageColor.getrgb(written.lower())[:3]
    except ValueError:
        return None
    return f"#{red:02x}{green:02x}{blue:02x}"


INDEX = "assets.toml"  # what the index of a folder of assets is called

# shapes that a spec gives sizes of their own
PLAIN = (
    "box",
    "cylinder",
    "prism",
    "urdf",
    "mesh",
    "asset",
)


@dataclass(frozen=True, slots=True)
class Asset:
    """One kind of object: its footprint, height in metres, mass in kg, friction against wood, main colour (RGB in 0..1)
    and how its parts are made, as "module:function" in this folder: specs need footprints, only pictures need meshes.

    `form`: what stands in it and on it, and the pieces that collide, follow from that; what has none is the prism over
    its footprint, or has pieces in `bodies.PIECES`. Things stand on its `top`, on its `rim`, or, where it is `flat`, on
    all of its footprint; on others nothing does. Of a `bulging` one less than the footprint's corners touches a wall.
    """

    name: str
    footprint: Circle | Box
    height: float
    mass: float
    friction: float
    color: RGB
    build: str
    form: Form | None = None
    top: Circle | None = None
    rim: Circle | None = None
    flat: bool = False
    bulging: bool = False


@dataclass(frozen=True, slots=True)
class Shape:
    """What one object of a spec looks like: an entry of the library, or one of the plain shapes `box`, `cylinder`,
    `prism`, `urdf`, `mesh` and `asset` with sizes of its own. Footprint and height in metres; `path` is the file of a
    `urdf` or `mesh`, and the name of an `asset` after its folder's; `open` the shares by which the drawers of a
    `cabinet(...)` are open, the lowest first; `color` is that of a plain shape where the spec says it, as "#rrggbb". A
    robot is the `box` around its base, and has its `arm`, of the file `path` where it does not come along."""

    asset: str
    footprint: Footprint
    height: float
    path: str = ""
    open: tuple[float, ...] = ()
    color: str = ""
    arm: Arm | None = None


UNKNOWN = "block"

# fmt: off
ASSETS: dict[str, Asset] = {asset.name: asset for asset in (
    Asset("plate", Circle(0.125), 0.022, 0.45, 0.4, (0.95, 0.95, 0.94), "tableware:plate",
          Vessel(((0.0, 0.070, 0.0), (0.007, 0.088, 0.0), (0.007, 0.088, 0.076), (0.0125, 0.105, 0.092),
          (0.022, 0.125, 0.120)))),
    Asset("bowl", Circle(0.080), 0.060, 0.3, 0.4, (0.30, 0.53, 0.72), "tableware:bowl",
          Vessel(((0.0, 0.034, 0.0), (0.010, 0.046, 0.0), (0.010, 0.046, 0.030), (0.021, 0.061, 0.052),
          (0.060, 0.080, 0.076)))),
    Asset("mug", Circle(0.062), 0.095, 0.35, 0.45, (0.14, 0.45, 0.50), "tableware:mug",
          Vessel(((0.0, 0.036, 0.0), (0.010, 0.038, 0.0), (0.010, 0.038, 0.0305), (0.095, 0.038, 0.033)),
          (0.037, 0.0615, 0.020, 0.078))),
    Asset("cup", Circle(0.060), 0.075, 0.2, 0.45, (0.93, 0.72, 0.22), "tableware:cup",
          Vessel(((0.0, 0.022, 0.0), (0.010, 0.0245, 0.0), (0.010, 0.0245, 0.018), (0.035, 0.036, 0.030),
          (0.075, 0.0425, 0.038)), (0.036, 0.0595, 0.026, 0.064))),
    Asset("glass", Circle(0.035), 0.125, 0.3, 0.4, (0.66, 0.83, 0.90), "tableware:glass",
          Vessel(((0.0, 0.0275, 0.0), (0.008, 0.029, 0.0), (0.008, 0.029, 0.026), (0.125, 0.035, 0.032)))),
    Asset("bottle", Circle(0.036), 0.230, 0.8, 0.4, (0.15, 0.42, 0.27), "tableware:bottle",
          RoundSolid(((0.0, 0.032), (0.004, 0.036), (0.130, 0.036), (0.168, 0.0155), (0.230, 0.0145)))),
    Asset("can", Circle(0.033), 0.115, 0.35, 0.35, (0.76, 0.13, 0.20), "tableware:can",
          RoundSolid(((0.0, 0.027), (0.006, 0.033), (0.107, 0.033), (0.115, 0.0275))), top=Circle(0.0275)),
    Asset("jar", Circle(0.040), 0.120, 0.45, 0.4, (0.84, 0.50, 0.14), "tableware:jar",
          RoundSolid(((0.0, 0.036), (0.004, 0.040), (0.088, 0.040), (0.098, 0.0365), (0.120, 0.0365))),
          top=Circle(0.0365)),
    Asset("apple", Circle(0.037), 0.072, 0.18, 0.5, (0.76, 0.14, 0.13), "tableware:apple",
          RoundSolid(((0.0, 0.016), (0.012, 0.030), (0.036, 0.037), (0.052, 0.033), (0.072, 0.016)))),
    Asset("fork", Box(0.190, 0.028), 0.010, 0.045, 0.35, (0.52, 0.55, 0.61), "tableware:fork"),
    Asset("knife", Box(0.220, 0.022), 0.010, 0.07, 0.35, (0.62, 0.65, 0.70), "tableware:knife"),
    Asset("spoon", Box(0.180, 0.038), 0.012, 0.04, 0.35, (0.54, 0.57, 0.63), "tableware:spoon"),
    Asset("napkin", Box(0.150, 0.150), 0.004, 0.02, 0.6, (0.40, 0.62, 0.55), "tableware:napkin", flat=True),
    Asset("crackerbox", Box(0.160, 0.060), 0.210, 0.41, 0.5, (0.76, 0.19, 0.15), "tableware:crackerbox", flat=True),
    Asset("book", Box(0.210, 0.150), 0.025, 0.45, 0.5, (0.22, 0.36, 0.60), "tableware:book", flat=True),
    Asset("tray", Box(0.400, 0.300), 0.045, 0.80, 0.5, (0.25, 0.42, 0.45), "storage:tray",
          Crate(0.400, 0.300, 0.045, 0.011, 0.010)),
    Asset("carton", Box(0.300, 0.220), 0.160, 0.30, 0.5, (0.72, 0.53, 0.34), "storage:carton",
          Crate(0.300, 0.220, 0.160, 0.005, 0.005)),
    Asset("board", Box(0.340, 0.220), 0.018, 0.90, 0.5, (0.46, 0.29, 0.18), "storage:board", flat=True),
    Asset("teapot", Box(0.220, 0.135), 0.150, 0.70, 0.4, (0.36, 0.55, 0.60), "storage:teapot", bulging=True),
    Asset("banana", Box(0.180, 0.062), 0.036, 0.12, 0.5, (0.95, 0.80, 0.24), "tableware:banana"),
    Asset("orange", Circle(0.040), 0.080, 0.20, 0.5, (0.93, 0.52, 0.12), "tableware:orange",
          RoundSolid(((0.0, 0.016), (0.014, 0.033), (0.037, 0.040), (0.060, 0.033), (0.080, 0.014)))),
    Asset("lemon", Box(0.090, 0.058), 0.058, 0.10, 0.5, (0.95, 0.85, 0.25), "tableware:lemon"),
    Asset("laptop", Box(0.312, 0.330), 0.224, 1.40, 0.5, (0.66, 0.68, 0.71), "tableware:laptop", bulging=True),
    Asset("keyboard", Box(0.135, 0.430), 0.023, 0.60, 0.6, (0.23, 0.25, 0.29), "tableware:keyboard"),
    Asset("mouse", Box(0.115, 0.062), 0.038, 0.09, 0.4, (0.30, 0.32, 0.36), "tableware:mouse", bulging=True),
    Asset("phone", Box(0.150, 0.073), 0.009, 0.18, 0.5, (0.16, 0.18, 0.24), "tableware:phone", flat=True),
    Asset("remote", Box(0.190, 0.046), 0.020, 0.11, 0.5, (0.20, 0.20, 0.22), "tableware:remote"),
    Asset("stapler", Box(0.150, 0.038), 0.058, 0.25, 0.5, (0.70, 0.18, 0.22), "tableware:stapler"),
    Asset("pen", Box(0.145, 0.013), 0.014, 0.012, 0.4, (0.16, 0.30, 0.62), "tableware:pen"),
    Asset("marker", Box(0.135, 0.020), 0.020, 0.018, 0.4, (0.22, 0.60, 0.35), "tableware:marker"),
    Asset("scissors", Box(0.180, 0.084), 0.0125, 0.080, 0.4, (0.85, 0.40, 0.14), "tableware:scissors"),
    Asset("shelfunit", Box(0.260, 0.640), 0.640, 7.50, 0.5, (0.72, 0.55, 0.36), "storage:shelfunit",
          ShelfUnit(0.260, 0.640, (0.018, 0.240, 0.450, 0.640))),
    Asset("basket", Circle(0.150), 0.080, 0.60, 0.5, (0.70, 0.50, 0.28), "storage:basket",
          Vessel(((0.0, 0.150, 0.0), (0.012, 0.150, 0.0), (0.012, 0.150, 0.144), (0.080, 0.150, 0.144)))),
    Asset("pot", Circle(0.110), 0.110, 1.20, 0.4, (0.36, 0.38, 0.42), "storage:pot",
          Vessel(((0.0, 0.110, 0.0), (0.008, 0.110, 0.0), (0.008, 0.110, 0.104), (0.110, 0.110, 0.104))),
          rim=Circle(0.006)),
    Asset("cabinet", Box(0.360, 0.440), 0.350, 7.80, 0.5, (0.36, 0.47, 0.50), "storage:cabinet", Cabinet()),
    Asset("drawer", Box(0.334, 0.434), 0.094, 1.60, 0.5, (0.74, 0.60, 0.42), "storage:drawer", Drawer()),
    Asset("rack", Box(0.234, 0.322), 0.290, 1.10, 0.5, (0.70, 0.50, 0.30), "storage:rack", Rack()),
    Asset("bin", Box(0.240, 0.200), 0.130, 0.35, 0.4, (0.20, 0.46, 0.66), "storage:bin",
          Crate(0.240, 0.200, 0.130, 0.008, 0.008)),
    Asset("stand", Circle(0.115), 0.140, 0.90, 0.5, (0.90, 0.86, 0.78), "storage:stand",
          RoundSolid(((0.0, 0.075), (0.012, 0.070), (0.012, 0.022), (0.122, 0.022), (0.122, 0.085), (0.130, 0.115),
          (0.140, 0.115))), top=Circle(0.108)),
    Asset("lid", Circle(0.112), 0.048, 0.40, 0.4, (0.42, 0.44, 0.48), "storage:lid",
          RoundSolid(((0.0, 0.112), (0.008, 0.112), (0.022, 0.060), (0.048, 0.018)))),
    Asset("block", Box(0.050, 0.050), 0.050, 0.08, 0.5, (0.88, 0.38, 0.16), "tableware:block", flat=True),
)}
# fmt: on

ALIASES = {"box": "carton", "cuttingboard": "board", "cellphone": "phone", "smartphone": "phone", "pencil": "pen"}


def stem(name: str) -> str:
    """`block` for `block[3]`, `block3` and `block_3`; other names are their own stem."""
    return re.sub(r"(\[\d+\]|_?\d+)$", "", name)


def known_as(name: str) -> str | None:
    """The asset that a name stands for; `box` is one too, whereas the shape `box(...)` has sizes of its own."""
    plain = stem(name).lower().replace("_", "")
    return next((word for word in (name, stem(name), plain, ALIASES.get(plain)) if word in ASSETS), None)


def asset_of(name: str) -> Asset:
    """The asset an object's name picks; the `block` of the library where the name is not in it."""
    return ASSETS[known_as(name) or UNKNOWN]


def has_picture(name: str) -> bool:
    """Whether the library knows an object of that name; others are drawn as blocks."""
    return known_as(name) is not None


def meant_by(name: str) -> str | None:
    """The library's object that a name most likely means, which the library does not know: a misspelt one, or one with
    more words (`red_mug`). None for names that are far from all."""
    if has_picture(name):
        return None
    plain = stem(name).replace("_", "").lower()
    known = [one for one in (*ASSETS, *ALIASES) if one != UNKNOWN]
    found = next((one for one in known if _is_typo(plain, one)), None)
    if found is None:
        words = [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", stem(name))]
        if len(words) < 2 or words[-1] == UNKNOWN:  # of `knife_block` the last word says what it is
            return None
        found = next((word for word in reversed(words) if word in known), None)
    return ALIASES.get(found, found) if found is not None else None


def _is_typo(written: str, word: str) -> bool:
    """Whether a word is likely misspelt: a letter more or less, two swapped, or a wrong one, but none of four letters
    and not the first of a short word, where both are often words (`house`, `mouse`); of more than eight letters two."""
    if len(written) == len(word):
        wrong = [at for at, (a, b) in enumerate(zip(written, word, strict=True)) if a != b]
        swapped = len(wrong) == 2 and wrong[1] == wrong[0] + 1 and sorted(written) == sorted(word)
        return swapped or (len(wrong) == 1 and (len(word) > 6 or (len(word) > 4 and wrong[0] > 0)))
    short, long = sorted((written, word), key=len)
    if len(long) == len(short) + 1 and any(long[:at] + long[at + 1 :] == short for at in range(len(long))):
        return len(word) > 3 or written == f"{word}s"
    return (
        len(word) > 8
        and len(long) == len(short) + 2
        and any(
            long[:at] + long[at + 1 : then] + long[then + 1 :] == short
            for at in range(len(long))
            for then in range(at + 1, len(long))
        )
    )


def shape_of(name: str) -> Shape:
    """The shape that an object's name picks."""
    asset = asset_of(name)
    return Shape(asset.name, asset.footprint, asset.height)


def own_size(shape: Shape) -> tuple[float, float, float]:
    """Length, width and height of the library's object that a shape is, before it is stretched; metres."""
    if shape.open:
        made = Cabinet(shape.open)
        return made.length, CABINET_WIDTH, made.height
    asset = ASSETS.get(shape.asset, ASSETS[UNKNOWN])
    return *asset.footprint.extent, asset.height


def entry_of(shape: Shape) -> Asset | None:
    """The entry of the library that a shape is, perhaps stretched; None for shapes with sizes of their own."""
    if shape.asset in PLAIN or isinstance(shape.footprint, Polygon):
        return None
    return ASSETS.get(shape.asset)


def stretch_of(shape: Shape) -> tuple[float, float, float]:
    """How much longer, wider and higher an object is than the library's; 1 for shapes with sizes of their own."""
    if entry_of(shape) is None:
        return 1.0, 1.0, 1.0
    (length, width), (own_length, own_width, own_height) = shape.footprint.extent, own_size(shape)
    return length / own_length, width / own_width, shape.height / own_height


def cabinet_shape(open: tuple[float, ...]) -> Shape:
    """A cabinet with one drawer for each share, the lowest first."""
    made = Cabinet(open)
    return Shape("cabinet", Box(made.length, CABINET_WIDTH), made.height, open=open)
