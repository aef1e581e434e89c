"""The features of the language server for the page's editor: hover, completion, definition, format, symbols."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from scenegen.editors.lsp.answers import Page, Question, answer
from scenegen.editors.lsp.document import Document
from scenegen.errors import RequestError
from scenegen.errors.program import NO_MESSAGE
from scenegen.resources import grammar_file
from scenegen.show.view.jobs.source import path_of

FEATURES = ("hover", "completion", "definition", "formatting", "symbols")


def assist(message: dict[str, Any]) -> Iterator[Any]:
    """The answer to one question, as the Language Server Protocol has it."""
    feature = message.get("feature")
    if feature not in FEATURES:
        raise RequestError(NO_MESSAGE(reason="an unknown feature"))
    line, character = int(message.get("line", 0)), int(message.get("character", 0))
    found = answer(page_of(message), Question(str(feature), line, character))
    yield _located(found, Path(message["root"])) if feature == "definition" and found else found


def _located(found: dict[str, Any], root: Path) -> dict[str, Any]:
    """A place with what the page can open of it: the `path` of a file in the folder, or whether it is the prelude."""
    file = Path(unquote(urlsplit(found["uri"]).path)).resolve()
    inside = file.is_relative_to(root.resolve())
    return {
        "range": found["range"],
        "name": file.name,
        "path": file.relative_to(root.resolve()).as_posix() if inside else None,
        "prelude": file == grammar_file("prelude.spec").resolve(),
    }


def page_of(message: dict[str, Any]) -> Page:
    """The text of a message as the language server's features take it."""
    path, text, root = path_of(message), str(message["text"]), Path(message["root"])
    if "import" in text:
        return _page(path, text, root)
    return _kept(path, text, root)


def _page(path: Path, text: str, root: Path) -> Page:
    return Page(Document(text, path, root=root), path.as_uri())


_kept = lru_cache(maxsize=2)(_page)
