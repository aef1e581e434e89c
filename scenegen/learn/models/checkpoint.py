"""Model files: safetensors with the sampler's weights and a JSON card. Loading one runs no code of its author."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeVar

import safetensors.torch
import torch
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json
from torch import Tensor

from scenegen.errors import DataError, ScenegenError
from scenegen.errors.learning import DAMAGED_MODEL, MODEL_OF_ANOTHER_SPEC, MODEL_VERSION, NOT_A_MODEL
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.base import SceneModel
from scenegen.learn.models.card import FORMAT, ModelCard
from scenegen.learn.models.codec import Codec
from scenegen.learn.models.registry import model_class
from scenegen.learn.models.trained import TrainedModel
from scenegen.scenes.files import read_bytes, write_whole

# --------------------------------------------------------------------------------------------------------------------
# Tensors and text in one safetensors file, read with distrust.
#
# The text (a JSON card) travels in safetensors' own metadata, in an envelope with the format's name, its version and
# a SHA-256 over text and tensors: a damaged file is recognised before anything in it is used. Nothing is ever
# unpickled, and nothing larger than the file itself is allocated.


KEY = "scenegen"  # the one entry of safetensors' metadata; a single entry keeps the file's bytes reproducible
Card = TypeVar("Card", bound=BaseModel)

LIMIT = 512 * 2**20  # bytes of a file that is read at all
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
    return safetensors.torch.save(cpu, {KEY: envelope.model_dump_json()})


def unpack(path: Path, format_name: str, what: str, data: bytes | None = None) -> tuple[str, dict[str, Tensor]]:
    """The card and the tensors of a file written by `pack`; `what` names its role ("a model file"), `data` are its
    bytes, if they have been read.

    Raises DataError for a file that is missing, damaged, not of this format or of another version of it.
    """
    data = read_bytes(path, what, limit=LIMIT) if data is None else data
    text = _metadata(data, path, what)
    _check_format(text, path, format_name, what)
    try:
        envelope = _Envelope.model_validate_json(text)
        tensors = safetensors.torch.load(data)
        intact = all(tensor.dtype in _TYPES for tensor in tensors.values())
        intact = intact and _digest(envelope.card, tensors) == envelope.sha256
    except Exception as error:  # whatever a parser says to a hostile file, the answer is the same
        raise _damaged(path, what) from error
    if not intact:
        raise _damaged(path, what)
    return envelope.card, tensors


def _metadata(data: bytes, path: Path, what: str) -> str:
    """The envelope's text, read from the safetensors header: its length (8 bytes, little-endian), then JSON."""
    foreign = NOT_A_MODEL(path=path, what=what)
    length = int.from_bytes(data[:8], "little")
    if len(data) < 10 or length > len(data) - 8 or data[8:9] != b"{":
        # The start of one of ours, cut short, is damage rather than a foreign file.
        raise _damaged(path, what) if f'"{KEY}"'.encode() in data[8:64] else DataError(foreign)
    try:
        header: Any = from_json(data[8 : 8 + length])
    except ValueError as error:
        raise DataError(foreign) from error
    extra = header.get("__metadata__") if isinstance(header, dict) else None
    text = extra.get(KEY) if isinstance(extra, dict) else None
    if not isinstance(text, str):
        raise DataError(foreign)
    return text


def _check_format(text: str, path: Path, format_name: str, what: str) -> None:
    try:
        envelope: Any = from_json(text)
    except ValueError as error:
        raise _damaged(path, what) from error
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


def _damaged(path: Path, what: str) -> DataError:
    return DataError(DAMAGED_MODEL(path=path, what=what))


def _digest(card: str, tensors: Mapping[str, Tensor]) -> str:
    digest = hashlib.sha256(card.encode())
    for name, tensor in sorted(tensors.items()):
        digest.update(f"\0{name}\0{tensor.dtype}\0{tuple(tensor.shape)}\0".encode())
        digest.update(tensor.numpy().tobytes())
    return digest.hexdigest()


WHAT = "a model file"


REGION = "region."  # begins the names of tensors that are no weights: how phi is distributed
NUMBERS, SCENES = 1 << 16, 4096  # numbers of these in a file, and scenes of one region, at most


def save_model(path: Path, model: SceneModel, card: ModelCard, regions: Sequence[Tensor] = ()) -> None:
    """Write a model file, whole or not at all. The same model and card give the same bytes. Raises OutputError."""
    write_whole(path, packed(model, card, regions))


def packed(
    model: SceneModel, card: ModelCard, regions: Sequence[Tensor] = (), weights: Mapping[str, Tensor] | None = None
) -> bytes:
    """The bytes of a model file; with `weights` instead of the model's own. See TrainedModel for `regions`."""
    most = max(1, min(SCENES, NUMBERS // max(1, sum(len(one) for one in regions))))
    kept = {f"{REGION}{number:04}": one[:, : 2 + most] for number, one in enumerate(regions)}
    return pack(FORMAT, card.model_dump_json(), {**(weights or model.sampler_state()), **kept})


def load_model(
    path: Path, spec: CheckedSpec | None = None, *, device: str = "cpu", data: bytes | None = None
) -> TrainedModel:
    """Read a model file, or `data`, its bytes; with `spec`, insist that the model was trained on it.

    Raises DataError for a file that is missing, damaged, not a model, of another version, whose weights do not fit what
    it says of itself or are not finite, or that was trained on another spec.
    """
    text, tensors = unpack(path, FORMAT, WHAT, data)
    card = read_card(ModelCard, text, path, WHAT)
    if spec is not None:
        check_spec(card, spec, path)
    try:
        kind = model_class(card.model, card.recipe)
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
    return TrainedModel(model, Codec(card.area, card.sizes.objects), card, regions=tuple(regions))


def _is_region(found: Tensor, labels: int) -> bool:
    fits = found.ndim == 2 and len(found) == labels and found.shape[1] > 2 and found.dtype == torch.float32
    return fits and not bool(found.isnan().any())


def check_spec(card: ModelCard, spec: CheckedSpec, path: Path) -> None:
    """Raises DataError unless the model was trained on this very spec (canonical text, layout aside)."""
    if card.spec.sha256 == spec.sha256:
        return
    hashes = {"hash_found": card.spec.sha256[:12], "hash_wanted": spec.sha256[:12]}
    raise DataError(MODEL_OF_ANOTHER_SPEC(path=path, found=card.spec.name, wanted=spec.name, **hashes))
