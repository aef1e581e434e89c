"""Files of suites, outcomes and fits: frozen models of JSON, some with a digest of their own bytes; and the header of a
file of outcomes, which a fit keeps."""

from __future__ import annotations

import hashlib
from operator import not_
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scenegen.errors import DataError
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.scenes.files import read_bytes
from scenegen.scenes.sets import Sha256

BLANK_DIGEST = "0" * 64  # what the digest is computed with in its own place
Instruction = Literal["own", "empty"]
Letter = Literal["A", "B"]  # what a policy is called where nobody who sets and judges may know which it is
Model = TypeVar("Model", bound=BaseModel)


class FileModel(BaseModel):
    """A part of such a file."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)


class OutcomesHeader(FileModel, extra="allow"):
    """The first line: which suite, world and policy; `episodes` is the number of starts of the suite. `steps` and
    `timeout`, in seconds, are the most that an episode had; `versions` those of scenegen and of the world's package;
    old files have none of these. `order` is the SHA-256 of the file that put episodes into an order, `blind` what the
    policy was called there. What else a program has put into a line stays there."""

    format: Literal["scenegen/outcomes"] = "scenegen/outcomes"
    version: Literal[1] = 1
    suite: str
    digest: Sha256
    world: str
    policy: str
    instruction: Instruction = "own"
    reverse: bool = False
    episodes: Annotated[int, Field(ge=1)]
    steps: int | None = Field(default=None, exclude_if=not_)
    timeout: float | None = Field(default=None, exclude_if=not_)
    versions: dict[str, str] | None = Field(default=None, exclude_if=not_)
    order: Sha256 | None = Field(default=None, exclude_if=not_)
    blind: Letter | None = Field(default=None, exclude_if=not_)


def dump_with_digest(model: BaseModel) -> bytes:
    """A model as JSON, its field `digest` the SHA-256 of these bytes with BLANK_DIGEST in its place."""
    text = model.model_copy(update={"digest": BLANK_DIGEST}).model_dump_json(indent=1).encode() + b"\n"
    return text.replace(BLANK_DIGEST.encode(), hashlib.sha256(text).hexdigest().encode(), 1)


def load_model(model: type[Model], data: bytes, file: Path | str, what: str) -> Model:
    """What some bytes of JSON hold. Raises DataError; `what` says what was expected of the file."""
    try:
        return model.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where, said = ".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, ")
        said = said[:1].lower() + said[1:]
        reason = f"`{where}`: {said}" if where else said
        raise DataError(NOT_A_SUITE(file=file, what=what, reason=reason)) from None


def load_with_digest(model: type[Model], path: Path, role: str, what: str) -> Model:
    """What a file holds that `dump_with_digest` wrote. Raises DataError, also for bytes that are not those."""
    data = read_bytes(path, role)
    found = load_model(model, data, path, what)
    digest: str = vars(found)["digest"]
    if hashlib.sha256(data.replace(digest.encode(), BLANK_DIGEST.encode(), 1)).hexdigest() != digest:
        raise DataError(NOT_A_SUITE(file=path, what=what, reason="it does not have the digest that it says"))
    return found
