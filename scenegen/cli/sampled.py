"""What `scenegen sample` shows: a bar while it works, and a table of what was found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from scenegen.cli.output import print_columns, print_error, progress_bar

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from rich.progress import Progress

    from scenegen.api.written import Met
    from scenegen.scene.data import SceneFile


class Bar:
    """A progress bar that appears only when sampling takes a while."""

    def __enter__(self) -> Bar:
        self._progress: Progress | None = None
        self._calls = 0
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def __call__(self, found: int, wanted: int, candidates: int) -> None:
        self._calls += 1
        if self._calls < 2:
            return
        if self._progress is None:
            self._progress = progress_bar()
            self._task = self._progress.add_task("sampling", total=None)
            self._progress.start()
        text = f"sampling: {found:,} of {wanted:,} in {candidates:,} candidates"
        self._progress.update(self._task, description=text, completed=found, total=wanted)


def summary(header: SceneFile, count: int, phi: Mapping[str, Met], out: Path | str | None) -> None:
    """The requested ranges beside the results."""
    print_error(f"{count} scenes ({_how(header.sampler)})" + (f" in {out}" if out is not None else ""))
    rows = []
    for label, values in phi.items():
        low, high = header.request.phi.get(label, (None, None))
        wanted = "any" if low is None and high is None else f"{_end(low)}:{_end(high)}"
        rows.append((label, wanted, *(f"{value:+.4f}" for value in (values.lowest, values.mean, values.highest))))
    print_columns(("label", "wanted phi", "lowest", "mean", "highest"), rows)


def _how(info: Mapping[str, Any]) -> str:
    """How scenes were made, and with what yield."""
    if info.get("raw"):
        return "raw output of the model"
    if info["method"] in ("rejection", "completed"):
        return f"{info['method']}, {info['draws']:,} draws, {100 * info['acceptance']:.3g}% accepted"
    if info["method"] == "splitting":
        return f"splitting, {info['candidates']:,} evaluations, {100 * info['acceptance']:.3g}% of the moves accepted"
    if info["method"] == "growth":
        return f"growth, {info['candidates']:,} evaluations, {info['sweeps']} sweeps of moves after the last object"
    if info["method"] == "numbered":
        methods = ", ".join(dict.fromkeys(part["method"] for part in info["numbers"]))
        equal = " in equal shares" if all("share" in part for part in info["numbers"]) else ""
        what = "choices of assets" if any("assets" in part for part in info["numbers"]) else "numbers of things"
        return f"{len(info['numbers'])} {what}{equal}, by {methods}"
    if info["method"] == "paired":
        methods = ", ".join(part["method"] for part in info["components"])
        return f"{len(info['components'])} independent parts by {methods}, {info['candidates']:,} evaluations"
    return f"{info['method']}, {info['candidates']:,} candidates"


def _end(value: float | None) -> str:
    return "" if value is None else f"{value:g}"
