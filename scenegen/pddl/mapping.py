"""MAP.toml: what a user says of kinds of things and of predicates."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from scenegen.errors import DataError
from scenegen.errors.planning import BAD_MAP
from scenegen.formats.files import read_bytes

MAX_BYTES = 1_000_000


class Map(BaseModel):
    """`objects`: the shape of a thing by its name or kind, as the language writes it. `predicates`: a formula in which
    $1 and $2 are the arguments, or `on`, `in` or `none`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    objects: dict[str, str] = {}
    predicates: dict[str, str] = {}


def read_map(path: Path) -> Map:
    """Raises DataError for what is no map."""
    data = read_bytes(path, "a map", limit=MAX_BYTES)
    try:
        return Map.model_validate(tomllib.loads(data.decode("utf-8-sig")))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise DataError(BAD_MAP(file=path, reason=f"{error}".splitlines()[0])) from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise DataError(BAD_MAP(file=path, reason=f"{place}: {first['msg'].lower()}")) from None


def key(name: str) -> str:
    """A name as the key of a map: TOML has quotes round all but letters, digits, `-` and `_`."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)
