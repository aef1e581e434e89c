"""The table of models. A new one is one file and one line here; the contract test picks it up."""

from __future__ import annotations

import importlib
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from pydantic import ValidationError

from scenegen.errors import Diagnostic, RequestError, quoted, suggest

if TYPE_CHECKING:
    from scenegen.models.base import Hyper, SceneModel

# Text, not classes: `scenegen train --help` lists them without importing torch.
MODELS: dict[str, str] = {
    "gan": "scenegen.models.gan:GAN",
    "aae": "scenegen.models.aae:AAE",
    "energy": "scenegen.models.energy:Energy",
    "flow": "scenegen.models.flow:Flow",
}
PUBLISHED: dict[str, str] = {
    "gan": "scenegen.models.published.gan:GAN",
    "aae": "scenegen.models.published.aae:AAE",
}
RECIPES: dict[str, dict[str, str]] = {"default": MODELS, "paper": PUBLISHED}


def model_class(name: str, recipe: str = "default") -> type[SceneModel]:
    """The class of a model by name. Raises RequestError, with the nearest name, for a model or recipe there is not."""
    if recipe not in RECIPES:
        raise RequestError(unknown("recipe", recipe, RECIPES))
    table = RECIPES[recipe]
    if name not in table:
        raise RequestError(unknown("model" if name not in MODELS else f"model of the {recipe} recipe", name, table))
    module, _, attribute = table[name].partition(":")
    found: type[SceneModel] = getattr(importlib.import_module(module), attribute)
    return found


def unknown(what: str, name: str, known: Collection[str]) -> Diagnostic:
    """What to say of a name that a table does not have."""
    return Diagnostic(f"unknown {what} `{name}`", help=suggest(str(name), known, f"the {what}s are {quoted(known)}"))


def parse_hyper(name: str, values: Mapping[str, float], recipe: str = "default") -> Hyper:
    """The model's own settings, checked. Raises RequestError for an unknown setting or a value out of its range."""
    settings = model_class(name, recipe).hyper_class
    if not isinstance(values, Mapping):
        raise RequestError(Diagnostic(f"`hyper` is {values!r}", help='give settings by name: hyper={"width": 128}'))
    try:
        return settings.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        otherwise = f"`{name}` has settings {quoted(settings.model_fields)}"
        if first["type"] == "extra_forbidden":
            help_ = suggest(place, settings.model_fields, otherwise)
            raise RequestError(Diagnostic(f"model `{name}` has no setting `{place}`", help=help_)) from error
        raise RequestError(
            Diagnostic(f"setting `{place}` of model `{name}`: {first['msg'].lower()}", help=otherwise)
        ) from error
