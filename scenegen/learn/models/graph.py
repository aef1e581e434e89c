"""A spec's formula as a graph: objects, atoms, and the minima and maxima above them, as tensors.

Objects and atoms are tied where an atom depends on an object's pose; atoms and junctions where the atom lies anywhere
below, so that what is decided high up is one step away. Each label is a junction as well, its root. The disjoint union
of graphs is a graph: a network that trains on many specs at once sees one.

Coordinates are those of each object's own frame (scenegen.learn.models.frames).

The margins of all atoms and their slopes are computed together for atoms that are alike but for their objects and
numbers (a `MarginForm`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import cast

import torch
from torch import Tensor

from scenegen.errors import RequestError
from scenegen.errors.learning import UNKNOWN_TO_MODEL
from scenegen.geometry import PRIMITIVES, Namespace
from scenegen.geometry.namespace import Turning
from scenegen.geometry.primitives import ANGLE
from scenegen.lang.formula.core import (
    REQUIRE,
    Apply,
    Atom,
    Const,
    Coord,
    Core,
    Junction,
    Node,
    atoms_below,
    part_of,
)
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.frames import MATTERS, Frames
from scenegen.learn.robustness.compile import TORCH
from scenegen.learn.robustness.deciding import with_sizes, without_sizes
from scenegen.pose import SIZE, THETA, row_of
from scenegen.search.effort import NEVER, Stop

# Primitives in the order of a network's inputs: those of weights whose file does not name its own.
PRIMITIVE_NAMES = "abs add bearing cos dist div gap max mean min mul neg pick reach room sin sub sum wrap"
SHOWN_NUMBERS = 6  # of an atom that its features show
SLOTS = 7  # places of an object among those of its atom; further ones share one, what carries them has the last
ROOT, MIN, MAX = range(3)  # kinds of junctions, the first of their features

ATOM_FEATURES = 1 + 1 + SHOWN_NUMBERS + 1  # beside primitives: objects; numbers; whether it is an angle
JUNCTION_FEATURES = 3 + 1 + 1  # kind; atoms below; whether it is of what is required


# Atoms that are alike.


@dataclass(frozen=True, slots=True)
class MarginForm:
    """A margin as nodes whose objects are places and whose numbers (constants and sizes) are left open."""

    nodes: tuple[Node, ...]

    def __call__(self, poses: Tensor, numbers: Tensor) -> Tensor:
        """(M,) margins for poses (3K, M) of its objects and numbers (P, M)."""
        turning, values, rest = Turning(TORCH), list[Tensor](), iter(numbers)
        for node in self.nodes:
            if isinstance(node, Const):
                values.append(next(rest))
            elif isinstance(node, Coord):
                value = poses[node.row]
                if node.axis == THETA:
                    turning.keep(value)
                values.append(value)
            else:
                whole = cast(Apply, with_sizes(node, rest))
                args = [values[arg] for arg in whole.args]
                values.append(PRIMITIVES[whole.primitive].evaluate(cast(Namespace, turning), *whole.shapes, *args))
        return values[-1].expand(poses.shape[1])


def _form(core: Core, atom: Atom) -> tuple[MarginForm, list[int], list[float]]:
    """The form of an atom's margin, its objects and its numbers."""
    alone = part_of(Core(core.nodes, {"": atom.margin}, core.objects), [""])
    objects = list(dict.fromkeys(node.object for node in alone.nodes if isinstance(node, Coord)))
    numbers: list[float] = []
    nodes: list[Node] = []
    for node in alone.nodes:
        if isinstance(node, Const):
            numbers.append(node.value)
            nodes.append(Const(0.0))
        else:
            nodes.append(without_sizes(node, objects, numbers))
    return MarginForm(tuple(nodes)), objects, numbers


@dataclass(frozen=True, slots=True, eq=False)
class AlikeAtoms:
    """n atoms of one form: which they are (n,), the rows that they read (n, 3K), their numbers (n, P) and their ties
    (n, K)."""

    atoms: Tensor
    reads: Tensor
    numbers: Tensor
    ties: Tensor


def join_alike(parts: Sequence[AlikeAtoms], device: torch.device | None = None) -> AlikeAtoms:
    columns = ([getattr(part, each.name) for part in parts] for each in fields(AlikeAtoms))
    return AlikeAtoms(*(torch.cat(column).to(device) if device else torch.cat(column) for column in columns))


# The graph.


@dataclass(frozen=True, slots=True, eq=False)
class FormulaGraph:
    """Of N objects, A atoms, J junctions and L labels; what is required counts as a label, the last of its spec.

    `ties` (E, 3) are atom, object, and the object's place in the atom; `below` (I, 2) atom and junction; `roots`
    (I', 2) atom and label; `members` are the atoms of each label, in order. `label_of` (J,) is the label of a junction,
    `required` (L,) which labels are what is required; `ranks` has the place of each label in its spec, None for what is
    required. `carrier` (N,) is the object that each moves with, -1 where it moves alone; `storeys` is how many stand on
    one another at most. `low` and `high` (3N, 1) are the frames. `carried` (C, 2) are ties of an atom with an object
    and with a carrier of it. `spec` (N,) is the spec of an object, of `specs`, and `share` (N, 1) one by the number of
    objects there. `place_of` (M + 1,) are the places of all nodes of the core formula among the atoms, -1 of others.
    """

    object_features: Tensor
    atom_features: Tensor
    junction_features: Tensor
    ties: Tensor
    below: Tensor
    roots: Tensor
    label_of: Tensor
    required: Tensor
    low: Tensor
    high: Tensor
    carrier: Tensor
    carried: Tensor
    spec: Tensor
    share: Tensor
    place_of: Tensor
    members: tuple[Tensor, ...]
    ranks: tuple[int | None, ...]
    specs: int
    storeys: int
    forms: dict[MarginForm, AlikeAtoms]

    @property
    def objects(self) -> int:
        return len(self.object_features)

    @property
    def atoms(self) -> int:
        return len(self.atom_features)

    @property
    def junctions(self) -> int:
        return len(self.junction_features)

    @property
    def labels(self) -> int:
        return len(self.required)

    def to(self, device: torch.device) -> FormulaGraph:
        """The same graph with its tensors there."""
        moved = {name: getattr(self, name).to(device) for name in TENSORS}
        forms = {form: join_alike([alike], device) for form, alike in self.forms.items()}
        return replace(self, **moved, members=tuple(one.to(device) for one in self.members), forms=forms)

    def in_frames(self, frames: Frames, wanted: Mapping[str, tuple[float, float]]) -> FormulaGraph:
        """The same graph in the frames for phi in these ranges."""
        low, high = frames.bounds_for(wanted)
        lowest, highest = (torch.from_numpy(ends).to(self.low)[:, None] for ends in (low, high))
        features = frames.features(low, high).to(self.low.device)
        return replace(self, object_features=features, low=lowest, high=highest)

    def in_order(self) -> list[list[int]]:
        """The labels by their place in their spec; without what is required."""
        known = sorted({rank for rank in self.ranks if rank is not None})
        return [[label for label, mine in enumerate(self.ranks) if mine == rank] for rank in known]

    def frame(self) -> tuple[Tensor, Tensor]:
        """Centre and half extent (N, 2, 1) of where each object can be; the half is 1 where it cannot move."""
        low, high = (ends.view(self.objects, SIZE, 1)[:, :THETA] for ends in (self.low, self.high))
        half = 0.5 * (high - low)
        return 0.5 * (low + high), torch.where(half > 0.0, half, 1.0)

    def extent(self) -> Tensor:
        """(E, 1, 3): what a coordinate of a view is in metres or radians, for each tie's object."""
        half = self.frame()[1][self.ties[:, 1], :, 0]
        return torch.cat([half, torch.ones_like(half[:, :1])], 1)[:, None]

    def free(self) -> Tensor:
        """(N, 1, 4): which coordinates of a view are to be made: those that matter and can move."""
        moves = (self.object_features[:, MATTERS] > 0.0) & (self.low < self.high).view(-1, SIZE)
        return torch.cat([moves, moves[:, THETA:]], 1)[:, None]

    def _origins(self, places: Tensor) -> Tensor:
        """(N, 2, B): the place of each object's carrier, 0 where it has none."""
        return torch.cat([places, torch.zeros_like(places[:1])])[self.carrier]

    def view(self, rows: Tensor) -> Tensor:
        """Storage (3N, B) -> (N, B, 4): x and y from -1 to 1 in the object's frame, cosine and sine of theta."""
        poses, (centre, half) = rows.view(self.objects, SIZE, -1), self.frame()
        places = poses[:, :THETA]
        if self.storeys:
            places = places - self._origins(places)
        turned = torch.stack([torch.cos(poses[:, THETA]), torch.sin(poses[:, THETA])], 1)
        return torch.cat([(places - centre) / half, turned], 1).transpose(1, 2).contiguous()

    def storage(self, view: Tensor) -> Tensor:
        """The way back: (N, B, 4) -> (3N, B), theta from -pi to pi."""
        parts, (centre, half) = view.transpose(1, 2), self.frame()
        turned = torch.atan2(parts[:, 3:], parts[:, 2:3])
        return self._to_storage(parts[:, :2] * half + centre, turned)

    def _to_storage(self, offsets: Tensor, turned: Tensor) -> Tensor:
        """Storage (3N, B) of places (N, 2, B) relative to the carriers', and headings (N, 1, B)."""
        places = offsets
        for _ in range(self.storeys):
            places = offsets + self._origins(places)
        return torch.cat([places, turned], 1).reshape(SIZE * self.objects, -1)

    def base(self, count: int, generator: torch.Generator) -> Tensor:
        """(3N, count) poses, uniform where they may be."""
        random = torch.rand(len(self.low), count, generator=generator, device=self.low.device)
        poses = torch.lerp(self.low, self.high, random).view(self.objects, SIZE, -1)
        return self._to_storage(poses[:, :THETA], poses[:, THETA:])

    def margins(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """Of all atoms in scenes (3N, B): margins (A, B), and their slopes along x, y and theta of each tie's object,
        (E, B, 3), with all that it carries."""
        count = rows.shape[1]
        margins, slopes = rows.new_zeros(self.atoms, count), rows.new_zeros(len(self.ties), count, SIZE)
        for form, alike in self.forms.items():
            atoms, width = alike.reads.shape
            here = rows[alike.reads.T].reshape(width, -1).requires_grad_()
            numbers = alike.numbers.T.repeat_interleave(count, 1)
            with torch.enable_grad():
                found = form(here, numbers)
                (slope,) = torch.autograd.grad(found.sum(), here)  # a sum, as in scenegen.learn.robustness.deciding
            margins[alike.atoms] = found.detach().view(atoms, count)
            by_tie = slope.view(width // SIZE, SIZE, atoms, count).permute(2, 0, 3, 1)
            slopes[alike.ties.reshape(-1)] = by_tie.reshape(-1, count, SIZE)
        if len(self.carried):
            rider, carrier = self.carried.T
            moved = torch.cat([slopes[rider, :, :THETA], torch.zeros_like(slopes[rider, :, THETA:])], -1)
            slopes = slopes.index_add(0, carrier, moved)
        return margins, slopes

    def places(self, nodes: Tensor) -> Tensor:
        """Nodes (L, B) of the core formula as places among the atoms, -1 where there is none. Not of a union."""
        return self.place_of[nodes.long()]


TENSORS = tuple(each.name for each in fields(FormulaGraph) if each.type == "Tensor")


def refuse_unknown(spec: CheckedSpec, core: Core, kinds: str) -> None:
    """Raises RequestError for a spec that says where things usually are, and for a formula with primitives that are not
    among `kinds`."""
    if spec.priors:
        raise RequestError(UNKNOWN_TO_MODEL(usually=True))
    strange = {node.primitive for node in core.nodes if isinstance(node, Apply)}.difference(kinds.split())
    if strange:
        raise RequestError(UNKNOWN_TO_MODEL(names=sorted(strange)))


def graph_of(frames: Frames, kinds: str = PRIMITIVE_NAMES, stop: Stop = NEVER) -> FormulaGraph:
    """The graph of a spec, in the frames for what it requires, for networks that know the primitives of `kinds`. Raises
    RequestError for others, and what `stop` raises."""
    core = frames.core
    refuse_unknown(frames.spec, core, kinds)
    low, high = frames.bounds_for({})
    form_of: dict[int, tuple[MarginForm, list[int], list[float]]] = {}
    for root in core.labels.values():
        for node in atoms_below(core, root):
            stop.check()
            form_of.setdefault(node, _form(core, cast(Atom, core.nodes[node])))
    atoms = [node for node, (_, objects, _) in form_of.items() if objects]  # not constants
    place = {node: number for number, node in enumerate(atoms)}
    ties: list[tuple[int, int, int]] = []
    carried: list[tuple[int, int]] = []
    alike: dict[MarginForm, list[AlikeAtoms]] = {}
    for number, node in enumerate(atoms):
        stop.check()
        form, objects, numbers = form_of[node]
        mine = torch.arange(len(ties), len(ties) + len(objects))
        ties += [(number, one, min(slot, SLOTS - 2)) for slot, one in enumerate(objects)]
        tie_of = dict(zip(objects, mine.tolist(), strict=True))
        for thing in objects:
            for under in frames.carriers(thing):
                if under not in tie_of:
                    tie_of[under] = len(ties)
                    ties.append((number, under, SLOTS - 1))
                carried.append((tie_of[thing], tie_of[under]))
        reads = torch.tensor([row_of(one, axis) for one in objects for axis in range(SIZE)])
        sizes = torch.tensor(numbers, dtype=torch.float32)
        one = AlikeAtoms(torch.tensor([number]), reads[None], sizes[None], mine[None])
        alike.setdefault(form, []).append(one)
    junctions, label_of, below, roots = list[list[float]](), list[int](), list[tuple[int, int]](), []
    for label, (name, root) in enumerate(core.labels.items()):
        roots += [(place[node], label) for node in atoms_below(core, root) if node in place]
        for kind, node in ((ROOT, root), *_junctions(core, root)):
            stop.check()
            found = [place[each] for each in atoms_below(core, node) if each in place]
            below += [(each, len(junctions)) for each in found]
            which = [float(kind == one) for one in (ROOT, MIN, MAX)]
            junctions.append([*which, len(found) ** 0.5 / 4.0, float(name == REQUIRE)])
            label_of.append(label)
    count = len(frames.carrier)
    return FormulaGraph(
        object_features=frames.features(low, high),
        atom_features=torch.stack([_atom_features(core, node, kinds.split(), *form_of[node]) for node in atoms]),
        junction_features=torch.tensor(junctions),
        ties=torch.tensor(ties, dtype=torch.int64).view(-1, 3),
        below=torch.tensor(below, dtype=torch.int64).view(-1, 2),
        roots=torch.tensor(roots, dtype=torch.int64).view(-1, 2),
        label_of=torch.tensor(label_of),
        required=torch.tensor([name == REQUIRE for name in core.labels]),
        low=torch.from_numpy(low).float()[:, None],
        high=torch.from_numpy(high).float()[:, None],
        carrier=torch.tensor(frames.carrier),
        carried=torch.tensor(carried, dtype=torch.int64).view(-1, 2),
        spec=torch.zeros(count, dtype=torch.int64),
        share=torch.full((count, 1), 1.0 / count),
        place_of=torch.tensor([place.get(node, -1) for node in range(-1, len(core.nodes))]).roll(-1),
        members=tuple(torch.tensor(sorted(one for one, mine in roots if mine == k)) for k in range(len(core.labels))),
        ranks=tuple(None if name == REQUIRE else k for k, name in enumerate(core.labels)),
        specs=1,
        storeys=max(len(frames.carriers(one)) for one in range(count)),
        forms={form: join_alike(found) for form, found in alike.items()},
    )


def _junctions(core: Core, root: int) -> list[tuple[int, int]]:
    """Kind and node of the minima and maxima of a formula, each once."""
    found, waiting = dict[int, int](), [root]
    while waiting:
        index = waiting.pop()
        node = core.nodes[index]
        if isinstance(node, Junction) and index not in found:
            found[index] = MIN if node.kind == "min" else MAX
            waiting.extend(node.args)
    return [(kind, node) for node, kind in found.items()]


def _atom_features(
    core: Core, node: int, kinds: list[str], form: MarginForm, objects: list[int], numbers: list[float]
) -> Tensor:
    bag = [0.0] * len(kinds)
    for each in form.nodes:
        if isinstance(each, Apply):
            bag[kinds.index(each.primitive)] += 1.0
    shown = [max(-3.0, min(3.0, number)) for number in numbers[:SHOWN_NUMBERS]]
    angle = float(cast(Atom, core.nodes[node]).unit == ANGLE)
    rest = [len(objects) / 3.0, len(numbers) / 4.0, *shown, *[0.0] * (SHOWN_NUMBERS - len(shown)), angle]
    return torch.cat([torch.tensor(bag).log1p(), torch.tensor(rest)])
