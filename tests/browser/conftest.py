"""Chromium, headless, with software rendering, and servers for it. Without either these tests are skipped."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next((one for one in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if one), None)
FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
).split()
PATIENCE = 90.0
ROOT = Path(__file__).resolve().parent.parent.parent
SHOTS = Path(os.environ.get("SHOTS", ROOT / "build" / "screenshots"))


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    with api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS, headless=True)
        yield found
        found.close()


class Served:
    """`scenegen view` in a process of its own."""

    def __init__(self, folder: Path, *words: str) -> None:
        command = [sys.executable, "-m", "scenegen", "view", *words]
        self.folder = folder
        env = {**os.environ, "XDG_STATE_HOME": str(folder / ".state")}  # drafts
        self.process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True, env=env)
        self.link = ""
        for line in self.process.stderr:
            found = re.search(r"http://\S+", line)
            if found:
                self.link = found[0]
                break
        assert self.link, "the server did not start"

    def end(self) -> None:
        self.process.terminate()
        self.process.wait(10)
        self.process.stderr.close()


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Served]]:
    running: list[Served] = []

    def start(*words: str) -> Served:
        running.append(Served(tmp_path, *words))
        return running[-1]

    yield start
    for one in running:
        one.end()


class Tab:
    """A page in the browser. What goes wrong in it, and what it wants from other machines, fails the test."""

    def __init__(self, context: Any, link: str) -> None:
        self.page = context.new_page()
        self.faults: list[str] = []
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("console", lambda one: one.type == "error" and self.faults.append(one.text))
        self.page.on("request", lambda one: self._outside(one.url))
        self.page.goto(link)

    def _outside(self, url: str) -> None:
        if not re.match(r"(http|ws)://(127\.0\.0\.1|localhost):|file:|data:|blob:", url):
            self.faults.append(f"a request to {url}")

    def state(self, what: str) -> Any:
        return self.page.evaluate(f"window.scenegen && ({what})".replace("$", "window.scenegen"))

    def until(self, what: str, patience: float = PATIENCE) -> Any:
        """Wait for an expression over `$`, the state of the page, to be true."""
        end = time.monotonic() + patience
        while time.monotonic() < end:
            found = self.state(what)
            if found:
                return found
            time.sleep(0.02)
        raise AssertionError(f"never true: {what}; faults: {self.faults}")

    def ready(self) -> None:
        """Wait for the scenes that are wanted, and for what the first of them is worth."""
        self.until("$.result && !$.busy && !$.preview && $.report && $.report.decides")

    def write(self, text: str) -> None:
        """Replace the whole spec by typing."""
        self.page.click(".cm-content")
        self.page.keyboard.press("Control+a")
        self.page.keyboard.insert_text(text)


@pytest.fixture
def tab(browser: Any) -> Iterator[Callable[..., Tab]]:
    opened: list[Tab] = []
    contexts: list[Any] = []

    def start(link: str, context: Any = None, **options: Any) -> Tab:
        if context is None:
            context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
            contexts.append(context)
        opened.append(Tab(context, link))
        return opened[-1]

    yield start
    faults = [fault for one in opened for fault in one.faults]
    for context in contexts:
        context.close()
    assert not faults
