"""The table of models. A new one is one file and one line here; the contract test picks it up."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pydantic import ValidationError

from scenegen.errors import Diagnostic, RequestError, quoted, suggest

if TYPE_CHECKING:
    from scenegen.models.base import Hyper, SceneModel

# Text, not classes: `scenegen train --help` lists them without importing torch.
MODELS: dict[str, str] = {
    "gan": "scenegen.models.gan:GAN",
    "aae": "scenegen.models.aae:AAE",
}


def model_class(name: str) -> type[SceneModel]:
    """The class of a model by name. Raises RequestError, with the nearest name, for a name that is not in MODELS."""
    if name not in MODELS:
        otherwise = f"the models are {quoted(MODELS)}"
        raise RequestError(Diagnostic(f"unknown model `{name}`", help=suggest(name, MODELS, otherwise)))
    module, _, attribute = MODELS[name].partition(":")
    found: type[SceneModel] = getattr(importlib.import_module(module), attribute)
    return found


def parse_hyper(name: str, values: Mapping[str, float]) -> Hyper:
    """The model's own settings, checked. Raises RequestError for an unknown setting or a value out of its range."""
    settings = model_class(name).hyper_class
    try:
        return settings.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        known = quoted(settings.model_fields)
        raise RequestError(
            Diagnostic(
                f"setting `{place}` of model `{name}`: {first['msg'].lower()}", help=f"`{name}` has settings {known}"
            )
        ) from error
