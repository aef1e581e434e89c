"""The pictures of README.md, assets.md and pictures.md. Run by `make pictures`.

What is drawn is seeded, so that a second run changes nothing.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

import scenegen
from scenegen.assets import ASSETS
from scenegen.render import VIEWS
from scenegen.render.gallery import gallery, library_sheet

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"
SPEC = DOCS.parent / "specs" / "table_setting.spec"
ON_A_TRAY = """object tray at (0.3, 0.5, 0), laptop at (0.75, 0.65, 4.71), plate at (0.75, 0.25, 0)
object mug, apple, book, block, gizmo
region mat = rect(0.52, 0.08, 0.98, 0.42)
task: inside(book, tray) & on(block, book) & inside(apple, plate) & on(mug, tray) & rightOf(mug, book)
  & clearOf(gizmo, tray, 2 cm) & leftOf(gizmo, tray) & !overlaps(mug, book)
"""


def small(path: Path, image: Image.Image) -> None:
    """Write a picture with a palette of 256 colours: a third of the size."""
    found = image.convert("RGB").quantize(256, method=Image.Quantize.MEDIANCUT, kmeans=3)
    found.save(IMAGES / path, format="PNG", optimize=True)


def side_by_side(paths: list[Path], columns: int) -> Image.Image:
    """Pictures of one size in rows."""
    images = [Image.open(path).convert("RGB") for path in paths]
    width, height = images[0].size
    rows = -(-len(images) // columns)
    sheet = Image.new("RGB", (columns * width + (columns - 1) * 8, rows * height + (rows - 1) * 8), (250, 250, 249))
    for number, image in enumerate(images):
        sheet.paste(image, (number % columns * (width + 8), number // columns * (height + 8)))
    return sheet


def main() -> None:
    spec = scenegen.load(SPEC)
    solved = scenegen.sample(spec, phi={"task": (0.0, None)}, n=16, seed=7, settle=True)
    many = scenegen.sample(spec, phi={"task": (0.0, None)}, n=2000, seed=1)
    library = gallery(sorted(ASSETS), (320, 240))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "library.png").write_bytes(library_sheet(library))
        small(Path("assets.png"), Image.open(folder / "library.png"))
        sheet, strip, view = solved.figures(folder, "sheet", "sweep", "topview")[:3]
        (gif,) = solved.figures(folder, "gif", size=(480, 360))
        small(Path("table_setting.png"), Image.open(sheet))
        small(Path("sweep.png"), Image.open(strip))
        (IMAGES / "sweep.gif").write_bytes(gif.read_bytes())
        (IMAGES / "topview.svg").write_bytes(view.read_bytes())
        small(Path("heatmap.png"), Image.open(many.figures(folder, "heatmap")[0]))
        tray = scenegen.sample(scenegen.parse(ON_A_TRAY), phi={"task": (0.005, None)}, n=1, seed=4)
        drawn = tray.render(folder / "tray", views=VIEWS, size=(480, 360))
        small(Path("views.png"), side_by_side(list(drawn.pictures), 2))


if __name__ == "__main__":
    main()
