"""What things are kept in: cabinets with drawers, single drawers, bottle racks, bins."""

from __future__ import annotations

from scenegen.assets.cabinet import (
    BAR,
    BODY,
    CLOSED,
    FLOOR,
    FRONT,
    FULL,
    GRIP,
    HANDLE,
    PITCH,
    PLINTH,
    SEAM,
    SIDE,
    SUNK,
    TOP,
    WALL,
    WIDTH,
    Cabinet,
    Drawer,
)
from scenegen.assets.hollow import Crate
from scenegen.assets.kitchen import crate_of, frame
from scenegen.assets.mesh import Mesh, box, disc, joined, prism
from scenegen.assets.palette import RGB, mix
from scenegen.assets.parts import CREAM, DARK, WHITE, Part
from scenegen.assets.rack import BAR as THICK
from scenegen.assets.rack import FLOOR as BASE
from scenegen.assets.rack import LOW, POST, RIM, Rack
from scenegen.assets.rack import WALL as BOARD

OAK: RGB = (0.70, 0.50, 0.31)
PALE: RGB = (0.88, 0.79, 0.64)  # the wood of drawers
BRASS: RGB = (0.78, 0.60, 0.30)
BOARDS = 0.018  # how thick a cabinet's sides are


def _block(x0: float, y0: float, x1: float, y1: float, z0: float, z1: float, bevel: float = 0.0) -> Mesh:
    return box(x1 - x0, y1 - y0, z1 - z0, bevel).moved((x0 + x1) / 2.0, (y0 + y1) / 2.0, z0)


def _handle(front: float, low: float) -> Mesh:
    """A round bar on two feet, from a drawer's front at x = `front` outwards."""
    radius = (HANDLE[1] - HANDLE[0]) / 2.0
    middle, x = low + HANDLE[0] + radius, front + GRIP - radius
    bar = disc(radius, -BAR / 2.0, BAR / 2.0, 16).tipped().moved(x=x, z=middle)
    feet = [_block(front, y - 0.004, x, y + 0.004, middle - 0.004, middle + 0.004) for y in (-BAR * 0.36, BAR * 0.36)]
    return joined([bar, *feet])


def _tray(back: float, front: float, low: float) -> tuple[Mesh, Mesh]:
    """A drawer without its front, between two x: its walls, and its floor."""
    y = WIDTH / 2.0 - BOARDS - WALL
    walls = [_block(back, side, front, side + WALL, low, low + SIDE) for side in (-y - WALL, y)]
    walls.append(_block(back, -y, back + WALL, y, low, low + SIDE))
    return joined(walls), _block(back + WALL, -y, front, y, low, low + FLOOR)


def cabinet(color: RGB, open: tuple[float, ...] = CLOSED) -> tuple[Part, ...]:
    """With a top of oak, painted fronts, and drawers of pale wood in those that are open."""
    made = Cabinet(open)
    back, y, high = made.back, WIDTH / 2.0, made.height - TOP
    inner = y - BOARDS
    body = back + BODY
    case = [_block(back, side, body, side + BOARDS, 0.0, high) for side in (-y, inner)]
    case.append(_block(back, -inner, back + 0.008, inner, 0.0, high))
    foot = _block(body - 0.040, -inner, body - 0.024, inner, 0.0, PLINTH)
    rails = [
        _block(back + 0.008, -inner, body - 0.002, inner, z - SEAM, z + SEAM)
        for z in (PLINTH + number * PITCH for number in range(len(open)))
    ]
    fronts, handles, walls, floors = [], [], [], []
    for number, front in enumerate(made.fronts()):
        low = PLINTH + number * PITCH
        fronts.append(_block(front, SEAM - y, front + FRONT, y - SEAM, low + SEAM, low + PITCH - SEAM, 0.002))
        fronts.append(_panel(front + FRONT, low))
        handles.append(_handle(front + FRONT, low))
        if open[number] > 0.0:
            sides, floor = _tray(front - FULL, front, low + SUNK)
            walls.append(sides)
            floors.append(floor)
    drawers = (Part(joined(walls), PALE), Part(joined(floors), mix(PALE, WHITE, 0.30))) if walls else ()
    return (
        Part(joined(case), color),
        Part(_block(back, -y, body + FRONT, y, high, made.height, 0.003), OAK),
        Part(joined([foot, *rails]), mix(color, DARK, 0.55)),
        Part(joined(fronts), mix(color, WHITE, 0.14)),
        Part(joined(handles), BRASS),
        *drawers,
    )


def _panel(front: float, low: float) -> Mesh:
    """The raised frame on a drawer's front, thinner than a sheet of card."""
    y, z0, z1, wide = WIDTH / 2.0 - SEAM - 0.004, low + SEAM + 0.004, low + PITCH - SEAM - 0.004, 0.014
    x = front + 0.0016
    bars = [_block(front - 0.001, -y, x, y, z, z + wide) for z in (z0, z1 - wide)]
    bars += [_block(front - 0.001, side, x, side + wide, z0 + wide, z1 - wide) for side in (-y, y - wide)]
    return joined(bars)


def drawer(color: RGB) -> tuple[Part, ...]:
    made = Drawer()
    back, front, y = -made.length / 2.0, made.length / 2.0 - GRIP - FRONT, made.width / 2.0
    walls, floor = _tray(back, front, 0.0)
    panel = _block(front, -y, front + FRONT, y, 0.0, made.height, 0.002)
    return (
        Part(walls, mix(color, PALE, 0.45)),
        Part(floor, mix(mix(color, PALE, 0.45), WHITE, 0.30)),
        Part(joined([panel, _panel(front + FRONT, -SEAM)]), color),
        Part(_handle(front + FRONT, 0.0), BRASS),
    )


def rack(color: RGB) -> tuple[Part, ...]:
    made = Rack()
    x, y = made.length / 2.0, made.width / 2.0
    floor, *boards = made.slabs()
    upright = [one for one in boards if one.high in (RIM, LOW)]
    sides, inside = ([_block(*one.box, BASE, one.high) for one in upright if one.high == high] for high in (RIM, LOW))
    posts = []
    for end in (-y, y - BOARD):
        arch = [(-POST / 2.0, RIM), (POST / 2.0, RIM), (POST / 2.0, made.height - 0.014)]
        arch += [(0.012, made.height), (-0.012, made.height), (-POST / 2.0, made.height - 0.014)]
        posts.append(prism([(u, -z) for u, z in reversed(arch)], end, end + BOARD))
    turned = [Mesh(one.vertices[:, [0, 2, 1]] * (1.0, 1.0, -1.0), one.faces) for one in posts]
    bar = disc(THICK / 2.0, BOARD - y, y - BOARD, 20).tipped().moved(z=made.height - 0.006 - THICK / 2.0)
    plate = prism([(-0.055, 0.038), (0.055, 0.038), (0.055, 0.072), (-0.055, 0.072)], 0.0, 0.0012)
    label = Mesh(plate.vertices[:, [2, 0, 1]] * (1.0, 1.0, 1.0), plate.faces).moved(x=x - 0.0012)
    return (
        Part(_block(*floor.box, 0.0, BASE), mix(color, DARK, 0.22)),
        Part(joined([*(one for one in sides)]), color),
        Part(joined(inside), mix(color, WHITE, 0.18)),
        Part(joined([_outwards(one) for one in turned]), mix(color, DARK, 0.10)),
        Part(bar, mix(color, DARK, 0.35)),
        Part(_outwards(label), mix(color, CREAM, 0.75)),
    )


def _outwards(mesh: Mesh) -> Mesh:
    return mesh if mesh.volume > 0.0 else Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())


def bin(color: RGB) -> tuple[Part, ...]:
    crate = crate_of("bin")
    slim = Crate(crate.length - 0.006, crate.width - 0.006, crate.height, 0.005, crate.floor)
    rim = frame(crate, 0.0, crate.height - 0.012, crate.height, crate.wall)
    lining = frame(slim, slim.wall, slim.floor, crate.height - 0.012, 0.0006)
    floor = box(slim.length - 0.002, slim.width - 0.002, slim.floor)
    x = crate.length / 2.0
    label = _block(x - 0.0032, -0.050, x - 0.0018, 0.050, 0.044, 0.092)
    lines = [_block(x - 0.0020, -0.036, x - 0.0012, end, z, z + 0.005) for z, end in ((0.074, 0.036), (0.058, 0.012))]
    slots = [_block(-0.034, s * 0.0966 - 0.0006, 0.034, s * 0.0966 + 0.0006, 0.092, 0.108) for s in (-1.0, 1.0)]
    return (
        Part(frame(slim, 0.0, 0.0, crate.height - 0.010, slim.wall), color),
        Part(rim, mix(color, WHITE, 0.14)),
        Part(lining, mix(color, DARK, 0.22)),
        Part(floor, mix(color, DARK, 0.12)),
        Part(label, CREAM),
        Part(joined(lines), mix(color, DARK, 0.50)),
        Part(joined(slots), mix(color, DARK, 0.62)),
    )
