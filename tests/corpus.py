"""Corpora: what is written and the message that it gets, case by case in one file below tests/golden.

    ==== arity_few
    leftOf(mug)
    ----
    error[wrong-number-of-arguments]: `leftOf` takes 2 arguments, not 1
    ...

What stands above `----` is the input of the case, and stands nowhere else: to add a case, write it, and `make derived`
writes the message below. A text whose lines end otherwise says so beside its name: `(no newline at the end)`, `(CRLF)`.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

GOLDEN = Path(__file__).resolve().parent / "golden"
OPEN, CRLF = "no newline at the end", "CRLF"
HEAD = re.compile(r"^==== (\w+)(?: \((.+)\))?\n", re.MULTILINE)


@dataclass(frozen=True)
class Case:
    """`text` is what is written, to the byte; `message`, without its last end of line, is "" where none is recorded."""

    name: str
    text: str
    message: str

    def print(self) -> str:
        text, note = self.text, ""
        if "\r\n" in text:
            text, note = text.replace("\r\n", "\n"), f" ({CRLF})"
        elif not text.endswith("\n"):
            text, note = f"{text}\n", f" ({OPEN})"
        return f"==== {self.name}{note}\n{text}----\n{self.message}\n"


@functools.cache
def read_corpus(name: str) -> dict[str, Case]:
    """The cases of tests/golden/NAME.txt by their names, in the order of the file."""
    _, *parts = HEAD.split((GOLDEN / f"{name}.txt").read_bytes().decode())
    cases: dict[str, Case] = {}
    for case, note, body in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
        text, rule, message = body.partition("\n----\n")
        assert rule, f"tests/golden/{name}.txt: no line ---- after the text of {case}"
        assert case not in cases, f"tests/golden/{name}.txt has two cases {case}"
        text = text if note == OPEN else f"{text}\n"
        cases[case] = Case(case, text.replace("\n", "\r\n") if note == CRLF else text, message.rstrip("\n"))
    return cases


def write_corpus(name: str, cases: Iterable[Case]) -> None:
    (GOLDEN / f"{name}.txt").write_bytes("\n".join(case.print() for case in cases).encode())
    read_corpus.cache_clear()


def write_message(name: str, case: str, message: str) -> None:
    """Put the message of a case in its place; the others stay as they are."""
    cases = read_corpus(name)
    if cases[case].message != message:
        cases[case] = replace(cases[case], message=message)
        write_corpus(name, cases.values())
