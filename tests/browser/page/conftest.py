"""What the tests of the page share: a small spec, and what hands do."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

TEXT = "object mug, plate, fork\nrequire noOverlap()\ntask: leftOf(mug, plate) & closeTo(mug, plate, 35 cm)\n"


@pytest.fixture
def served(serve, tmp_path):
    (tmp_path / "two.spec").write_text(TEXT)
    return serve("two.spec")


def scenegen_eval(spec: Path, scenes: Path) -> list[dict[str, float]]:
    command = [sys.executable, "-m", "scenegen", "eval", str(spec), str(scenes), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [one["phi"] for one in json.loads(done.stdout)["scenes"]]


def download(tab, format_: str, into: Path) -> Path:
    tab.page.click("button:has-text('Download')")
    with tab.page.expect_download() as wanted:
        tab.page.click(f"button[data-format={format_}]")
    path = into / wanted.value.suggested_filename
    wanted.value.save_as(path)
    return path


def drag(tab, name: str, dx: float, dy: float) -> None:
    place = tab.page.evaluate(f"window.table.where({name!r})")
    tab.page.mouse.move(place["x"], place["y"])
    tab.page.mouse.down()
    for step in range(1, 9):
        tab.page.mouse.move(place["x"] + dx * step / 8, place["y"] + dy * step / 8)
    tab.page.mouse.up()


def settled(tab) -> None:
    """Until phi on the page is that of the poses on the page."""
    tab.until("!$.explaining && $.report && $.report.decides")
