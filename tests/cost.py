"""CPU seconds of the tests, by folder, file and test: `make test-cost`, or `pytest -p tests.cost` for some of them.

CPU seconds are those of the worker and of all processes below it, user and system. A fixture that several tests share
counts where it is made, so a file's figure is that of its tests in this order on these workers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

TICK = os.sysconf("SC_CLK_TCK")
TOP_FILES, TOP_TESTS = 30, 30
START, END = "(imports and collection)", "(after the last test)"
Tally = Counter[str]


def cpu_seconds() -> float:
    """User and system seconds of this process, of its children that have ended, and of those that still run."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system + sum(map(_tree, _children("self")))


def _tree(process: str) -> float:
    """Seconds of a process, of its children that have ended, and of what runs below it; 0 if it has just ended."""
    try:
        fields = Path("/proc", process, "stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / TICK + sum(map(_tree, _children(process)))


def _children(process: str) -> list[str]:
    found = []
    for path in Path("/proc", process, "task").glob("*/children"):
        try:
            found += path.read_text().split()
        except OSError:
            continue
    return found


class Cost:
    """Registered in each worker and in the process that hands out the work; only the latter prints."""

    def __init__(self, config: pytest.Config) -> None:
        self.tally: Tally = Counter()
        self.config = config
        self.last = 0.0

    def _charge(self, name: str) -> None:
        now = cpu_seconds()
        self.tally[name] += max(0.0, now - self.last)
        self.last = now

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        if not self.last:
            self._charge(START)
        try:
            return (yield)
        finally:
            self._charge(item.nodeid)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self) -> None:
        if getattr(self.config.option, "numprocesses", None):
            return  # this process hands out the work; what its workers spent, they say themselves
        self._charge(END)
        if (output := getattr(self.config, "workeroutput", None)) is not None:
            output["cost"] = dict(self.tally)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: object) -> None:
        self.tally.update(getattr(node, "workeroutput", {}).get("cost", {}))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        terminalreporter.section("CPU seconds")
        for line in table(self.tally):
            terminalreporter.write_line(line)
        if target := os.environ.get("COST_JSON"):
            Path(target).write_text(json.dumps(dict(self.tally.most_common()), indent=0), encoding="utf-8")


def table(tally: Tally) -> list[str]:
    """Lines: all folders, then the dearest files and tests."""
    folders: Tally = Counter()
    files: Tally = Counter()
    for test, seconds in tally.items():
        file = test.partition("::")[0]
        files[file] += seconds
        folders[file if file == test else str(Path(file).parent)] += seconds
    lines = [f"{seconds:8.1f}  {folder}" for folder, seconds in folders.most_common()]
    lines += [f"{sum(folders.values()):8.1f}  in all", ""]
    lines += [f"{seconds:8.1f}  {file}" for file, seconds in files.most_common(TOP_FILES) if file.startswith("tests")]
    lines += ["", *(f"{seconds:8.1f}  {test}" for test, seconds in tally.most_common(TOP_TESTS) if "::" in test)]
    return lines


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Cost(config), "cost")


def main(words: list[str]) -> int:
    """The tools of `make lint`, then pytest with these words; says what each took."""
    tools = (["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy"], ["lint-imports", "--no-cache"])
    folder, spent, status = Path(sys.executable).parent, [], 0
    for command in (*tools, ["python", "-m", "pytest", "-p", "tests.cost", *words]):
        before = os.times()
        status |= subprocess.run([folder / command[0], *command[1:]], check=False).returncode
        after = os.times()
        seconds = after.children_user + after.children_system - before.children_user - before.children_system
        spent.append((seconds, " ".join(command)))
    for seconds, text in [*spent, (sum(seconds for seconds, _ in spent), "in all")]:
        print(f"{seconds:8.1f}  {text}")
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
