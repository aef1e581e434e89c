"""What every model is: the contract that one test runs over the whole table, and the networks that they are made of."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, ClassVar, Protocol, runtime_checkable

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor, nn

from scenegen.errors import DataError
from scenegen.errors.learning import DAMAGED_MODEL, STATE_MISFIT
from scenegen.lang.formula.core import Core
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.card import Layout
from scenegen.learn.models.codec import OTHER, Codec, Examples
from scenegen.learn.robustness import Robustness
from scenegen.pose import row_count
from scenegen.search.effort import NEVER, Stop

# Multi-layer perceptrons.


class Mlp(nn.Module):
    """Linear layers of the given widths with LeakyReLU(slope) between them (0 is ReLU) and nothing after the last.

    Made without weights (on torch's meta device): call `initialise`, or load a state with `assign=True`.
    """

    def __init__(self, widths: Sequence[int], slope: float) -> None:
        super().__init__()
        self.slope = slope
        self.layers = nn.ModuleList(nn.Linear(a, b, device="meta") for a, b in pairwise(widths))

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights by torch's own rule for linear layers: uniform within 1 / sqrt(inputs)."""
        for layer in self.linear():
            layer.to_empty(device=generator.device)
            bound = layer.in_features**-0.5
            nn.init.uniform_(layer.weight, -bound, bound, generator=generator)
            nn.init.uniform_(layer.bias, -bound, bound, generator=generator)

    def linear(self) -> list[nn.Linear]:
        return [layer for layer in self.layers if isinstance(layer, nn.Linear)]

    def forward(self, x: Tensor) -> Tensor:
        """(B, first width) -> (B, last width)."""
        *hidden, last = self.linear()
        for layer in hidden:
            x = nn.functional.leaky_relu(layer(x), self.slope, inplace=True)
        result: Tensor = last(x)
        return result


def one_hot(index: Tensor, count: int) -> Tensor:
    """(B,) int64 below `count` -> (B, count) float32 of zeros and a single one: a branch as input of a network."""
    zeros = torch.zeros(len(index), count, device=index.device)
    return zeros.scatter_(1, index[:, None], 1.0)


# What training asks of the compiled spec: phi of a network's own scenes, with gradients.


class SpecLoss:
    """phi of every label and the value of the atom that ought to decide it, for unit coordinates x (B, 3N).

    `table` (K, W) names the deciding atoms of each branch, and after them the surfaces of choices
    (scenegen.learn.models.codec). One pass over the core formula gives both; gradients are those of hard min and max,
    exact away from ties.
    """

    def __init__(self, core: Core, table: Tensor, codec: Codec) -> None:
        table = table[:, : len(core.labels)]  # choices of surfaces are no atoms
        atoms = sorted({int(node) for node in table.flatten() if node != OTHER})
        labels = {**core.labels, **{f"#{node}": node for node in atoms}}
        self._robustness = Robustness(dataclasses.replace(core, labels=labels))
        self._labels = len(core.labels)
        # the row of Robustness' output to read for each branch and label; phi itself where the branch names no atom
        place = {node: self._labels + index for index, node in enumerate(atoms)}
        own = range(self._labels)
        self._rows = torch.tensor([[place.get(int(way[k]), k) for k in own] for way in table])

        self._scale, self._offset = codec.affine()

    def __call__(self, x: Tensor, branch: Tensor) -> tuple[Tensor, Tensor]:
        """x (B, 3N), branch (B,) -> phi (B, L) and the branch's atoms (B, L)."""
        values = self._values(x)
        return values[:, : self._labels], values.gather(1, self._rows[branch])

    def phi(self, x: Tensor) -> Tensor:
        """x (B, 3N) -> (B, L)."""
        return self._values(x)[:, : self._labels]

    def _values(self, x: Tensor) -> Tensor:
        if self._rows.device != x.device:
            self._rows, self._scale, self._offset = (t.to(x.device) for t in (self._rows, self._scale, self._offset))
        # one scene per row of x, one contiguous row per coordinate for the formula
        return self._robustness.rows(x.T.contiguous() * self._scale + self._offset, check=False).T


class Hyper(BaseModel):
    """A model's own settings; subclasses add fields with defaults and bounds."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


@runtime_checkable
class Initialised(Protocol):
    """A part of a model that holds weights."""

    def initialise(self, generator: torch.Generator) -> None: ...


class SceneModel(nn.Module, ABC):
    """A conditional sampler of scenes: labels phi (B, L) -> unit coordinates x (B, 3N).

    x is what models see (scenegen.learn.models.codec): positions as shares of the workspace, theta in turns, all in [0,
    1], N objects in storage order. phi is the vector of labels as the spec gives it, in metres and radians.

    A new instance holds no weights: call `initialise` and `fit`, or `load_weights`. Call `start` before the first
    `update`. All randomness comes from the generators passed in, which live on the model's device.
    """

    hyper_class: ClassVar[type[Hyper]]
    before: ClassVar[Mapping[str, float]] = {}
    """Settings that files of earlier versions do not name, as they were then."""
    corrected: ClassVar[bool] = True
    """Whether the last step of its scenes is the spec's (scenegen.learn.models.correction)."""
    constant_rate: ClassVar[bool] = False
    """Whether its learning rate stays what it was at first."""
    thorough: ClassVar[bool] = False
    """Whether its scenes get more of the correction's random moves."""
    TRAINING_ONLY: ClassVar[tuple[str, ...]] = ()
    """Submodules that `sample` does not need; model files leave them out."""

    label_lowest: Tensor
    label_highest: Tensor

    def __init__(self, layout: Layout, hyper: Hyper) -> None:
        super().__init__()
        self.layout = layout
        self.objects = layout.objects
        self.labels = labels = layout.labels
        self.hyper = hyper
        self.optimisers: dict[str, torch.optim.Optimizer] = {}
        self.register_buffer("label_lowest", torch.empty(labels, device="meta"))
        self.register_buffer("label_highest", torch.empty(labels, device="meta"))

    @property
    def width(self) -> int:
        """Coordinates of a scene, 3N."""
        return row_count(self.objects)

    def bind(self, spec: CheckedSpec, stop: Stop = NEVER) -> None:
        """Take up what the spec fixes besides sizes; by default nothing. Raises what `stop` raises."""
        return

    def initialise(self, generator: torch.Generator) -> None:
        """Fresh weights from `generator`."""
        for module in self.children():
            if isinstance(module, Initialised):
                module.initialise(generator)

    def fit(self, examples: Examples) -> None:
        """Take up what the training data fixes besides weights: the label range, and what subclasses add."""
        self.label_lowest, self.label_highest = examples.phi.amin(0), examples.phi.amax(0)

    def prepare(self, examples: Examples, generator: torch.Generator, check: Callable[[], None]) -> None:
        """Learn what needs no other part of the model, after `fit` and before `start`, on the CPU; by default nothing.
        `check` is called often, and may raise."""
        return

    @abstractmethod
    def start(self, lr: float, spec_loss: SpecLoss) -> None:
        """Make the optimisers with this learning rate and whatever else `update` needs, on the model's device."""

    @abstractmethod
    def update(self, batch: Examples, generator: torch.Generator) -> dict[str, Tensor]:
        """One training step on B >= 1 examples. Returns the losses by name, in a fixed order, as numbers on the device
        (reading one would wait for it)."""

    @abstractmethod
    def sample(self, n: int, phi: Tensor, generator: torch.Generator) -> Tensor:
        """n scenes x (n, 3N) in [0, 1] for the labels phi, (n, L) or (L,). Evaluates no phi and holds no scenes."""

    def sample_in(
        self, n: int, phi: Tensor, generator: torch.Generator, branch: Tensor | None = None, stop: Stop = NEVER
    ) -> tuple[Tensor, Tensor | None]:
        """As `sample`, in branches (n,) or (n, L) int64, which are drawn where they are not given: the scenes and their
        branches, None of a model that knows of none. Raises what `stop` raises."""
        stop.check()
        return self.sample(n, phi, generator), None

    def drop_training_parts(self) -> None:
        """Leave only what `sample` needs."""
        for name in self.TRAINING_ONLY:
            delattr(self, name)

    def sampler_state(self) -> dict[str, Tensor]:
        """Copies of the weights that `sample` needs, by name."""
        return {
            name: tensor.detach().clone()
            for name, tensor in self.state_dict().items()
            if name.partition(".")[0] not in self.TRAINING_ONLY
        }

    def training_state(self) -> dict[str, Tensor]:
        """Copies of all weights (`model.*`) and of the optimisers' moments (`optimiser.*`)."""
        state = {f"model.{name}": tensor.detach().clone() for name, tensor in self.state_dict().items()}
        for name, optimiser in self.optimisers.items():
            for index, slots in optimiser.state_dict()["state"].items():
                state |= {f"optimiser.{name}.{index}.{slot}": value.clone() for slot, value in slots.items()}
        return state

    def load_weights(self, weights: Mapping[str, Tensor]) -> None:
        """Take the tensors as the model's weights. Raises DataError where they are not this model's."""
        check_tensors(self, weights)
        self.load_state_dict(weights, assign=True)

    def restore(self, state: Mapping[str, Tensor], lr: float, spec_loss: SpecLoss, device: torch.device) -> None:
        """Take up the state of `training_state` and `start`. Raises DataError where it is not this model's."""
        self.load_weights({name[6:]: tensor for name, tensor in state.items() if name.startswith("model.")})
        self.to(device)
        self.start(lr, spec_loss)
        for name, optimiser in self.optimisers.items():
            parameters = [parameter for group in optimiser.param_groups for parameter in group["params"]]
            slots: dict[int, dict[str, Any]] = {}
            for key, tensor in state.items():
                kind, _, rest = key.partition(".")
                owner, _, rest = rest.partition(".")
                index, _, slot = rest.partition(".")
                if kind != "optimiser" or owner != name:
                    continue
                fits = index.isdecimal() and int(index) < len(parameters)
                if not fits or (tensor.ndim and tensor.shape != parameters[int(index)].shape) or not _finite(tensor):
                    raise DataError(STATE_MISFIT(reason=f"`{key}` is not of this model"))
                slots.setdefault(int(index), {})[slot] = tensor
            optimiser.load_state_dict({"state": slots, "param_groups": optimiser.state_dict()["param_groups"]})


def check_tensors(model: nn.Module, tensors: Mapping[str, Tensor]) -> None:
    """Raises DataError unless `tensors` are exactly the model's weights: names, shapes, types, all finite."""
    expected = model.state_dict()
    for name, parameter in expected.items():
        if name not in tensors:
            raise DataError(DAMAGED_MODEL(weights=name, reason="are missing"))
        tensor = tensors[name]
        if tensor.shape != parameter.shape or tensor.dtype != parameter.dtype:
            have, want = tuple(tensor.shape), tuple(parameter.shape)
            raise DataError(DAMAGED_MODEL(weights=name, reason=f"have shape {have}, {tensor.dtype}; expected {want}"))
        if not _finite(tensor):
            raise DataError(DAMAGED_MODEL(weights=name, reason="are not all finite"))
    extra = sorted(set(tensors) - set(expected))
    if extra:
        raise DataError(DAMAGED_MODEL(weights=extra[0], reason="belong to no part of the model"))


def _finite(tensor: Tensor) -> bool:
    return bool(torch.isfinite(tensor).all())
