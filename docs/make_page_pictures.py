"""The pictures of view.md and README.md that show the page of `scenegen view`, and those of the examples on its first
screen. Run by `make page-pictures`.

Needs the extra `browser` and Chromium. What is drawn is seeded; only the time that
sampling took differs from run to run.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from make_pictures import IMAGES
from PIL import Image
from playwright.sync_api import sync_playwright

from scenegen.resources import shipped_specs

ROOT = Path(__file__).resolve().parent.parent
EXAMPLES = ROOT / "scenegen" / "page" / "static" / "examples"
EXAMPLE, CARD = {"width": 1500, "height": 700}, (384, 240)  # of the page, and of the picture
GROUND = "#e9e4d9"
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
    page.focus(".stage canvas")
    for key in ("2", "Home", *["ArrowRight"] * MOMENT):
        page.keyboard.press(key)


IN_SIGHT = """# The lemon can be picked up, and a part of the mug is hidden.
robot arm = so101 at (0.5, 0.25, NORTH)
camera front = at (0.5, 0.02, 0.5) looks at (0.5, 0.5, 0) fov 60 deg, 4:3
object mug, bottle, lemon
require noOverlap() & insideWorkspace(others(arm))
task: graspable(lemon, arm) & visible(mug, front, 30 %, 90 %)
"""


def from_above(page: Any) -> None:
    """What an arm reaches and a camera pictures."""
    scenes(page)
    page.focus(".stage canvas")
    page.keyboard.press("v")
    page.wait_for_selector("svg.top .hand", state="attached")


SHOWN: dict[str, tuple[str, Callable[[Any], None]]] = {
    "view.png": ("breakfast", scenes),
    "motion.png": (str(ROOT / "examples" / "motions" / "round_the_plate.spec"), motion),
    "in_sight.png": (IN_SIGHT, from_above),
}


@contextlib.contextmanager
def opened(browser: Any, what: str, size: Mapping[str, int]) -> Iterator[Any]:
    """The page of what is named, or of a text."""
    with tempfile.TemporaryDirectory() as state:  # no drafts of earlier runs
        if "\n" in what:
            (Path(state) / "in_sight.spec").write_text(what)
            what = str(Path(state) / "in_sight.spec")
        env = {**os.environ, "XDG_STATE_HOME": state}
        command = [sys.executable, "-m", "scenegen", "view", what]
        server = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=env)
        try:
            link = next(found[0] for line in server.stderr or () if (found := re.search(r"http://\S+", line)))
            page = browser.new_page(viewport=size, bypass_csp=True)  # what waits is a text that is run
            page.goto(link)
            yield page
            page.close()
        finally:
            server.terminate()
            server.wait()


def example(browser: Any, name: str) -> None:
    """The picture of a shipped spec on the first screen: its first scene with all labels satisfied."""
    with opened(browser, name, EXAMPLE) as page:
        page.wait_for_function("scenegen.result && !scenegen.busy && !scenegen.preview", timeout=MINUTES)
        page.keyboard.press("Escape")
        page.wait_for_timeout(800)  # objects glide
        code = "table.picture().then((blob) => blob.arrayBuffer()).then((all) => Array.from(new Uint8Array(all)))"
        picture = Image.open(io.BytesIO(bytes(page.evaluate(code)))).convert("RGBA")
        stage = page.locator(".stage canvas").bounding_box()
        places = page.evaluate("scenegen.spec.objects.map((one) => table.where(one.name))")
    scale = picture.width / stage["width"]
    across = [scale * (one["x"] - stage["x"]) for one in places]
    down = [scale * (one["y"] - stage["y"]) for one in places]
    # what is cut out holds all objects, with room around them, and at least half of the picture
    width = max(max(across) - min(across) + 0.24 * picture.width, 0.5 * picture.width)
    height = max(max(down) - min(down) + 0.3 * picture.height, width * CARD[1] / CARD[0])
    width = max(width, height * CARD[0] / CARD[1])
    x, y = (max(across) + min(across)) / 2, (max(down) + min(down)) / 2 - 0.03 * picture.height
    ground = Image.new("RGBA", picture.size, GROUND)
    ground.alpha_composite(picture)
    cut = Image.new("RGB", (round(width), round(height)), GROUND)
    cut.paste(ground.convert("RGB"), (round(width / 2 - x), round(height / 2 - y)))
    fitted = cut.resize(CARD, Image.Resampling.LANCZOS)
    fitted.save(EXAMPLES / f"{name}.jpg", quality=76, optimize=True, progressive=True)


def main(names: list[str]) -> None:
    """All pictures, or only those of the shipped specs of these names."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for name in names or shipped_specs():
            example(browser, name)
        for name, (what, act) in SHOWN.items() if not names else ():
            with opened(browser, what, SIZE) as page:
                act(page)
                page.wait_for_function("!document.querySelector('.grid button[data-scene]:not(.drawn)')")
                page.wait_for_timeout(600)  # colours fade
                page.screenshot(path=IMAGES / name)
            Image.open(IMAGES / name).convert("RGB").save(IMAGES / name, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
