"""How fast text becomes a checked spec, beside named baselines in the same run (`make bench`).

Prints ratios; asserts nothing.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from scenegen.errors import Source
from scenegen.lang.checker import check_text
from scenegen.lang.syntax import parse as tables
from scenegen.lang.syntax.parse import Builder, parse
from scenegen.lang.syntax.printer import print_module
from scenegen.learn.robustness import Robustness
from scenegen.resources import grammar_file

REPEATS = 3


def best(work: Callable[[], object]) -> float:
    """The shortest of a few runs, in seconds."""
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def main() -> None:
    grammar = grammar_file("spec.lark").read_text(encoding="utf-8")
    scratch = best(lambda: tables.build(grammar))
    finished = best(lambda: tables.parser(Builder()))
    print(f"parser: Lark(text) {scratch * 1e3:.0f} ms (baseline), finished tables {finished * 1e3:.1f} ms", end="")
    print(f" = {scratch / finished:.0f} times faster")

    formulas = {
        "10,000 distinct atoms": " & ".join(f"leftOf(a{k}, b)" for k in range(10_000)),
        "10,000 nested parentheses": "(" * 10_000 + "leftOf(a, b)" + ")" * 10_000,
        "10,000 negations": "!" * 10_000 + "leftOf(a, b)",
    }
    for name, text in formulas.items():
        source = Source(name, text)
        lark = tables.build(grammar)
        baseline = best(lambda text=text, lark=lark: lark.parse(text))
        parsed = best(lambda source=source: parse(source))
        checked = best(lambda text=text: check_text(text))
        module, core = parse(source), check_text(text).core
        printed = best(lambda module=module: print_module(module))
        compiled = best(lambda core=core: Robustness(core))
        whole = checked + printed + compiled
        print(
            f"{name}: Lark's own tree {baseline:.2f} s (baseline), our tree {parsed:.2f} s, "
            f"parse + check {checked:.2f} s, print {printed:.2f} s, compile {compiled:.3f} s: "
            f"all {whole / baseline:.1f} times the baseline"
        )
    megabytes(lark_grammar=grammar)
    shipped()


def megabytes(lark_grammar: str) -> None:
    """Large specs: 1 MB of text, and 100,000 atoms over 2,000 objects from a few lines."""
    lines = ["object " + ", ".join(f"o{k}" for k in range(500))]
    while sum(map(len, lines)) < 1_000_000:
        k = len(lines)
        lines.append(
            f"l{k}: leftOf(o{k % 500}, o{(k + 1) % 500}) & !closeTo(o{k % 499}, o{k % 499 + 1}, {k % 40 + 1} cm)"
        )
    texts = {
        "1 MB of labels": "\n".join(lines),
        "2,000 objects, 100,000 atoms": "object b[2000]\ntask: forall i in 1..50: forall p in b: x(p) >= i * 1 mm\n",
        "450 objects, 101,025 gaps": "object mug[450]\nrequire noOverlap()\ntask: leftOf(mug[1], mug[2])\n",
    }
    lark = tables.build(lark_grammar)
    for name, text in texts.items():
        started = time.perf_counter()
        lark.parse(text)
        baseline = time.perf_counter() - started
        started = time.perf_counter()
        spec = check_text(text)
        taken = time.perf_counter() - started
        nodes = f"{len(spec.core.nodes):,} nodes"
        print(f"{name}: Lark's own tree {baseline:.2f} s (baseline), parse + check {taken:.2f} s, {nodes}")


def shipped() -> None:
    """`scenegen check` of every spec that ships, in a process of its own, beside a bare `import numpy`."""
    bare = best(lambda: subprocess.run([sys.executable, "-c", "import numpy"], check=True))
    print(f"import numpy in a fresh process: {bare:.2f} s (baseline)")
    for path in sorted((Path(__file__).parent.parent / "specs").glob("*.spec")):
        command = [sys.executable, "-m", "scenegen", "check", str(path)]
        taken = best(lambda command=command: subprocess.run(command, check=True, capture_output=True))
        print(f"check {path.name}: {taken:.2f} s = {taken / bare:.1f} times the baseline")


if __name__ == "__main__":
    main()
