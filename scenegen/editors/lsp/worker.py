"""The program that analyses one open document for the language server, message by message, a line each.

`{"text": ..., "revision": n, ...}` is a new version of the text; `{"ask": k, "revision": n, "feature": ...}` a question
about one, answered by `k result JSON` or `k refused JSON`: the server passes the JSON on unread. Two threads answer, so
that features which need the checked text, which can take long, do not delay features which need only its names. Both
share one analysis of the version. Work cannot be cancelled half-way: the server ends the program instead.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from scenegen.editors.lsp.answers import Page, Question, RequestRefused, answer
from scenegen.editors.lsp.document import Document

MEANING = ("diagnostics", "hover")  # the features that check the text; the others read its names


class LanguageWorker:
    """Answers questions about the newest text; `say` takes each answer, from any thread."""

    def __init__(self, say: Callable[[int, str, Any], None]) -> None:
        self._say = say
        self._revision = -1
        self._page = Page(Document(""), "")
        self._meaning = ThreadPoolExecutor(1)
        self._names = ThreadPoolExecutor(1)

    def hear(self, message: dict[str, Any]) -> None:
        """A new text, or a question."""
        if "text" in message:
            self._read(message)
            return
        question = Question(message["feature"], message["line"], message["character"], message["name"])
        pool = self._meaning if question.feature in MEANING else self._names
        pool.submit(self._answer, message["ask"], message["revision"], question)

    def _read(self, message: dict[str, Any]) -> None:
        path, root = (Path(one) if one is not None else None for one in (message["path"], message["root"]))
        texts = {Path(one): text for one, text in message["open"].items()}
        document = Document(message["text"], path, message["uri"], texts, root)
        self._page, self._revision = Page(document, message["uri"], message["encoding"]), message["revision"]

    def _answer(self, number: int, revision: int, question: Question) -> None:
        page, newest = self._page, self._revision
        if revision != newest:  # the answer is obsolete
            self._say(number, "result", None)
            return
        try:
            self._say(number, "result", answer(page, question))
        except RequestRefused as reason:
            self._say(number, "refused", str(reason))
        if question.feature == "diagnostics":
            self._names.submit(lambda: page.document.notes)  # what the first completion would have to wait for


def main() -> None:
    """Serve standard input until it ends."""
    logging.basicConfig(level=logging.WARNING, format="%(name)s: %(message)s")
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # other output on standard output would break the protocol
    lock = threading.Lock()

    def say(number: int, kind: str, value: Any) -> None:
        line = f"{number} {kind} {json.dumps(value)}\n".encode()
        with lock, contextlib.suppress(OSError):  # the server has gone: standard input ends as well
            out.write(line)
            out.flush()

    worker = LanguageWorker(say)
    for line in sys.stdin.buffer:
        worker.hear(json.loads(line))
    os._exit(0)  # whatever is still being worked on
