"""Opens the store of a set, where pyarrow is installed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenegen.errors import RequestError
from scenegen.errors.requests import NOT_INSTALLED

if TYPE_CHECKING:
    from scenegen.scenes.stores import Store, Tell


def open_store(location: str, tell: Tell | None = None) -> Store:
    """The store at a path or URL; `tell` hears of failures that are tried again. Raises RequestError without
    pyarrow, DataError for a URL that nothing can open."""
    try:
        from scenegen.scenes.stores import store_at
    except ModuleNotFoundError as error:
        command = 'pip install "scenegen[parquet]"'
        raise RequestError(NOT_INSTALLED(package="pyarrow", purpose="for sets of scenes", command=command)) from error
    return store_at(location, tell)
