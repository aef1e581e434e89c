"""The table of models. A new one is one file and one line here; the contract test picks it up."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE, UNKNOWN_SETTING, WRONG_SETTING, WRONG_VALUE

if TYPE_CHECKING:
    from scenegen.learn.models.base import Hyper, SceneModel

# Text, not classes: `scenegen train --help` lists them without importing torch.
MODELS: dict[str, str] = {
    "gan": "scenegen.learn.models.games:GAN",
    "aae": "scenegen.learn.models.games:AAE",
    "flow": "scenegen.learn.models.flow:Flow",
    "any": "scenegen.learn.models.graph_flow:GraphFlow",
}


def model_class(name: str) -> type[SceneModel]:
    """The class of a model by name. Raises RequestError, with the nearest name, for a model there is not."""
    if name not in MODELS:
        raise RequestError(UNKNOWN_CHOICE(what="model", name=name, known=MODELS))
    module, _, attribute = MODELS[name].partition(":")
    model: type[SceneModel] = getattr(importlib.import_module(module), attribute)
    return model


def parse_hyper(name: str, values: Mapping[str, float]) -> Hyper:
    """The model's own settings, checked. Raises RequestError for an unknown setting or a value out of its range."""
    from pydantic import ValidationError

    settings = model_class(name).hyper_class
    if not isinstance(values, Mapping):
        wanted = 'settings by name: hyper={"width": 128}'
        raise RequestError(WRONG_VALUE(argument="hyper", value=repr(values), wanted=wanted))
    try:
        return settings.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        of, known = f"model `{name}`", tuple(settings.model_fields)
        if first["type"] == "extra_forbidden":
            raise RequestError(UNKNOWN_SETTING(owner=of, name=place, known=known)) from error
        raise RequestError(WRONG_SETTING(owner=of, name=place, reason=first["msg"].lower(), known=known)) from error
