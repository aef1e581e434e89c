"""What things are kept in: cabinets with drawers, single drawers, bottle racks, bins."""

from __future__ import annotations

import math

import numpy as np

from scenegen.things.furniture import (
    BAR,
    BASE,
    BOARD,
    CABINET_DEPTH,
    CABINET_WIDTH,
    CLOSED,
    DRAWER_FRONT,
    FLOOR,
    HANDLE,
    HANDLE_DEPTH,
    LOW,
    MAX_PULL,
    PITCH,
    PLINTH,
    POST,
    RIM,
    SEAM,
    SIDE,
    SUNK,
    THICK,
    TOP,
    WALL,
    Cabinet,
    Crate,
    Drawer,
    Rack,
    ShelfUnit,
    Slab,
)
from scenegen.things.library import ASSETS, RGB
from scenegen.things.mesh import (
    CHINA,
    CREAM,
    SOOT,
    STEEL,
    Mesh,
    Part,
    box,
    crescent,
    disc,
    join,
    lining,
    loft,
    patch,
    prism,
    revolve,
    tube,
)
from scenegen.things.palette import mix


def crate_of(name: str) -> Crate:
    """The library's crate of that name."""
    found = ASSETS[name].form
    assert isinstance(found, Crate)
    return found


def frame(crate: Crate, inset: float, low: float, high: float, thick: float) -> Mesh:
    """A rectangular ring of four bars inside the outline of a crate."""
    long, wide = crate.length - 2.0 * inset, crate.width - 2.0 * inset
    side, end = box(long, thick, high - low), box(thick, wide - 2.0 * thick, high - low)
    y, x = (wide - thick) / 2.0, (long - thick) / 2.0
    bars = [side.shift(y=s * y, z=low) for s in (-1.0, 1.0)] + [end.shift(x=s * x, z=low) for s in (-1.0, 1.0)]
    return join(bars)


def tray(color: RGB) -> tuple[Part, ...]:
    crate = crate_of("tray")
    floor = box(crate.length - 0.004, crate.width - 0.004, crate.floor)
    inlay = box(crate.length - 0.05, crate.width - 0.05, 0.0006).shift(z=crate.floor)
    stripes = [
        box(wide, crate.width - 0.05, 0.0012).shift(x=x, z=crate.floor) for x, wide in ((0.135, 0.012), (0.150, 0.004))
    ]
    slots = [box(0.0125, 0.090, 0.012).shift(x=s * 0.19365, z=0.024) for s in (-1.0, 1.0)]
    return (
        Part(floor, mix(color, CHINA, 0.12)),
        Part(frame(crate, 0.0, 0.0, crate.height, crate.wall), color),
        Part(inlay, mix(color, CHINA, 0.30)),
        Part(join(slots), mix(color, SOOT, 0.65)),
        Part(join(stripes), mix(color, CHINA, 0.75)),
    )


def carton(color: RGB) -> tuple[Part, ...]:
    crate = crate_of("carton")
    outside = frame(crate, 0.0, 0.0, crate.height, crate.wall)
    floor = box(crate.length - 0.002, crate.width - 0.002, crate.floor)
    lining = frame(crate, crate.wall, crate.floor, crate.height - 0.002, 0.0006)
    tape = box(0.0010, 0.050, 0.062).shift(x=crate.length / 2.0 - 0.0005, z=crate.height - 0.064)
    arrows = [_upright_arrow(y).shift(x=crate.length / 2.0 - 0.0011) for y in (-0.055, 0.055)]
    seam = box(crate.length - 0.02, 0.046, 0.0006).shift(z=crate.floor)
    return (
        Part(outside, color),
        Part(floor, mix(color, SOOT, 0.10)),
        Part(lining, mix(color, SOOT, 0.28)),
        Part(tape, mix(color, CREAM, 0.70)),
        Part(join(arrows), mix(color, SOOT, 0.60)),
        Part(seam, mix(color, CREAM, 0.45)),
    )


def _upright_arrow(y: float) -> Mesh:
    """ "This side up" on the front of a carton."""
    head = loft([[[x, y - 0.018, 0.075], [x, y + 0.018, 0.075], [x, y, 0.105]] for x in (0.0, 0.0011)])
    return join([head, box(0.0011, 0.012, 0.040).shift(x=0.00055, y=y, z=0.036)])


def board(color: RGB) -> tuple[Part, ...]:
    slab = box(0.340, 0.220, 0.0176, 0.003)
    strips = [box(0.334, 0.026, 0.0004).shift(y=y, z=0.0174) for y in (-0.072, 0.0, 0.072)]
    hole = disc(0.014, 0.0172, 0.0180, 28).shift(x=0.140)
    ring = revolve([(0.014, 0.0172), (0.018, 0.0172), (0.018, 0.0178), (0.014, 0.0178)], 28).shift(x=0.140)
    return (
        Part(slab, color),
        Part(join(strips), mix(color, CREAM, 0.22)),
        Part(ring, mix(color, SOOT, 0.35)),
        Part(hole, mix(color, SOOT, 0.80)),
    )


def teapot(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [
            (0.0, 0.0), (0.040, 0.0), (0.044, 0.004), (0.058, 0.022), (0.066, 0.048), (0.065, 0.070), (0.055, 0.094),
            (0.038, 0.110), (0.034, 0.114), (0.0, 0.114),
        ],
        56,
    ).shift(x=-0.002)  # fmt: skip
    lid = revolve(
        [(0.0, 0.112), (0.036, 0.112), (0.036, 0.117), (0.028, 0.124), (0.012, 0.130), (0.0, 0.131)], 40
    ).shift(x=-0.002)
    knob = revolve([(0.0, 0.128), (0.006, 0.130), (0.010, 0.139), (0.008, 0.147), (0.0, 0.150)], 24).shift(x=-0.002)
    turns = np.linspace(0.0, 1.0, 9)
    line = [(0.050 + 0.052 * s, 0.038 + 0.066 * s**1.4 + 0.006 * math.sin(math.pi * s)) for s in turns]
    spout = _taper(line, 0.0165, 0.0075)
    bow = [0.5 * math.pi + math.pi * s for s in np.linspace(0.04, 0.96, 13)]
    grip = tube([(-0.058 + 0.047 * math.cos(a), 0.064 + 0.034 * math.sin(a)) for a in bow], 0.0075, 0.0050, 10)
    band = revolve([(0.0665, 0.050), (0.0672, 0.052), (0.0672, 0.058), (0.0662, 0.060)], 56).shift(x=-0.002)
    pale = mix(color, CHINA, 0.75)
    return (
        Part(body, color),
        Part(lid, mix(color, SOOT, 0.12)),
        Part(knob, STEEL),
        Part(spout, color),
        Part(grip, mix(color, SOOT, 0.12)),
        Part(band, pale),
    )


def _taper(line: list[tuple[float, float]], first: float, last: float) -> Mesh:
    """A round spout along (x, z) points in the plane y = 0, its radius falling from `first` to `last`."""
    points = np.array(line)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    turn = np.linspace(0.0, math.tau, 14, endpoint=False)
    radii = np.linspace(first, last, len(points))
    return loft(
        [
            np.column_stack([x - tz * r * np.cos(turn), r * np.sin(turn), z + tx * r * np.cos(turn)])
            for (x, z), (tx, tz), r in zip(points, tangent, radii, strict=True)
        ]
    )


OAK: RGB = (0.70, 0.50, 0.31)
PALE: RGB = (0.88, 0.79, 0.64)  # the wood of drawers
BRASS: RGB = (0.78, 0.60, 0.30)
BOARDS = 0.018  # how thick a cabinet's sides are


def _block(x0: float, y0: float, x1: float, y1: float, z0: float, z1: float, bevel: float = 0.0) -> Mesh:
    return box(x1 - x0, y1 - y0, z1 - z0, bevel).shift((x0 + x1) / 2.0, (y0 + y1) / 2.0, z0)


def _handle(front: float, low: float) -> Mesh:
    """A round bar on two feet, from a drawer's front at x = `front` outwards."""
    radius = (HANDLE[1] - HANDLE[0]) / 2.0
    middle, x = low + HANDLE[0] + radius, front + HANDLE_DEPTH - radius
    bar = disc(radius, -BAR / 2.0, BAR / 2.0, 16).tip().shift(x=x, z=middle)
    feet = [_block(front, y - 0.004, x, y + 0.004, middle - 0.004, middle + 0.004) for y in (-BAR * 0.36, BAR * 0.36)]
    return join([bar, *feet])


def _tray(back: float, front: float, low: float) -> tuple[Mesh, Mesh]:
    """A drawer without its front, between two x: its walls, and its floor."""
    y = CABINET_WIDTH / 2.0 - BOARDS - WALL
    walls = [_block(back, side, front, side + WALL, low, low + SIDE) for side in (-y - WALL, y)]
    walls.append(_block(back, -y, back + WALL, y, low, low + SIDE))
    return join(walls), _block(back + WALL, -y, front, y, low, low + FLOOR)


def cabinet(color: RGB, open: tuple[float, ...] = CLOSED) -> tuple[Part, ...]:
    """With a top of oak, painted fronts, and drawers of pale wood in those that are open."""
    made = Cabinet(open)
    back, y, high = made.back, CABINET_WIDTH / 2.0, made.height - TOP
    inner = y - BOARDS
    body = back + CABINET_DEPTH
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
        fronts.append(_block(front, SEAM - y, front + DRAWER_FRONT, y - SEAM, low + SEAM, low + PITCH - SEAM, 0.002))
        fronts.append(_panel(front + DRAWER_FRONT, low))
        handles.append(_handle(front + DRAWER_FRONT, low))
        if open[number] > 0.0:
            sides, floor = _tray(front - MAX_PULL, front, low + SUNK)
            walls.append(sides)
            floors.append(floor)
    drawers = (Part(join(walls), PALE), Part(join(floors), mix(PALE, CHINA, 0.30))) if walls else ()
    return (
        Part(join(case), color),
        Part(_block(back, -y, body + DRAWER_FRONT, y, high, made.height, 0.003), OAK),
        Part(join([foot, *rails]), mix(color, SOOT, 0.55)),
        Part(join(fronts), mix(color, CHINA, 0.14)),
        Part(join(handles), BRASS),
        *drawers,
    )


def _panel(front: float, low: float) -> Mesh:
    """The raised frame on a drawer's front, thinner than a sheet of card."""
    y, z0, z1, wide = CABINET_WIDTH / 2.0 - SEAM - 0.004, low + SEAM + 0.004, low + PITCH - SEAM - 0.004, 0.014
    x = front + 0.0016
    bars = [_block(front - 0.001, -y, x, y, z, z + wide) for z in (z0, z1 - wide)]
    bars += [_block(front - 0.001, side, x, side + wide, z0 + wide, z1 - wide) for side in (-y, y - wide)]
    return join(bars)


def drawer(color: RGB) -> tuple[Part, ...]:
    made = Drawer()
    back, front, y = -made.length / 2.0, made.length / 2.0 - HANDLE_DEPTH - DRAWER_FRONT, made.width / 2.0
    walls, floor = _tray(back, front, 0.0)
    panel = _block(front, -y, front + DRAWER_FRONT, y, 0.0, made.height, 0.002)
    return (
        Part(walls, mix(color, PALE, 0.45)),
        Part(floor, mix(mix(color, PALE, 0.45), CHINA, 0.30)),
        Part(join([panel, _panel(front + DRAWER_FRONT, -SEAM)]), color),
        Part(_handle(front + DRAWER_FRONT, 0.0), BRASS),
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
    bar = disc(THICK / 2.0, BOARD - y, y - BOARD, 20).tip().shift(z=made.height - 0.006 - THICK / 2.0)
    plate = prism([(-0.055, 0.038), (0.055, 0.038), (0.055, 0.072), (-0.055, 0.072)], 0.0, 0.0012)
    label = Mesh(plate.vertices[:, [2, 0, 1]] * (1.0, 1.0, 1.0), plate.faces).shift(x=x - 0.0012)
    return (
        Part(_block(*floor.box, 0.0, BASE), mix(color, SOOT, 0.22)),
        Part(join([*(one for one in sides)]), color),
        Part(join(inside), mix(color, CHINA, 0.18)),
        Part(join([_outwards(one) for one in turned]), mix(color, SOOT, 0.10)),
        Part(bar, mix(color, SOOT, 0.35)),
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
        Part(rim, mix(color, CHINA, 0.14)),
        Part(lining, mix(color, SOOT, 0.22)),
        Part(floor, mix(color, SOOT, 0.12)),
        Part(label, CREAM),
        Part(join(lines), mix(color, SOOT, 0.50)),
        Part(join(slots), mix(color, SOOT, 0.62)),
    )


BOARD_OVERLAP = 0.0004  # metres by which boards reach into the sides, so that no line of the table shows


def _slab(one: Slab) -> tuple[float, float, float, float, float, float]:
    x0, y0, x1, y1 = one.box
    return x1 - x0, y1 - y0, one.high - one.low, (x0 + x1) / 2.0, (y0 + y1) / 2.0, one.low


def shelfunit(color: RGB) -> tuple[Part, ...]:
    unit = ASSETS["shelfunit"].form
    assert isinstance(unit, ShelfUnit)
    left, right, back, *boards = unit.slabs()
    made = []
    for group, shade in (((left, right), color), ((back,), mix(color, SOOT, 0.18)), (boards, mix(color, CHINA, 0.16))):
        grown = BOARD_OVERLAP if group is boards else 0.0
        meshes = []
        for length, width, height, x, y, z in map(_slab, group):
            meshes.append(box(length, width + grown, height).shift(x=x, y=y, z=z))
        made.append(Part(join(meshes), shade))
    return tuple(made)


def basket(color: RGB) -> tuple[Part, ...]:
    inside = [(0.0, 0.012), (0.144, 0.012), (0.144, 0.079)]
    body = revolve([(0.0, 0.0), (0.149, 0.0), (0.150, 0.004), (0.150, 0.080), (0.145, 0.080), *reversed(inside)], 64)
    bands = [revolve([(0.1495, z), (0.1500, z), (0.1500, z + 0.010), (0.1495, z + 0.010)], 64) for z in (0.018, 0.048)]
    return (
        Part(body, color),
        Part(lining(inside), mix(color, CHINA, 0.35)),
        Part(join(bands), mix(color, SOOT, 0.30)),
        Part(crescent([(0.1435, 0.0745), (0.1435, 0.0300)], 1.8), mix(color, SOOT, 0.35)),
    )


def pot(color: RGB) -> tuple[Part, ...]:
    inside = [(0.0, 0.008), (0.104, 0.008), (0.104, 0.109)]
    body = revolve([(0.0, 0.0), (0.106, 0.0), (0.110, 0.005), (0.110, 0.110), (0.105, 0.110), *reversed(inside)], 64)
    mark = crescent([(0.1035, 0.1040), (0.1035, 0.0500)], 1.8)
    return Part(body, color), Part(lining(inside), mix(color, CHINA, 0.45)), Part(mark, color)


def lid(color: RGB) -> tuple[Part, ...]:
    dome = revolve(
        [
            (0.0, 0.0), (0.111, 0.0), (0.112, 0.002), (0.112, 0.005), (0.109, 0.008), (0.085, 0.014), (0.050, 0.020),
            (0.018, 0.0235), (0.0, 0.0235),
        ],
        64,
    )  # fmt: skip
    knob = revolve([(0.0, 0.020), (0.008, 0.022), (0.008, 0.033), (0.017, 0.039), (0.016, 0.046), (0.0, 0.048)], 32)
    ring = revolve([(0.104, 0.0070), (0.1085, 0.0062), (0.1085, 0.0085), (0.104, 0.0098)], 64)
    vent = disc(0.0055, 0.0140, 0.0178, 18).shift(x=0.070)
    return Part(dome, color), Part(knob, SOOT), Part(ring, mix(color, STEEL, 0.55)), Part(vent, mix(color, SOOT, 0.85))


def stand(color: RGB) -> tuple[Part, ...]:
    body = revolve(
        [
            (0.0, 0.0), (0.074, 0.0), (0.075, 0.004), (0.071, 0.010), (0.046, 0.017), (0.026, 0.030), (0.0175, 0.052),
            (0.0165, 0.080), (0.021, 0.102), (0.036, 0.116), (0.070, 0.1225), (0.112, 0.126), (0.115, 0.129),
            (0.115, 0.1375), (0.113, 0.1394), (0.0, 0.1394),
        ],
        64,
    )  # fmt: skip
    ring = revolve([(0.092, 0.1380), (0.1005, 0.1380), (0.1005, 0.1400), (0.092, 0.1400)], 64)
    mark = patch(0.1005, 0.0160, 0.1385, 0.1399, 0.34)
    ink = mix(color, SOOT, 0.40)
    return Part(body, color), Part(ring, mix(color, SOOT, 0.28)), Part(mark, ink)
