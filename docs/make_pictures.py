"""The pictures of README.md, assets.md and pictures.md. Run by `make pictures`.

What is drawn is seeded, so that a second run changes nothing. `python docs/make_pictures.py views assets` makes some.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

import scenegen
from scenegen.assets import ASSETS
from scenegen.render import VIEWS
from scenegen.render.gallery import gallery, library_sheet

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"
SPECS = DOCS.parent / "specs"
ON_A_TRAY = """object tray at (0.3, 0.5, 0), laptop at (0.75, 0.65, 4.71), plate at (0.75, 0.25, 0)
object mug, apple, book, block, gizmo
region mat = rect(0.52, 0.08, 0.98, 0.42)
task: inside(book, tray) & on(block, book) & inside(apple, plate) & on(mug, tray) & rightOf(mug, book)
  & clearOf(gizmo, tray, 2 cm) & leftOf(gizmo, tray) & !overlaps(mug, book)
"""


def small(name: str, image: Image.Image) -> None:
    """Write a picture with a palette of 256 colours: a third of the size."""
    found = image.convert("RGB").quantize(256, method=Image.Quantize.MEDIANCUT, kmeans=3)
    found.save(IMAGES / name, format="PNG", optimize=True)


def side_by_side(paths: list[Path], columns: int) -> Image.Image:
    """Pictures of one size in rows."""
    images = [Image.open(path).convert("RGB") for path in paths]
    width, height = images[0].size
    rows = -(-len(images) // columns)
    sheet = Image.new("RGB", (columns * width + (columns - 1) * 8, rows * height + (rows - 1) * 8), (250, 250, 249))
    for number, image in enumerate(images):
        sheet.paste(image, (number % columns * (width + 8), number // columns * (height + 8)))
    return sheet


def dinner(folder: Path) -> None:
    """What the README opens with: 16 scenes as the command below the picture gives them, and one on its way there."""
    spec = scenegen.load(SPECS / "dinner_for_two.spec")
    solved = scenegen.sample(spec, phi={"task": (0.0, None), "shared": (0.0, None)}, n=16, seed=0)
    sheet, strip = solved.figures(folder, "sheet", "sweep")
    (gif,) = solved.figures(folder, "gif", size=(528, 272))
    small("dinner_for_two.png", Image.open(sheet))
    small("sweep.png", Image.open(strip))
    (IMAGES / "sweep.gif").write_bytes(gif.read_bytes())


def setting(folder: Path) -> None:
    """Where things go, and what decides."""
    spec = scenegen.load(SPECS / "table_setting.spec")
    hard = scenegen.sample(spec, phi={"task": (-0.25, -0.15)}, n=1, seed=6)
    many = scenegen.sample(spec, phi={"task": (0.0, None)}, n=2000, seed=1)
    (view,) = hard.figures(folder, "topview")
    (IMAGES / "topview.svg").write_bytes(view.read_bytes())
    small("heatmap.png", Image.open(many.figures(folder, "heatmap")[0]))


def views(folder: Path) -> None:
    """One scene from all sides."""
    tray = scenegen.sample(scenegen.parse(ON_A_TRAY), phi={"task": (0.005, None)}, n=1, seed=4)
    drawn = tray.render(folder / "tray", views=VIEWS, size=(480, 360))
    small("views.png", side_by_side(list(drawn.pictures), 2))


def assets(folder: Path) -> None:
    """All objects of the library."""
    (folder / "library.png").write_bytes(library_sheet(gallery(sorted(ASSETS), (320, 240))))
    small("assets.png", Image.open(folder / "library.png"))


MADE = {one.__name__: one for one in (dinner, setting, views, assets)}


def main() -> None:
    names = sys.argv[1:] or list(MADE)
    if unknown := set(names) - set(MADE):
        sys.exit(f"no pictures are called {', '.join(sorted(unknown))}; there are {', '.join(MADE)}")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            MADE[name](Path(folder))


if __name__ == "__main__":
    main()
