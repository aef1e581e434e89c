"""Trained models and their files: safetensors with the sampler's weights and a JSON card. Loading one runs no code of
its author."""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Literal, TypeVar

import safetensors.torch
import torch
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json
from torch import Tensor

from scenegen.arrays import Array
from scenegen.errors import DataError, RequestError, ScenegenError
from scenegen.errors.learning import (
    ARRAY_NOT_FINITE,
    DAMAGED_MODEL,
    MODEL_OF_ANOTHER_SPEC,
    MODEL_VERSION,
    NOT_A_MODEL,
    WRONG_SHAPE,
)
from scenegen.errors.requests import OUT_OF_RANGE, STEPS_FIXED
from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.base import SceneModel
from scenegen.learn.models.card import MODEL_FORMAT, ModelCard
from scenegen.learn.models.codec import Codec
from scenegen.learn.models.correction import Correction, McmcMoves
from scenegen.learn.models.registry import model_class
from scenegen.scenes.files import read_bytes, write_whole
from scenegen.search.effort import NEVER, Stop
from scenegen.validation import as_int

# Tensors and text in one safetensors file, read with distrust.
#
# The text (a JSON card) travels in safetensors' own metadata, in an envelope with the format's name, its version and
# a SHA-256 over text and tensors: a damaged file is recognised before anything in it is used. Nothing is ever
# unpickled, and nothing larger than the file itself is allocated.


MODEL_KEY = "scenegen"  # the one entry of safetensors' metadata; a single entry keeps the file's bytes reproducible
Card = TypeVar("Card", bound=BaseModel)

MAX_FILE_BYTES = 512 * 2**20  # bytes of a file that is read at all
_TYPES = {torch.float32, torch.float64, torch.int64, torch.uint8}


class _Envelope(BaseModel):
    model_config = ConfigDict(extra="forbid")

    format: str
    version: Literal[1]
    sha256: str
    card: str


def pack(format_name: str, card: str, tensors: Mapping[str, Tensor]) -> bytes:
    """The bytes of a file. The same card and tensors give the same bytes."""
    cpu = {name: tensor.detach().cpu().contiguous() for name, tensor in sorted(tensors.items())}
    envelope = _Envelope(format=format_name, version=1, sha256=_digest(card, cpu), card=card)
    return safetensors.torch.save(cpu, {MODEL_KEY: envelope.model_dump_json()})


def unpack(path: Path, format_name: str, what: str, data: bytes | None = None) -> tuple[str, dict[str, Tensor]]:
    """The card and the tensors of a file written by `pack`; `what` names its role ("a model file"), `data` are its
    bytes, if they have been read.

    Raises DataError for a file that is missing, damaged, not of this format or of another version of it.
    """
    data = read_bytes(path, what, limit=MAX_FILE_BYTES) if data is None else data
    text = _metadata(data, path, what)
    _check_format(text, path, format_name, what)
    try:
        envelope = _Envelope.model_validate_json(text)
        tensors = safetensors.torch.load(data)
        intact = all(tensor.dtype in _TYPES for tensor in tensors.values())
        intact = intact and _digest(envelope.card, tensors) == envelope.sha256
    except Exception as error:  # whatever a parser says to a hostile file, the answer is the same
        raise _damage_error(path, what) from error
    if not intact:
        raise _damage_error(path, what)
    return envelope.card, tensors


def _metadata(data: bytes, path: Path, what: str) -> str:
    """The envelope's text, read from the safetensors header: its length (8 bytes, little-endian), then JSON."""
    foreign = NOT_A_MODEL(path=path, what=what)
    length = int.from_bytes(data[:8], "little")
    if len(data) < 10 or length > len(data) - 8 or data[8:9] != b"{":
        # The start of one of ours, cut short, is damage rather than a foreign file.
        raise _damage_error(path, what) if f'"{MODEL_KEY}"'.encode() in data[8:64] else DataError(foreign)
    try:
        header: Any = from_json(data[8 : 8 + length])
    except ValueError as error:
        raise DataError(foreign) from error
    extra = header.get("__metadata__") if isinstance(header, dict) else None
    text = extra.get(MODEL_KEY) if isinstance(extra, dict) else None
    if not isinstance(text, str):
        raise DataError(foreign)
    return text


def _check_format(text: str, path: Path, format_name: str, what: str) -> None:
    try:
        envelope: Any = from_json(text)
    except ValueError as error:
        raise _damage_error(path, what) from error
    if not isinstance(envelope, dict) or envelope.get("format") != format_name:
        raise DataError(NOT_A_MODEL(path=path, what=what))
    version = envelope.get("version")
    if isinstance(version, int) and version != 1:
        raise DataError(MODEL_VERSION(path=path, found=version, format=format_name))


def read_card(kind: type[Card], text: str, path: Path, what: str) -> Card:
    """The card as a pydantic model. Raises DataError with the first thing that is wrong with it."""
    try:
        return kind.model_validate_json(text)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the card"
        raise DataError(DAMAGED_MODEL(path=path, what=what, reason=f"{place}: {first['msg'].lower()}")) from error


def _damage_error(path: Path, what: str) -> DataError:
    return DataError(DAMAGED_MODEL(path=path, what=what))


def _digest(card: str, tensors: Mapping[str, Tensor]) -> str:
    digest = hashlib.sha256(card.encode())
    for name, tensor in sorted(tensors.items()):
        digest.update(f"\0{name}\0{tensor.dtype}\0{tuple(tensor.shape)}\0".encode())
        digest.update(tensor.numpy().tobytes())
    return digest.hexdigest()


MODEL_FILE = "a model file"


REGION = "region."  # begins the names of tensors that are no weights: how phi is distributed
NUMBERS, SCENES = 1 << 16, 4096  # numbers of these in a file, and scenes of one region, at most


def tensors_of(
    model: SceneModel, regions: Sequence[Array] = (), weights: Mapping[str, Tensor] | None = None
) -> dict[str, Tensor]:
    """What a model file holds: the sampler's weights, or `weights` in their place. See TrainedModel for `regions`."""
    most = max(1, min(SCENES, NUMBERS // max(1, sum(len(one) for one in regions))))
    kept = {
        f"{REGION}{number:04}": torch.from_numpy(one[:, : 2 + most]).to(torch.float32)
        for number, one in enumerate(regions)
    }
    return {**(weights or model.sampler_state()), **kept}


def pack_model(model: SceneModel, card: ModelCard, regions: Sequence[Array] = ()) -> bytes:
    """The bytes of a model file."""
    return pack(MODEL_FORMAT, card.model_dump_json(), tensors_of(model, regions))


def save_model(path: Path, model: SceneModel, card: ModelCard, regions: Sequence[Array] = ()) -> None:
    """Write a model file, whole or not at all. The same model and card give the same bytes. Raises OutputError."""
    write_whole(path, pack_model(model, card, regions))


def load_model(
    path: Path, spec: CheckedSpec | None = None, *, device: str = "cpu", data: bytes | None = None
) -> TrainedModel:
    """Read a model file, or `data`, its bytes; with `spec`, insist that the model was trained on it.

    Raises DataError for a file that is missing, damaged, not a model, of another version, whose weights do not fit what
    it says of itself or are not finite, that contradicts itself, or that was trained on another spec.
    """
    text, tensors = unpack(path, MODEL_FORMAT, MODEL_FILE, data)
    card = read_card(ModelCard, text, path, MODEL_FILE)
    if spec is not None:
        check_spec(card, spec, path)
    return as_trained(card, tensors, path, device)


def as_trained(
    card: ModelCard, tensors: dict[str, Tensor], path: Path, device: str = "cpu", stop: Stop = NEVER
) -> TrainedModel:
    """The model of a file's card and tensors. Raises DataError as `load_model` does, and what `stop` raises."""
    try:
        kind = model_class(card.model if card.recipe == "default" else f"{card.recipe}-{card.model}")
        # Made on the meta device: sizes that the card merely claims cost nothing until the weights have shown them.
        hyper = card.hyper if card.corrected else {**kind.before, **card.hyper}
        model = kind(card.sizes, kind.hyper_class.model_validate(hyper))
        model.drop_training_parts()
        regions = [tensors.pop(name) for name in sorted(tensors) if name.startswith(REGION)]
        if not all(_is_region(one, len(card.labels)) for one in regions):
            raise DataError(DAMAGED_MODEL(weights=REGION, reason="are no table of phi"))
        model.load_weights(tensors)
    except ValidationError as error:
        place = ".".join(str(part) for part in error.errors()[0]["loc"])
        raise DataError(DAMAGED_MODEL(path=path, model=card.model, name=place)) from error
    except ScenegenError as error:
        first = error.diagnostics[0].but(path=path)
        raise DataError(first) from error
    model.to(torch.device(device)).eval()
    # the canonical text has no comments, so the title comes from the card
    spec = replace(check_text(card.spec.source, card.spec.name), title=card.spec.title)
    _refuse_contradictions(card, spec)
    model.bind(spec, stop)
    found = TrainedModel(model, card, spec, regions=tuple(one.double().numpy() for one in regions))
    if not card.corrected:
        return found
    ends = found.label_ranges.values()
    spans = torch.tensor([high - low for low, high in ends])
    tops = torch.tensor([max(0.0, high) if low < 0.0 else 0.0 for low, high in ends])
    return replace(found, correction=Correction(spec, spans, tops, thorough=kind.thorough))


def _refuse_contradictions(card: ModelCard, spec: CheckedSpec) -> None:
    """Objects, labels and workspace of the card are the spec's. Raises DataError for a file that was put together by
    hand."""
    area = spec.workspace
    pairs = {
        "objects": (tuple(card.objects), spec.objects),
        "layout": (card.sizes.objects, len(spec.core.objects)),
        "labels": (tuple(label.name for label in card.labels), spec.labels),
        "workspace": (card.area, Workspace(area.x, area.y)),
    }
    for what, (told, true) in pairs.items():
        if told != true:
            raise DataError(DAMAGED_MODEL(told=what))


def _is_region(found: Tensor, labels: int) -> bool:
    fits = found.ndim == 2 and len(found) == labels and found.shape[1] > 2 and found.dtype == torch.float32
    return fits and not bool(found.isnan().any())


def check_spec(card: ModelCard, spec: CheckedSpec, path: Path) -> None:
    """Raises DataError unless the model was trained on this very spec (canonical text, layout aside)."""
    if card.spec.sha256 == spec.sha256:
        return
    hashes = {"hash_found": card.spec.sha256[:12], "hash_wanted": spec.sha256[:12]}
    raise DataError(MODEL_OF_ANOTHER_SPEC(path=path, found=card.spec.name, wanted=spec.name, **hashes))


# Trained models.


MOST_STEPS = 1000
LEAST_MOVES, MOST_MOVES, EACH = (
    24,
    256,
    2,
)  # moves within the range that was asked for: so many for each node of the formula
SAMPLED_AT_ONCE = 2048  # scenes that a network makes at a time: its layers stay in cache


@dataclass(frozen=True, eq=False)
class TrainedModel:
    """A network with the model file's metadata and the spec that it was trained on, which the file holds. `correction`
    is the last step of a scene. `regions` say how phi is distributed: each is (L, 2 + m), the lowest
    and the highest phi of a part of all scenes, infinite where it has no end, and the phi of m scenes as they occur
    there. Files of earlier versions have none.

    It is the proposer (scenegen.sampling.proposer) that a plan draws from: asked for phi of the labels of `only`, the
    others are left free where the model can do that; none stands for all. Pickled, it is the bytes of its file.
    """

    model: SceneModel
    card: ModelCard
    spec: CheckedSpec
    correction: Correction | None = None
    regions: tuple[Array, ...] = ()
    only: tuple[str, ...] = ()

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickle, (self.name, self.data, self.steps, self.only)

    @cached_property
    def codec(self) -> Codec:
        """The map to poses."""
        return Codec(self.spec.workspace, self.card.sizes.objects)

    @cached_property
    def data(self) -> bytes:
        """The model file."""
        return pack_model(self.model, self.card, self.regions)

    @property
    def digest(self) -> str:
        """A hash of everything that the proposals depend on."""
        return hashlib.sha256(self.data + str((self.steps, self.only)).encode()).hexdigest()

    @property
    def info(self) -> Mapping[str, object]:
        """What scene files say about it in addition to its name."""
        return {} if self.steps is None else {"steps": self.steps}

    @property
    def name(self) -> str:
        """The model's name in MODELS."""
        return self.card.model

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(self.card.objects)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(label.name for label in self.card.labels)

    @property
    def label_ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest phi of each label in the training data: what the model has seen."""
        return {label.name: (label.lowest, label.highest) for label in self.card.labels}

    @property
    def steps(self) -> int | None:
        """In how many evaluations of its network it makes a scene, where that can be chosen."""
        found: int | None = getattr(self.model, "steps", None)
        return found

    def in_steps(self, steps: int) -> TrainedModel:
        """The same network, taken in another number of steps. Raises RequestError where there is no such choice."""
        if self.steps is None:
            raise RequestError(STEPS_FIXED(model=self.name))
        steps = as_int("steps", steps)
        if not 1 <= steps <= MOST_STEPS:
            wanted, hint = f"from 1 to {MOST_STEPS:,}", "1 is the fastest"
            raise RequestError(OUT_OF_RANGE(argument="steps", value=steps, wanted=wanted, hint=hint))
        model: Any = copy.copy(self.model)  # shares the weights
        model.steps = steps
        return replace(self, model=model)

    @property
    def partial(self) -> bool:
        """Whether labels can be left free."""
        return self.card.sizes.partial

    def with_free_labels(self, phi: Tensor, labels: Collection[str]) -> Tensor:
        """Wanted phi (L, n) with all other labels left free, as far as the model can do that."""
        free = [place for place, label in enumerate(self.labels) if label not in labels]
        if not self.partial or len(free) == len(self.labels):
            return phi
        return phi.index_fill(0, torch.tensor(free, dtype=torch.int64), torch.nan)

    @property
    def network(self) -> TrainedModel:
        """The network alone."""
        return replace(self, correction=None)

    def _sample_network(
        self, phi: Tensor, generator: torch.Generator, branch: Tensor | None, stop: Stop
    ) -> tuple[Tensor, Tensor | None]:
        """Scenes (3N, n), and the branches (n,) that they were made in, where the model has any: those that are given,
        or drawn."""
        alike = phi[:, :1].expand_as(phi) if phi.shape[1] > 1 and bool(_same(phi, phi[:, :1]).all()) else phi
        parts = torch.split(alike, SAMPLED_AT_ONCE, dim=1)
        given = [None] * len(parts) if branch is None else torch.split(branch, SAMPLED_AT_ONCE)
        found = [
            self.model.sample_in(part.shape[1], part.T, generator, mine, stop)
            for part, mine in zip(parts, given, strict=True)
        ]
        scenes = self.codec.decode(torch.cat([each for each, _ in found])).cpu()
        branches = [mine for _, mine in found if mine is not None]
        return scenes, torch.cat(branches) if branches else None

    @torch.no_grad()
    def propose(self, phi: Tensor, generator: torch.Generator, stop: Stop = NEVER) -> Tensor:
        """One scene per column of `phi` (L, n), labels in order, in metres and radians -> rows (3N, n) float32.

        NaN leaves a label free, where the model is `partial`. Centres lie in the workspace, theta in [0, 2 pi), phi
        only roughly where it was wanted, also after the correction. Labels outside `label_ranges` reach the network as
        they are; what it makes of them is extrapolation. `generator` lives on the model's device, and alone decides the
        outcome. Raises what `stop` raises.
        """
        if phi.ndim != 2 or phi.shape[0] != len(self.card.labels):
            wanted = f"({len(self.card.labels)}, n), one row a label"
            raise DataError(WRONG_SHAPE(what="phi", found=str(tuple(phi.shape)), wanted=wanted))
        if not self.partial and bool(torch.isnan(phi).any()):
            raise DataError(ARRAY_NOT_FINITE(what=f"phi for a {self.name} that has to be told every label"))
        phi = phi.to(torch.float32)
        correction = self.correction
        rows = (
            correction(self._sample_network, phi, generator, stop)
            if correction
            else self._sample_network(phi, generator, None, stop)[0]
        )
        if not bool(torch.isfinite(rows.sum())):
            remedy = "the model file is damaged; train it again"
            raise DataError(ARRAY_NOT_FINITE(what="the model's output", remedy=remedy))
        return rows

    def mix(
        self, rows: Tensor, ends: tuple[Tensor, Tensor], box: tuple[Array, Array], seed: int, stop: Stop = NEVER
    ) -> Tensor:
        """See scenegen.sampling.proposer."""
        labels = len(self.card.labels)
        if self.correction is None or len(ends[0]) != labels:  # labels that were added are not known here
            return rows
        walk = McmcMoves(self.spec, torch.zeros(labels, 1), box)
        old, low, high = (one.to(torch.float32) for one in (rows, *ends))
        moves = max(LEAST_MOVES, min(MOST_MOVES, EACH * len(self.spec.core.nodes)))
        random = torch.Generator().manual_seed(seed)
        new = walk.move_within(old, (low, high), random, moves if walk.moving else 0, fit=True, stop=stop)
        return torch.where(new == old, rows, new.to(rows.dtype))

    def __call__(self, phi: Tensor, generator: torch.Generator, stop: Stop = NEVER) -> Tensor:
        """See scenegen.sampling.proposer."""
        return self.propose(self.with_free_labels(phi[: len(self.card.labels)], self.only), generator, stop)


def _same(a: Tensor, b: Tensor) -> Tensor:
    return (a == b) | (torch.isnan(a) & torch.isnan(b))


@lru_cache(maxsize=2)  # of a process: it reads a plan again for every piece
def _unpickle(name: str, data: bytes, steps: int | None, only: tuple[str, ...]) -> TrainedModel:
    found = replace(load_model(Path(f"the {name}"), data=data), only=only)
    return found if steps is None else found.in_steps(steps)
