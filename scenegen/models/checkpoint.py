"""Model files: safetensors with the sampler's weights and a JSON card. Loading one runs no code of its author."""

from __future__ import annotations

from pathlib import Path

import torch
from pydantic import ValidationError

from scenegen.errors import DataError, ScenegenError
from scenegen.errors.models import MODEL_OF_ANOTHER_SPEC, MODEL_SETTING
from scenegen.formats.files import write_whole
from scenegen.lang.spec import CheckedSpec
from scenegen.models.base import SceneModel
from scenegen.models.card import FORMAT, ModelCard
from scenegen.models.codec import Codec
from scenegen.models.registry import model_class
from scenegen.models.safefile import pack, read_card, unpack
from scenegen.models.trained import TrainedModel

WHAT = "a model file"


def save_model(path: Path, model: SceneModel, card: ModelCard) -> None:
    """Write a model file, whole or not at all. The same model and card give the same bytes. Raises OutputError."""
    write_whole(path, packed(model, card))


def packed(model: SceneModel, card: ModelCard) -> bytes:
    """The bytes of a model file."""
    return pack(FORMAT, card.model_dump_json(), model.sampler_state())


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
        model.load_weights(tensors)
    except ValidationError as error:
        place = ".".join(str(part) for part in error.errors()[0]["loc"])
        raise DataError(MODEL_SETTING(path=path, model=card.model, name=place)) from error
    except ScenegenError as error:
        first = error.diagnostics[0].but(path=path)
        raise DataError(first) from error
    model.to(torch.device(device)).eval()
    return TrainedModel(model, Codec(card.area, card.sizes.objects), card)


def check_spec(card: ModelCard, spec: CheckedSpec, path: Path) -> None:
    """Raises DataError unless the model was trained on this very spec (canonical text, layout aside)."""
    if card.spec.sha256 == spec.sha256:
        return
    hashes = {"hash_found": card.spec.sha256[:12], "hash_wanted": spec.sha256[:12]}
    raise DataError(MODEL_OF_ANOTHER_SPEC(path=path, found=card.spec.name, wanted=spec.name, **hashes))
