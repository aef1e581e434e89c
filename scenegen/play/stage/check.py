"""What really stands on the table, held against the start that was asked for: errors of objects, phi, its band, and
which object to move by how much where it is another.

Moves are tried, not extrapolated: of each object along its gradient of phi, back to its place and in directions
between, and turns. The shortest after which phi is in the band, and all that the spec requires holds, is the advice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet
from scenegen.api.scenes import evaluate as evaluate_scenes
from scenegen.arrays import Array
from scenegen.geometry import NUMPY
from scenegen.geometry.footprint import measures
from scenegen.lang.formula.core import REQUIRE, Atom, gate
from scenegen.lang.formula.interpret import deciding_atom, evaluate
from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.suite import BandData, GradedStart, SuiteTask
from scenegen.pose import PLACE, THETA, TWO_PI, as_rows, rows_along, wrap_heading

MOVE_STEP, MOST_MOVE = 0.0025, 0.12  # metres
MOVE_TURN = math.radians(2.5)
MOVE_DIRECTIONS = 16
BAND_INSET = 0.1  # of a band's width: how far inside of it an advised move ends, where one does
SLOPE_DISTANCE = 1e-5  # metres and radians: of differences
HELD_OFF = 0.005, math.radians(3.0)  # what objects may be off that the spec holds in place: phi takes them for there


@dataclass(frozen=True, slots=True)
class StageMove:
    """Move an object by (x, y) metres, turn it by so many radians; `phi` is then that of the start's label."""

    name: str
    x: float
    y: float
    turn: float
    phi: float

    def __str__(self) -> str:
        words = [f"move {self.name} {describe_shift(self.x, self.y)}"] if self.x or self.y else []
        if self.turn:
            way = "left" if self.turn > 0.0 else "right"
            words.append(f"turn {self.name} {abs(math.degrees(self.turn)):.0f} deg to the {way}")
        return " and ".join(words)


@dataclass(frozen=True, slots=True, eq=False)
class StageCheck:
    """A start, where its objects stand, (N, 3), and by how much each is off, (N, 3); phi there, the name of its band
    (None: of none), what the spec requires and does not hold, and what to move where it is not `ok`."""

    start: GradedStart
    poses: Array
    off: Array
    phi: float
    band: str | None
    broken: str | None
    move: StageMove | None

    @property
    def ok(self) -> bool:
        return self.band == self.start.band and self.broken is None and self.move is None

    def lines(self, stage: TableStage) -> list[str]:
        """What a person reads: a line for each object, and the judgement."""
        start, spec = self.start, self.start.task.spec.checked
        said = [f"episode {start.number}: {start.task.name}, {start.band}"]
        for which, name in enumerate(start.objects):
            x, y, turn = self.off[which].tolist()
            turned = "" if stage.thing(spec, which).is_round else f", turned {round(math.degrees(turn)):+d} deg"
            place = stage.name_place(*self.poses[which, :2].tolist())
            said.append(f"  {name}: {place}; off by {100.0 * math.hypot(x, y):.1f} cm ({describe_shift(x, y)}){turned}")
        wanted = _band_of(start)
        found = "in no band" if self.band is None else f"in {self.band}"
        judgement = f"phi {self.phi:.4f} is {found}"
        if self.band != start.band:
            judgement += ", not in {} ({:g} to {:g})".format(start.band, *wanted.phi)
        if self.broken is not None:
            judgement += f"; {self.broken}"
        if self.move is not None:
            judgement += f"; {self.move}: phi is then {self.move.phi:.4f}"
        return [*said, judgement if not self.ok else f"{judgement}: ok"]


def check_poses(start: GradedStart, poses: Array) -> StageCheck:
    """Hold poses (N, 3) of the objects of a start against it."""
    wanted = start.task.scenes.poses[start.row]
    off = poses - wanted
    off[:, THETA] = np.remainder(off[:, THETA] + math.pi, TWO_PI) - math.pi
    phi, required = margins_at(start, poses[None])
    band = band_at(start.task, float(phi[0]))
    broken = _describe_broken(start, poses) if required[0] < 0.0 else None
    move = _move_held(start, off, float(phi[0]))
    if move is None and (band != start.band or broken is not None):
        move = _find_move(start, poses, off)
    return StageCheck(start, poses, off, float(phi[0]), band, broken, move)


def scene_of(found: StageCheck) -> SceneSet:
    """What stands there, as a set of one scene."""
    task = found.start.task
    on = None if found.start.on is None else found.start.on[None]
    bare = SceneSet(found.poses[None], {}, task.scenes.header, on=on, trusted=True)
    return replace(bare, phi=evaluate_scenes(task.spec.checked, bare))


def margins_at(start: GradedStart, poses: Array) -> tuple[Array, Array]:
    """phi of success (B,), and of what the task's spec requires (B,), where the objects of a start stand at poses
    (B, N, 3)."""
    spec = start.task.spec.checked
    core = gate(spec.core)
    values = evaluate(core, list(_rows(start, poses)), NUMPY)
    phi, required = (np.broadcast_to(values[core.labels[one]], len(poses)) for one in (start.task.success, REQUIRE))
    return phi, required


def band_at(task: SuiteTask, phi: float) -> str | None:
    """The name of the band of a task that has a phi, None where none has it."""
    return next((band.name for band in task.bands if band.phi[0] <= phi <= band.phi[1]), None)


def describe_shift(x: float, y: float) -> str:
    """A way on the table in words."""
    parts = [
        f"{100.0 * abs(value):.1f} cm {ways[value < 0.0]}"
        for value, ways in ((x, ("right", "left")), (y, ("away", "near")))
        if abs(value) >= 0.0005
    ]
    return ", ".join(parts) or "0.0 cm"


def _rows(start: GradedStart, poses: Array) -> Array:
    """Rows of the core (3M, B) of objects at poses (B, N, 3), on what they stand in the start."""
    task = start.task
    rows = rows_of(task.spec.checked, task.scenes[[start.row]]).repeat(len(poses), axis=1)
    placed = poses.copy()
    placed[..., THETA] = wrap_heading(np, placed[..., THETA])
    rows[: poses.shape[1] * poses.shape[2]] = as_rows(placed)
    return rows


def _describe_broken(start: GradedStart, poses: Array) -> str:
    """The part of what the spec requires that does not hold."""
    core = gate(start.task.spec.checked.core)
    values = evaluate(core, _rows(start, poses[None])[:, 0].tolist())
    atom = core.nodes[deciding_atom(core, REQUIRE, values)]
    assert isinstance(atom, Atom)
    return f"{atom.text} is {values[atom.margin]:.4f}, below 0"


def _band_of(start: GradedStart) -> BandData:
    return next(band for band in start.task.bands if band.name == start.band)


def _move_held(start: GradedStart, off: Array, phi: float) -> StageMove | None:
    """Back to its place what the spec holds there."""
    for which in sorted(start.task.spec.checked.fixed):
        x, y, turn = (-off[which]).tolist()
        if math.hypot(x, y) > HELD_OFF[0] or (
            abs(turn) > HELD_OFF[1] and start.task.spec.checked.shapes[which].asset != "cylinder"
        ):
            return StageMove(start.objects[which], x, y, turn, phi)
    return None


def _find_move(start: GradedStart, poses: Array, off: Array) -> StageMove:
    """The shortest move of one object after which the start is as hard as it should be; the one that is farthest off
    goes back where no move of one is enough."""
    band, spec = _band_of(start), start.task.spec.checked
    free = [which for which in range(len(poses)) if which not in spec.fixed]
    which, moves = _moves(start, poses, off, free)
    there = np.repeat(poses[None], len(moves), axis=0)
    there[np.arange(len(moves)), which] += moves
    phi, required = margins_at(start, there)
    lowest, highest = spec.box()
    outer = np.array([measures(shape.footprint).outer for shape in spec.shapes])
    length = np.hypot(moves[:, 0], moves[:, 1]) + outer[which] * np.abs(moves[:, THETA])
    placed = there[np.arange(len(moves)), which]
    on = np.ones(len(moves), dtype=bool)
    for axis in PLACE:
        rows = np.arange(len(lowest))[rows_along(axis)][which]
        on &= (placed[:, axis] >= lowest[rows]) & (placed[:, axis] <= highest[rows])
    width = band.phi[1] - band.phi[0]
    for inset in (BAND_INSET * width, 0.0):
        good = on & (required >= 0.0) & (phi >= band.phi[0] + inset) & (phi <= band.phi[1] - inset)
        if good.any():
            best = int(np.where(good, length, math.inf).argmin())
            x, y, turn = moves[best].tolist()
            return StageMove(start.objects[which[best]], x, y, turn, float(phi[best]))
    far = max(free, key=lambda one: math.hypot(*off[one, :2]) + outer[one] * abs(off[one, THETA]))
    back = poses.copy()
    back[far] -= off[far]
    x, y, turn = (-off[far]).tolist()
    return StageMove(start.objects[far], x, y, turn, float(margins_at(start, back[None])[0][0]))


def _moves(start: GradedStart, poses: Array, off: Array, free: list[int]) -> tuple[Array, Array]:
    """Moves worth a try: the objects (K,), and x, y and turn of each (K, 3)."""
    lengths = np.arange(MOVE_STEP, MOST_MOVE, MOVE_STEP)
    turns = np.arange(MOVE_TURN, math.pi, MOVE_TURN)
    ways = [(math.cos(one), math.sin(one)) for one in np.arange(MOVE_DIRECTIONS) * TWO_PI / MOVE_DIRECTIONS]
    which, moves = [], []
    slopes = _slopes(start, poses)
    for one in free:
        mine = [*ways]
        for way in (*slopes[:, one, :2], -off[one, :2]):
            if (size := math.hypot(*way)) > 1e-6:
                mine += [(way[0] / size, way[1] / size), (-way[0] / size, -way[1] / size)]
        straight = (np.array(mine)[:, None] * lengths[:, None]).reshape(-1, 2)
        moves.append(np.column_stack([straight, np.zeros(len(straight))]))
        round_ = np.concatenate([turns, -turns])
        moves.append(np.column_stack([np.zeros((len(round_), 2)), round_]))
        moves.append(-off[[one]])
        which += [one] * sum(map(len, moves[-3:]))
    return np.array(which), np.concatenate(moves)


def _slopes(start: GradedStart, poses: Array) -> Array:
    """(2, N, 3): how phi and what is required grow with each coordinate, by differences."""
    steps = SLOPE_DISTANCE * np.eye(poses.size).reshape(poses.size, *poses.shape)
    both = margins_at(start, np.concatenate([poses + steps, poses - steps]))
    return np.array([(one[: poses.size] - one[poses.size :]) / (2.0 * SLOPE_DISTANCE) for one in both]).reshape(
        2, *poses.shape
    )
