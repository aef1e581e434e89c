"""Inputs by number: input `k` of a seed is the same on every machine, so a fault is found again from two numbers."""

from __future__ import annotations

import random
import tempfile
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..corpus import read_corpus
from .generate import Case, generate
from .judge import Fault, Hang, grammar_names, judge
from .minimise import minimise
from .mutate import mutate
from .scenefiles import good_file, judge_file
from .sizes import sized

SIZES = 0.02  # of the inputs of `make fuzz`; they take a second, the others a hundredth
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True, slots=True)
class Found:
    """An input that breaks a law: its number, what went wrong (alike for alike faults), and the whole story."""

    number: int
    signature: str
    story: str
    case: Case


def corpus() -> list[str]:
    """The texts that mutations start from: shipped specs, the prelude, mistakes, and the accepted formulas."""
    texts = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "specs").glob("*.spec"))]
    for path in sorted((ROOT / "tests/golden/lang/errors").glob("*.txt")):
        texts += [case.text for case in read_corpus(f"lang/errors/{path.stem}").values()]
    prelude = (ROOT / "grammar" / "prelude.spec").read_text(encoding="utf-8")
    lines = (ROOT / "tests/golden/lang/formulas.txt").read_text(encoding="utf-8").splitlines()
    return [*texts, *[prelude] * 5, *(line for line in lines if line and not line.startswith("#"))]


def make(seed: int, number: int, texts: list[str], sizes: float = 0.0) -> Case:
    """Input `number` of a seed; `sizes` is the share of inputs that attack by their size."""
    big = random.Random(f"{seed}:{number}:size")
    if big.random() < sizes:
        return sized(big)
    rng = random.Random(f"{seed}:{number}")
    if rng.random() < 0.55:
        return generate(rng)
    if rng.random() < 0.3:
        return mutate(rng, [generate(rng).main.decode(), *rng.sample(texts, 3)])
    return mutate(rng, texts)


def signature(error: BaseException) -> str:
    """The same for the same fault: the kind of error and the innermost places of the program under test."""
    if isinstance(error, Fault):
        return f"Fault: {error}"
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "scenegen" in frame.filename]
    if isinstance(error, Hang):
        return f"Hang in {frames[0].name if frames else '?'}"
    return f"{type(error).__name__} in " + ", ".join(f"{Path(one.filename).name}:{one.lineno}" for one in frames[-2:])


class Bench:
    """Judges inputs in a scratch folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names = grammar_names()
        self.good_file = good_file()

    def verdict(self, case: Case) -> tuple[bool, str, str]:
        """Whether it is accepted, and the signature and story of its fault ("" where there is none)."""
        try:
            return judge(case, self.folder, random.Random(0), self.names), "", ""
        except (Exception, Hang) as error:
            story = "".join(traceback.format_exception(error, limit=-12))
            return False, signature(error), story

    def file_verdict(self, seed: int, number: int) -> tuple[str, str]:
        """Signature and story of the fault of hostile scene file `number` of a seed, left in the folder as x.json or
        x.jsonl; "" where there is none."""
        try:
            judge_file(random.Random(f"file:{seed}:{number}"), self.good_file, self.folder)
        except Exception as error:
            return signature(error), "".join(traceback.format_exception(error, limit=-12))
        return "", ""

    def shrink(self, case: Case, wanted: str) -> Case:
        if case.sized:
            return case  # a smaller one is another case
        return minimise(case, lambda candidate: self.verdict(candidate)[1] == wanted)


def inputs(seed: int, first: int, step: int) -> Iterator[tuple[int, Case]]:
    """Every `step`th input from number `first` on, for ever."""
    texts = corpus()
    number = first
    while True:
        yield number, make(seed, number, texts, SIZES)
        number += step


def scratch() -> tempfile.TemporaryDirectory[str]:
    """A folder for the files that specs import; in memory where the machine offers that."""
    memory = Path("/dev/shm")
    return tempfile.TemporaryDirectory(prefix="scenegen-fuzz-", dir=memory if memory.is_dir() else None)
