"""What can be set in a strategy, and what is said of settings that are wrong."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scenegen.errors import Diagnostic, RequestError, quoted, suggest


class Settings(BaseModel):
    """What all strategies have; subclasses add fields with defaults and bounds.

    `labels`: positions, in the spec's order, of the labels that the curriculum is about. The others are asked for in
    all of their reach. None is all labels.
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
        all_of_them = f"`{owner}` has settings {quoted(kind.model_fields)}"
        if first["type"] == "extra_forbidden":
            title = f"strategy `{owner}` has no setting `{name}`"
            raise RequestError(Diagnostic(title, help=suggest(name, kind.model_fields, all_of_them))) from error
        message = first["msg"].removeprefix("Value error, ")
        if name not in kind.model_fields:  # of several settings together
            raise RequestError(Diagnostic(f"strategy `{owner}`: {message}", help=all_of_them)) from error
        title = f"setting `{name}` of strategy `{owner}`: {message[:1].lower()}{message[1:]}"
        raise RequestError(
            Diagnostic(title, help=f"by default `{name}` is {kind.model_fields[name].default}")
        ) from error
