"""Flow matching over a formula's graph: one network for every spec.

Scenes of a wanted phi come about as in scenegen.learn.models.flow: points of the base distribution are carried to
scenes in a few steps, by a network that says which scene a point heads for. This one reads the formula itself
(scenegen.learn.models.graph), not the numbers of one spec's labels: at every step it sees how far each atom is from
what is wanted of it and in which direction it would change, and passes messages between atoms, the minima and maxima
above them, and objects. So equal objects are equal to it, and any formula over any objects is a graph that it can take.

Which atom of each label decides its phi (the branch) is drawn first, by a network over the same graph, label by label.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise
from pathlib import Path

import torch
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat
from torch import Tensor, nn
from torch.nn.functional import silu

from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.base import Hyper, SceneModel, SpecLoss
from scenegen.learn.models.card import Layout
from scenegen.learn.models.checkpoint import read_card, unpack
from scenegen.learn.models.codec import Codec, Examples
from scenegen.learn.models.conditioned import detach_losses, visible_labels
from scenegen.learn.models.flow import MIN_TIME_LEFT
from scenegen.learn.models.frames import OBJECT_FEATURES, Frames, frames_of
from scenegen.learn.models.generator import ATANH_BOUND
from scenegen.learn.models.graph import (
    ATOM_FEATURES,
    JUNCTION_FEATURES,
    PRIMITIVE_NAMES,
    SLOTS,
    FormulaGraph,
    graph_of,
)
from scenegen.learn.robustness.deciding import deciding_atoms
from scenegen.pose import SIZE
from scenegen.search.effort import NEVER, Stop, effort_until_stopped

MARGIN_SCALES = (0.005, 0.02, 0.1, 0.5)  # metres or radians: at which margins are seen
VIEW_SIZE = 4  # coordinates of an object: x, y, cosine and sine of its heading
TIMES = 6  # features of the time
WEAK = 1e-3  # squared slope below which a Newton step is no longer the full one


def squash_margin(margin: Tensor) -> Tensor:
    """(..., B) -> (..., B, 4): a margin at several scales."""
    return torch.stack([torch.tanh(margin / scale) for scale in MARGIN_SCALES], dim=-1)


def pool_sum(source: Tensor, place: Tensor, count: int) -> Tensor:
    """Sums (count, B, d) of the rows of (E, B, d) by their place (E,)."""
    return source.new_zeros(count, *source.shape[1:]).index_add(0, place, source)


def mlp(*widths: int) -> nn.Sequential:
    layers = [part for a, b in pairwise(widths) for part in (nn.Linear(a, b), nn.SiLU())]
    return nn.Sequential(*layers[:-1])


def slots(width: int) -> nn.Embedding:
    """(Given a tensor, torch draws none: that would load half of it, on the meta device.)"""
    return nn.Embedding(SLOTS, width, _weight=torch.empty(SLOTS, width))


def condition_vector(graph: FormulaGraph, wanted: Tensor) -> tuple[Tensor, Tensor]:
    """What is wanted of each label (L, B), NaN where it is free: the value, 0 where there is none, and whether there is
    one. What is required is always wanted, to be at least 0."""
    known = ~torch.isnan(wanted) | graph.required[:, None]
    value = torch.where(known & ~graph.required[:, None], wanted, wanted.new_zeros(()))
    return value, known.to(value)


class Rounds(nn.Module):
    """Messages between objects, atoms and junctions, (K, B, d) each, along what ties them."""

    def __init__(self, width: int, rounds: int, objects: int) -> None:
        """Objects change in the first `objects` of the rounds, atoms and junctions in all."""
        super().__init__()

        def mlps(count: int, *widths: int) -> nn.ModuleList:
            return nn.ModuleList(mlp(*widths) for _ in range(count))

        self.to_atom = mlps(rounds, width, width)
        self.junction = mlps(rounds, 2 * width, width, width)
        self.atom = mlps(rounds, 3 * width, width, width)
        self.atom_norm = nn.ModuleList(nn.LayerNorm(width) for _ in range(rounds))
        self.to_object, self.from_atom = mlps(objects, width, width), mlps(objects, width, width)
        self.object = mlps(objects, 2 * width, width, width)
        self.object_norm = nn.ModuleList(nn.LayerNorm(width) for _ in range(objects))

    def forward(
        self, graph: FormulaGraph, things: Tensor, atoms: Tensor, junctions: Tensor, ties: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Objects and atoms after all rounds."""
        atom, thing = graph.ties[:, 0], graph.ties[:, 1]
        under = atoms.new_zeros(graph.junctions, graph.atoms)
        under[graph.below[:, 1], graph.below[:, 0]] = 1.0
        to_junction = under / under.sum(1, keepdim=True).clamp_min(1.0)
        from_junction = under.T / under.sum(0)[:, None].clamp_min(1.0)

        def average(means: Tensor, source: Tensor) -> Tensor:
            return (means @ source.reshape(len(source), -1)).view(len(means), *source.shape[1:])

        for number in range(len(self.atom)):
            sent = self.to_atom[number](things).index_select(0, thing) + ties
            heard = pool_sum(silu(sent), atom, graph.atoms)
            mean = average(to_junction, atoms)
            junctions = junctions + self.junction[number](torch.cat([junctions, mean], -1))
            above = average(from_junction, junctions)
            atoms = self.atom_norm[number](atoms + self.atom[number](torch.cat([atoms, heard, above], -1)))
            if number == len(self.object):
                break
            sent = self.from_atom[number](atoms).index_select(0, atom)
            sent = sent + self.to_object[number](things).index_select(0, thing) + ties
            heard = pool_sum(silu(sent), thing, graph.objects)
            things = self.object_norm[number](things + self.object[number](torch.cat([things, heard], -1)))
        return things, atoms


class GoalNetwork(nn.Module):
    """Which scene a point heads for."""

    def __init__(self, width: int, rounds: int, atom_features: int) -> None:
        super().__init__()
        self.object_kind, self.object_now = nn.Linear(OBJECT_FEATURES, width), nn.Linear(VIEW_SIZE + TIMES, width)
        self.object_first = mlp(width, width)
        self.atom_kind, self.atom_now = mlp(atom_features, width, width), nn.Linear(2 * len(MARGIN_SCALES) + 2, width)
        self.junction_kind, self.junction_now = (
            nn.Linear(JUNCTION_FEATURES, width),
            nn.Linear(len(MARGIN_SCALES) + 1, width),
        )
        self.slot, self.tie_now = slots(width), nn.Linear(2 * SIZE, width)
        self.rounds = Rounds(width, rounds, rounds)
        self.made = nn.Linear(width, VIEW_SIZE + SIZE)  # shifts, and gates of x, y and heading
        self.push = nn.Linear(width, SIZE)  # along the Newton step of each tie

    def forward(
        self,
        graph: FormulaGraph,
        point: Tensor,
        time: Tensor,
        wanted: Tensor,
        active: Tensor,
        margins: Tensor,
        slopes: Tensor,
    ) -> Tensor:
        """The goals (N, B, 4) of points (N, B, 4) at times (N, B, 1), wanted phi (L, B), the deciding atoms marked in
        (A, B), and the margins and slopes (E, B, 3) there."""
        waves = torch.cat(
            [time, time * time, *(f(n * math.pi * time) for n in (1, 3) for f in (torch.sin, torch.cos))], -1
        )
        things = self.object_kind(graph.object_features)[:, None] + self.object_now(torch.cat([point, waves], -1))
        things = self.object_first(silu(things))

        value, known = condition_vector(graph, wanted)
        at, label = graph.roots[:, 0], graph.roots[:, 1]
        times = pool_sum(known[label], at, graph.atoms)
        aim = pool_sum(value[label], at, graph.atoms) / times.clamp_min(1.0)
        aimed = (times > 0.0).to(aim)
        gap = (aim - margins) * aimed
        now = torch.cat([squash_margin(margins), squash_margin(gap), active[..., None], aimed[..., None]], -1)
        atoms = self.atom_kind(graph.atom_features)[:, None] + self.atom_now(now)

        of = graph.label_of
        now = torch.cat([known[of][..., None], squash_margin(value[of])], -1)
        junctions = self.junction_kind(graph.junction_features)[:, None] + self.junction_now(now)

        steep = slopes * graph.extent()
        atom = graph.ties[:, 0]
        square = pool_sum(steep.square().sum(-1, keepdim=True), atom, graph.atoms)[..., 0]
        step = ((gap / square.clamp_min(WEAK)).index_select(0, atom)[..., None] * steep).clamp(-1.0, 1.0)
        ties = self.slot(graph.ties[:, 2])[:, None] + self.tie_now(torch.cat([steep.clamp(-3.0, 3.0), 3.0 * step], -1))

        things, atoms = self.rounds(graph, things, atoms, junctions, ties)
        made = self.made(things)
        pushed = pool_sum(self.push(silu(atoms.index_select(0, atom) + ties)) * step, graph.ties[:, 1], graph.objects)
        shift, gate = made[..., :VIEW_SIZE], made[..., VIEW_SIZE:]
        still = torch.atanh(point[..., :2].clamp(-ATANH_BOUND, ATANH_BOUND))
        places = torch.tanh(still * gate[..., :2] + shift[..., :2] + pushed[..., :2])
        cosine, sine = point[..., 2:3], point[..., 3:]
        turned = torch.cat([-sine, cosine], -1) * pushed[..., 2:]
        headings = point[..., 2:] * gate[..., 2:] + shift[..., 2:] + turned
        return torch.cat([places, headings], -1)


class BranchNetwork(nn.Module):
    """How likely each atom is to decide a label, given what is wanted and which atoms decide the labels before it."""

    def __init__(self, width: int, rounds: int, atom_features: int) -> None:
        super().__init__()
        self.object_kind, self.slot = mlp(OBJECT_FEATURES, width, width), slots(width)
        self.atom_kind, self.atom_now = mlp(atom_features, width, width), nn.Linear(len(MARGIN_SCALES) + 2, width)
        self.junction_kind, self.junction_now = (
            nn.Linear(JUNCTION_FEATURES, width),
            nn.Linear(len(MARGIN_SCALES) + 1, width),
        )
        self.rounds = Rounds(width, rounds, rounds - 1)
        self.out = nn.Linear(width, 1)

    def forward(self, graph: FormulaGraph, wanted: Tensor, active: Tensor) -> Tensor:
        """Logits (A, B)."""
        value, known = condition_vector(graph, wanted)
        at, label = graph.roots[:, 0], graph.roots[:, 1]
        times = pool_sum(known[label], at, graph.atoms)
        aim = pool_sum(value[label], at, graph.atoms) / times.clamp_min(1.0)
        now = torch.cat([squash_margin(aim), active[..., None], (times > 0.0).to(aim)[..., None]], -1)
        atoms = self.atom_kind(graph.atom_features)[:, None] + self.atom_now(now)
        of = graph.label_of
        now = torch.cat([known[of][..., None], squash_margin(value[of])], -1)
        junctions = self.junction_kind(graph.junction_features)[:, None] + self.junction_now(now)
        things = self.object_kind(graph.object_features)[:, None].expand(-1, wanted.shape[1], -1)
        ties = self.slot(graph.ties[:, 2])[:, None].expand(-1, wanted.shape[1], -1)
        _, atoms = self.rounds(graph, things, atoms, junctions, ties)
        logits: Tensor = self.out(atoms)[..., 0]
        return logits


# Both networks: what they learn from, of one spec or of many, and how they make scenes.


class GraphHyper(Hyper):
    """`width` of the messages about where a scene lies, in so many `rounds`; `chooser` that of those about branches;
    `steps` that a scene takes when it is made (training does not depend on it): each is two evaluations. `primitives`
    are the names of those that the weights know, in the order of their inputs."""

    width: int = Field(default=64, ge=1, le=1024)
    rounds: int = Field(default=3, ge=1, le=16)
    chooser: int = Field(default=48, ge=1, le=1024)
    steps: int = Field(default=2, ge=1, le=1000)
    primitives: str = Field(default=PRIMITIVE_NAMES, pattern=r"^\w+( \w+)*$")


CHOOSING = 2  # rounds about branches


class Networks(nn.Module):
    """See the module's text."""

    def __init__(self, hyper: GraphHyper) -> None:
        """Without weights: call `initialise`, or load a state with `assign=True`."""
        super().__init__()
        with torch.device("meta"):
            known = len(hyper.primitives.split())
            self.goal = GoalNetwork(hyper.width, hyper.rounds, known + ATOM_FEATURES)
            self.branch = BranchNetwork(hyper.chooser, CHOOSING, known + ATOM_FEATURES)

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights; at first a point heads for itself."""
        self.to_empty(device=generator.device)
        for module in self.modules():
            if isinstance(module, nn.Linear):
                bound = module.in_features**-0.5
                nn.init.uniform_(module.weight, -bound, bound, generator=generator)
                nn.init.uniform_(module.bias, -bound, bound, generator=generator)
            elif isinstance(module, nn.Embedding):
                nn.init.normal_(module.weight, generator=generator)
            elif isinstance(module, nn.LayerNorm):
                module.reset_parameters()
        with torch.no_grad():
            self.goal.made.weight.mul_(0.1)
            self.goal.made.bias.zero_()
            self.goal.made.bias[VIEW_SIZE:] = 1.0
            self.goal.push.weight.zero_()
            self.goal.push.bias.zero_()

    def losses(
        self, graph: FormulaGraph, rows: Tensor, wanted: Tensor, deciders: Tensor, generator: torch.Generator
    ) -> dict[str, Tensor]:
        """Of scenes (3N, B), their phi (L, B), NaN where it is left out, and the atoms (L, B) that decide it,
        places among the graph's: the squared error of the velocity, a mean over specs and objects, and the mean
        surprise at branches (nats)."""
        return {
            "velocity": self._velocity(graph, rows, wanted, mark_deciders(graph, wanted, deciders), generator),
            "branch": self._surprise(graph, wanted, deciders),
        }

    def _velocity(
        self, graph: FormulaGraph, rows: Tensor, wanted: Tensor, active: Tensor, generator: torch.Generator
    ) -> Tensor:
        count = rows.shape[1]
        end, free = graph.view(rows), graph.free()
        begin = torch.where(free, graph.view(graph.base(count, generator)), end)
        time = torch.rand(graph.specs, count, 1, generator=generator, device=rows.device)[graph.spec]
        point = torch.lerp(begin, end, time)
        goal = self.goal(graph, point, time, wanted, active, *graph.margins(graph.storage(point)))
        off = ((goal - end) / (1.0 - time).clamp_min(MIN_TIME_LEFT)).square() * free
        mean: Tensor = (off.sum(-1) * graph.share).sum() / (graph.share.sum() * count)
        return mean

    def _surprise(self, graph: FormulaGraph, wanted: Tensor, deciders: Tensor) -> Tensor:
        known = (~torch.isnan(wanted) & (deciders >= 0)).to(wanted)
        so_far, surprise = torch.full_like(deciders, -1), wanted.new_zeros(())
        for labels in graph.in_order():
            logits = self.branch(graph, wanted, mark_deciders(graph, wanted, so_far))
            for label in labels:
                mine = graph.members[label]
                place = torch.searchsorted(mine, deciders[label].contiguous()).clamp_max(len(mine) - 1)
                told_apart = torch.log_softmax(logits.index_select(0, mine), 0).gather(0, place[None])[0]
                surprise = surprise - (told_apart * known[label]).sum()
            so_far = so_far.clone()
            so_far[labels] = deciders[labels]
        return surprise / known[[label for labels in graph.in_order() for label in labels]].sum().clamp_min(1.0)

    @torch.no_grad()
    def draw_branches(self, graph: FormulaGraph, wanted: Tensor, generator: torch.Generator) -> Tensor:
        """A deciding atom for each label that is wanted, (L, B) places among the atoms, -1 elsewhere."""
        found = torch.full(wanted.shape, -1, device=wanted.device)
        for labels in graph.in_order():
            logits = self.branch(graph, wanted, mark_deciders(graph, wanted, found))
            for label in labels:
                mine = graph.members[label]
                up_to = torch.softmax(logits[mine], 0).cumsum(0).T.contiguous()
                place = torch.rand(len(up_to), 1, generator=generator, device=wanted.device)
                drawn = mine[torch.searchsorted(up_to, place)[:, 0].clamp_max(len(mine) - 1)]
                found[label] = torch.where(torch.isnan(wanted[label]), found[label], drawn)
        return found

    @torch.no_grad()
    def make(
        self,
        graph: FormulaGraph,
        wanted: Tensor,
        deciders: Tensor,
        steps: int,
        generator: torch.Generator,
        stop: Stop = NEVER,
    ) -> Tensor:
        """Scenes (3N, B) in so many steps, each with the velocity of its middle (the midpoint rule)."""
        count = wanted.shape[1]
        active, free = mark_deciders(graph, wanted, deciders), graph.free()
        start = graph.base(count, generator)
        point = graph.view(start)

        def goal(point: Tensor, time: float) -> Tensor:
            stop.check()
            times = point.new_full((graph.objects, count, 1), time)
            found: Tensor = self.goal(graph, point, times, wanted, active, *graph.margins(graph.storage(point)))
            return found

        for number in range(steps):
            begin, end = number / steps, (number + 1) / steps
            middle = 0.5 * (begin + end)
            there = torch.where(free, torch.lerp(point, goal(point, begin), (middle - begin) / (1.0 - begin)), point)
            moved = point + (end - begin) * (goal(there, middle) - there) / (1.0 - middle)
            moved = torch.cat([moved[..., :2].clamp(-1.0, 1.0), moved[..., 2:]], -1)
            point = torch.where(free, moved, point)
        return torch.where(free[:, 0, :SIZE].reshape(-1, 1), graph.storage(point), start)


def mark_deciders(graph: FormulaGraph, wanted: Tensor, deciders: Tensor) -> Tensor:
    """(A, B): 1 where an atom decides a label that is given."""
    known = (~torch.isnan(wanted) & (deciders >= 0)).to(wanted)
    active = wanted.new_zeros(graph.atoms, wanted.shape[1])
    return active.scatter_reduce(0, deciders.clamp_min(0), known, "amax")


# The weights that come with the package.


WEIGHTS_FORMAT = "scenegen/any"
WEIGHTS = Path(__file__).with_name("any.safetensors")


class WeightsCard(BaseModel):
    """What their file says: settings of the networks, what they learnt from, and how good they are on specs that they
    did not learn from (experiments.any)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    hyper: dict[str, int | str]
    seed: int
    steps: int = Field(ge=0)
    specs: int = Field(ge=0)
    cpu_hours: FiniteFloat
    figures: dict[str, str] = {}


@cache
def shipped_weights() -> tuple[WeightsCard, dict[str, Tensor]]:
    """The card and the weights of `Networks`; they are shared, so copy what is to change."""
    what = "the model of any spec"
    text, tensors = unpack(WEIGHTS, WEIGHTS_FORMAT, what)
    return read_card(WeightsCard, text, WEIGHTS, what), tensors


# The model: both networks and the formula of one spec.

MADE_ATOMS, MIN_MADE_SCENES = (
    4096,
    128,
)  # atoms of all scenes that are made at a time, which stay in cache; and scenes, at least
MAX_LIVE_TIES = (
    1 << 16
)  # ties of these scenes at most: 17 MB for each layer of the network, a third of a second to evaluate it
MIN_PHI_STEP = 0.01  # step of the ends of phi, metres or radians, that frames are made for


class GraphFlow(SceneModel):
    """See the module's text. Fresh weights are those that come with the package, where the settings are theirs."""

    hyper_class = GraphHyper
    thorough = True
    graph: FormulaGraph
    frames: Frames

    def __init__(self, layout: Layout, hyper: GraphHyper) -> None:
        super().__init__(layout, hyper)
        self.steps, self.primitives = hyper.steps, hyper.primitives
        self.networks = Networks(hyper)

    def bind(self, spec: CheckedSpec, stop: Stop = NEVER) -> None:
        self.frames = frames_of(spec, effort_until_stopped(stop))
        self.graph = graph_of(self.frames, self.primitives, stop)
        self.codec = Codec(spec.workspace, len(spec.objects))

    def initialise(self, generator: torch.Generator) -> None:
        """The weights that come with the package; fresh ones where the settings are not theirs."""
        card, weights = shipped_weights()
        if self.hyper.model_copy(update={"steps": 1}) == GraphHyper.model_validate({**card.hyper, "steps": 1}):
            self.networks.load_state_dict({name: one.clone() for name, one in weights.items()}, assign=True)
        else:
            self.networks.initialise(generator)

    def start(self, lr: float, spec_loss: SpecLoss) -> None:
        self.optimisers = {"all": torch.optim.Adam(self.parameters(), lr=lr, betas=(0.9, 0.99), fused=True)}

    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        rows = self.codec.decode(batch.x)
        wanted = (
            batch.phi
            if not self.layout.partial
            else torch.where(visible_labels(batch, generator), batch.phi, torch.nan)
        )
        graph = self._graph(rows.device)
        deciders = graph.places(deciding_atoms(self.frames.core, rows))
        losses = self.networks.losses(graph, rows, self._with_requirement(wanted.T), deciders, generator)
        optimiser = self.optimisers["all"]
        optimiser.zero_grad()
        torch.autograd.backward(losses["velocity"] + losses["branch"])
        optimiser.step()
        return detach_losses(**losses)

    def _graph(self, device: torch.device) -> FormulaGraph:
        if self.graph.low.device != device:
            self.graph = self.graph.to(device)
        return self.graph

    def _graph_in_frames(self, phi: Tensor) -> FormulaGraph:
        """The graph in the frames for these phi, (n, L) or (L,), NaN where a label is free. Ends are rounded outwards,
        so that most calls for a request contract the same box, which the tape keeps."""
        ends: dict[str, tuple[float, float]] = {}
        for label, mine in zip(self.frames.spec.labels, phi.T, strict=True):
            low, high = float(mine.min()), float(mine.max())  # NaN if any is
            if not math.isnan(low):
                step = max(MIN_PHI_STEP, 2.0 ** math.ceil(math.log2(max(high - low, MIN_PHI_STEP))) / 8.0)
                ends[label] = math.floor(low / step) * step, math.ceil(high / step) * step
        return self._graph(phi.device).in_frames(self.frames, ends)

    def _with_requirement(self, wanted: Tensor) -> Tensor:
        """phi of the labels (L, B), and NaN for what is required, if anything is."""
        return torch.cat([wanted, wanted.new_full((self.graph.labels - len(wanted), wanted.shape[1]), torch.nan)])

    def sample(self, n: int, phi: Tensor, generator: torch.Generator) -> Tensor:
        return self.sample_in(n, phi, generator)[0]

    @torch.no_grad()
    def sample_in(
        self, n: int, phi: Tensor, generator: torch.Generator, branch: Tensor | None = None, stop: Stop = NEVER
    ) -> tuple[Tensor, Tensor]:
        """As `sample`. A branch (n, L) is the deciding atom of each label, a place among the graph's atoms."""
        graph = self._graph_in_frames(phi)
        wanted = self._with_requirement(phi.expand(n, -1).T.contiguous())
        size = max(1, min(max(MIN_MADE_SCENES, MADE_ATOMS // graph.atoms), MAX_LIVE_TIES // max(1, len(graph.ties))))
        made, branches = [], []
        for start in range(0, n, size):
            stop.check()
            some = wanted[:, start : start + size]
            if branch is None:
                deciders = self.networks.draw_branches(graph, some, generator)
            else:
                deciders = branch[start : start + size].T
            made.append(self.networks.make(graph, some, deciders, self.steps, generator, stop))
            branches.append(deciders.T)
        return self.codec.encode(torch.cat(made, 1)), torch.cat(branches)
