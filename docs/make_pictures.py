"""The pictures of README.md, assets.md and pictures.md. Run by `make pictures`.

What is drawn is seeded, so that a second run changes nothing. `python docs/make_pictures.py views assets` makes some.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from PIL import Image

import scenegen
from scenegen.looks.camera import VIEWS
from scenegen.pictures.render.gallery import gallery, library_sheet
from scenegen.things import ASSETS

DOCS = Path(__file__).resolve().parent
IMAGES = DOCS / "images"
SPECS = DOCS.parent / "specs"
ON_A_TRAY = """object tray at (0.3, 0.5, 0), laptop at (0.75, 0.65, 4.71), plate at (0.75, 0.25, 0)
object mug, apple, book, block, gizmo
region mat = rect(0.52, 0.08, 0.98, 0.42)
task: inside(book, tray) & on(block, book) & inside(apple, plate) & on(mug, tray) & rightOf(mug, book)
  & clearOf(gizmo, tray, 2 cm) & leftOf(gizmo, tray) & !overlaps(mug, book)
"""


def small(name: str, image: Image.Image, *, smooth: bool = False) -> None:
    """Write a picture with a palette of 256 colours: a third of the size. `smooth` mixes them where shades change
    slowly, which takes twice as much."""
    plain = image.convert("RGB")
    found = plain.quantize(256, method=Image.Quantize.MEDIANCUT, kmeans=3)
    if smooth:
        found = plain.quantize(palette=found, dither=Image.Dither.FLOYDSTEINBERG)
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


DINNER = """object plate[4], fork[4], knife[4], glass[4]
require noOverlap() & insideWorkspace()
def beside(a, p) = closeTo(a, p, 22 cm) & alignedY(a, p, 4 cm) & angle(a, NORTH, 15 deg)
task: forall i in 1..4: leftOf(fork[i], plate[i]) & beside(fork[i], plate[i]) & rightOf(knife[i], plate[i])
  & beside(knife[i], plate[i]) & aboveOf(glass[i], plate[i]) & closeTo(glass[i], plate[i], 25 cm)
"""
SHOWN = (1, 3, 7, 15)  # stages of growth that are drawn: by then, so many objects are on the table


def growth(folder: Path) -> None:
    """A scene while it grows: what is placed, the room that contraction leaves to the next object, where it goes."""
    import numpy as np
    from matplotlib import patches
    from matplotlib.figure import Figure

    from scenegen.sampling.growth.insertion import place
    from scenegen.sampling.growth.model import Particles, make_growth_model
    from scenegen.sampling.problem import make_problem
    from scenegen.sampling.request import Range, SampleRequest
    from scenegen.sampling.resampling import resample_groups

    spec = scenegen.parse(DINNER).checked
    model = make_growth_model(make_problem(spec, SampleRequest({"task": Range(0.0)}, n=1)))
    rng = np.random.default_rng(2)
    cell = np.zeros(256, dtype=np.intp)
    particles = Particles.start(model, cell, cell, rng)
    figure = Figure(figsize=(8.8, 2.35), dpi=100, layout="tight")
    for stage, thing in enumerate(model.order):
        boxes = model.room(thing, stage).boxes(particles.scenes, particles.cell, model.effort)
        placed = place(particles, 64)
        scene = int((placed.weights > 0.0).argmax())
        low, width = boxes.low[:2, :, scene], boxes.width[:2, :, scene]
        open_ = boxes.volumes[:, scene] > 0.0
        if stage in SHOWN:
            axes = figure.add_subplot(1, len(SHOWN), SHOWN.index(stage) + 1, aspect="equal", xticks=(), yticks=())
            axes.set(xlim=spec.workspace.x, ylim=spec.workspace.y)
            axes.set_title(f"{stage} placed, then {spec.objects[thing]}", fontsize=8)
            for corner, size in zip(low.T[open_], width.T[open_], strict=True):
                axes.add_patch(patches.Rectangle(tuple(corner), *size, color="#f2cf88", zorder=0))
            for one in model.order[: stage + 1]:
                x, y, theta = particles.scenes[3 * one : 3 * one + 3, scene]
                colour = "#c0392b" if one == thing else "#4a6b8a"
                length, across = spec.shapes[one].footprint.extent
                if spec.shapes[one].asset in ("plate", "glass"):
                    axes.add_patch(patches.Circle((x, y), length / 2, fill=False, color=colour))
                else:
                    corner = (x - length / 2, y - across / 2)
                    turned = {"angle": float(np.degrees(theta)), "rotation_point": "center"}
                    axes.add_patch(patches.Rectangle(corner, length, across, fill=False, color=colour, **turned))
        particles.take(resample_groups(placed.weights, particles.group, rng)[0])
    figure.savefig(folder / "growth.png")
    small("growth.png", Image.open(folder / "growth.png"))


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


def looks(folder: Path) -> None:
    """Twelve scenes in twelve rooms."""
    scenes = scenegen.sample(scenegen.load(SPECS / "breakfast.spec"), phi={"task": (-0.2, 0.05)}, n=12, seed=3)
    drawn = scenes.render(folder / "looks", looks="random", seed=2, size=(296, 222))
    small("looks.png", side_by_side(list(drawn.pictures), 4), smooth=True)


SHELF = """workspace [0, 0.8] x [0, 0.5]
object shelfunit at (0.4, 0.3, SOUTH), pot on shelfunit.shelf[1], cup[2] on shelfunit.shelf[1]
object can[3] on shelfunit.shelf[2], jar[2] on shelfunit.shelf[2]
object book[2] on [shelfunit.shelf[3], book[1]], glass[2] on shelfunit.shelf[3]
object teapot on shelfunit.top, bowl on shelfunit.top, orange on bowl
require noCollision() & inside(teapot, shelfunit.top) & inside(bowl, shelfunit.top) & stable(book, 3 cm)
task: leftOf(pot, cup[1]) & leftOf(cup[1], cup[2]) & (forall a in can: forall b in jar: leftOf(a, b))
  & (forall b in book: angle(b, EAST, 12 deg) & forall g in glass: leftOf(g, b))
  & leftOf(teapot, bowl) & angle(teapot, EAST, 40 deg)
"""
BOWL = """workspace [0, 0.66] x [0, 0.54]
object plate, bowl on plate, orange on bowl, cup, spoon
object basket, apple[2] on basket, lemon on basket, banana on basket
require noCollision() & insideWorkspace([plate, basket, cup, spoon])
task: leftOf(basket, plate) & aboveOf(basket, plate) & clearOf(basket, plate, 1 cm)
  & aboveOf(cup, plate) & rightOf(cup, basket) & clearOf(cup, plate, 2 cm)
  & angle(spoon, NORTH, 20 deg) & rightOf(spoon, plate) & closeTo(spoon, plate, 18 cm)
"""


def heights(folder: Path) -> None:
    """A shelf, a drawer and a bowl: what stands on and in other things."""
    pictures = []
    drawer = scenegen.load(SPECS / "cutlery_drawer.spec")
    for name, spec, view in (
        ("shelf", scenegen.parse(SHELF), "front"),
        ("drawer", drawer, "perspective"),
        ("bowl", scenegen.parse(BOWL), "perspective"),
    ):
        scenes = scenegen.sample(spec, phi=dict.fromkeys(spec.labels, (0.0, None)), n=1, seed=3)
        pictures += scenes.render(folder / name, views=(view,), size=(600, 540)).pictures
    small("heights.png", side_by_side(pictures, 3), smooth=True)


BEHIND = """camera front = at (0.5, -0.05, 0.4) looks at (0.5, 0.6, 0) fov 40 deg, 4:3
object mug = cylinder(4 cm, 9 cm), carton = box(8 cm, 6 cm, 20 cm), bottle = cylinder(3.5 cm, 25 cm)
require noOverlap() & inView(mug, front)
task: visible(mug, front, 30 %, 50 %)
"""


def camera(folder: Path) -> None:
    """What the camera of a spec sees of a mug, from all of it to hardly anything."""
    spec = scenegen.load(SPECS / "occlusion_ladder.spec")
    pictures: list[Path] = []
    for number, rung in enumerate(((0.05, None), (0.01, 0.04), (-0.02, 0.01), (-0.045, -0.02))):
        scenes = scenegen.sample(spec, phi=rung, n=1, seed=4)
        pictures += scenes.render(folder / str(number), camera="front", size=(440, 330)).pictures
    small("camera.png", side_by_side(pictures, 4), smooth=True)


def robot(folder: Path) -> None:
    """What an arm reaches, and how its hand would grasp each thing; and what a camera pictures, from above."""
    spec = scenegen.load(SPECS / "graspable_pick.spec")
    scenes = scenegen.sample(spec, phi={"pick": (0.002, None), "clear": (0.0, None)}, n=4, seed=3)
    (IMAGES / "robot_above.svg").write_bytes(scenes[:1].figures(folder, "topview")[0].read_bytes())
    hidden = scenegen.sample(scenegen.parse(BEHIND), phi={"task": (0.0, None)}, n=1, seed=2)
    (IMAGES / "camera_above.svg").write_bytes(hidden.figures(folder / "behind", "topview")[0].read_bytes())


def usual(folder: Path) -> None:
    """Where things usually are, under those of one scene."""
    spec = scenegen.load(SPECS / "morning_table.spec")
    scenes = scenegen.sample(spec, phi={"task": (0.0, None)}, n=1, seed=1)
    (IMAGES / "usual_above.svg").write_bytes(scenes.figures(folder, "topview")[0].read_bytes())


def assets(folder: Path) -> None:
    """All objects of the library."""
    (folder / "library.png").write_bytes(library_sheet(gallery(sorted(ASSETS), (320, 240))))
    small("assets.png", Image.open(folder / "library.png"))


MADE = {one.__name__: one for one in (dinner, growth, setting, views, looks, heights, camera, robot, usual, assets)}


def main() -> None:
    names = sys.argv[1:] or list(MADE)
    if unknown := set(names) - set(MADE):
        sys.exit(f"no pictures are called {', '.join(sorted(unknown))}; there are {', '.join(MADE)}")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            MADE[name](Path(folder))


if __name__ == "__main__":
    main()
