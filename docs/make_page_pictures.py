"""The pictures of view.md and README.md that show the page of `scenegen view`. Run by `make page-pictures`.

Needs the extra `browser` and Chromium. What is drawn is seeded; only the time that
sampling took differs from run to run.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from make_pictures import IMAGES
from PIL import Image
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parent.parent
FLAGS = ["--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1280, "height": 800}
MINUTES = 3 * 60_000  # ms
MOMENT = 13  # of the motion that is shown


def scenes(page: Any) -> None:
    """Scenes, and how rare each phi is."""
    page.wait_for_function("scenegen.result && !scenegen.busy && !scenegen.preview && scenegen.rested", timeout=MINUTES)


def motion(page: Any) -> None:
    """A motion at one of its moments, and why it has its phi."""
    page.wait_for_function("scenegen.result && !scenegen.busy && scenegen.report?.signals", timeout=MINUTES)
    for key in ("Escape", "2", "Home", *["ArrowRight"] * MOMENT):
        page.keyboard.press(key)


SHOWN: dict[str, tuple[str, Callable[[Any], None]]] = {
    "view.png": ("breakfast", scenes),
    "motion.png": (str(ROOT / "examples" / "motions" / "round_the_plate.spec"), motion),
}


def main() -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for name, (what, act) in SHOWN.items():
            command = [sys.executable, "-m", "scenegen", "view", what]
            server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
            try:
                link = next(found[0] for line in server.stderr or () if (found := re.search(r"http://\S+", line)))
                page = browser.new_page(viewport=SIZE, bypass_csp=True)  # what waits is a text that is run
                page.goto(link)
                act(page)
                page.wait_for_function("!document.querySelector('.grid button[data-scene]:not(.drawn)')")
                page.wait_for_timeout(600)  # colours fade
                page.screenshot(path=IMAGES / name)
                page.close()
            finally:
                server.terminate()
                server.wait()
            Image.open(IMAGES / name).convert("RGB").save(IMAGES / name, optimize=True)


if __name__ == "__main__":
    main()
