"""The settings of a strategy, and the errors for wrong ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_SETTING, WRONG_SETTING


class Settings(BaseModel):
    """The settings of all strategies; subclasses add fields with defaults and bounds.

    `labels`: positions, in the spec's order, of the labels that the curriculum controls. The others have their whole
    range. None is all labels.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    labels: tuple[int, ...] | None = Field(default=None, min_length=1)


Some = TypeVar("Some", bound=Settings)


def checked(kind: type[Some], owner: str, values: Mapping[str, object]) -> Some:
    """The settings of strategy `owner`. Raises RequestError for an unknown one or a value out of its range."""
    try:
        return kind.model_validate(dict(values))
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0]) if first["loc"] else ""
        known, of = tuple(kind.model_fields), f"strategy `{owner}`"
        if first["type"] == "extra_forbidden":
            raise RequestError(UNKNOWN_SETTING(owner=of, name=name, known=known)) from error
        message = first["msg"].removeprefix("Value error, ")
        if name not in known:  # an error about several settings together
            raise RequestError(WRONG_SETTING(owner=of, reason=message, name="", known=known)) from error
        reason, usual = f"{message[:1].lower()}{message[1:]}", str(kind.model_fields[name].default)
        raise RequestError(WRONG_SETTING(owner=of, name=name, reason=reason, usual=usual)) from error
