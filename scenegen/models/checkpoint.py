"""Model files: safetensors with the sampler's weights and a JSON card. Loading one runs no code of its author."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from pydantic import ValidationError
from torch import Tensor

from scenegen.errors import DataError, ScenegenError
from scenegen.errors.models import MODEL_OF_ANOTHER_SPEC, MODEL_SETTING, WEIGHTS_MISFIT
from scenegen.formats.files import write_whole
from scenegen.lang.spec import CheckedSpec
from scenegen.models.base import SceneModel
from scenegen.models.card import FORMAT, ModelCard
from scenegen.models.codec import Codec
from scenegen.models.registry import model_class
from scenegen.models.safefile import pack, read_card, unpack
from scenegen.models.trained import TrainedModel

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
            raise DataError(WEIGHTS_MISFIT(name=REGION, reason="are no table of phi"))
        model.load_weights(tensors)
    except ValidationError as error:
        place = ".".join(str(part) for part in error.errors()[0]["loc"])
        raise DataError(MODEL_SETTING(path=path, model=card.model, name=place)) from error
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
