"""How fast text becomes a checked spec, beside named baselines in the same run (`make bench`).

Prints ratios; asserts nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from scenegen.errors import Source
from scenegen.lang import tables
from scenegen.lang.build import Builder
from scenegen.lang.check import check_text
from scenegen.lang.parse import parse
from scenegen.lang.print import print_module
from scenegen.resources import grammar_file
from scenegen.robustness import Robustness

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


if __name__ == "__main__":
    main()
