"""Scene files -> pictures and a contact sheet, without a display."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from scenegen.errors import DataError, RequestError
from scenegen.errors.requests import CONFLICTING_ARGUMENTS, NO_SCENES
from scenegen.looks.camera import USUAL_VIEWS
from scenegen.looks.chart_style import PAPER
from scenegen.looks.configuration import read_looks
from scenegen.looks.look import LOOK_VIEW, LOOKS_FILE, Look, check_seed, looks_jsonl
from scenegen.looks.stage import PictureSetup, places_of, poses_of, stage_of, usual_size
from scenegen.looks.textures import Textures
from scenegen.needs import need
from scenegen.pictures.figures.sheet import MAX_THUMBNAILS, contact_sheet, thumbnail_size
from scenegen.pictures.render.files import (
    DEPTH_UNIT,
    FIRST_ID,
    GROUND_ID,
    TABLE_ID,
    Model,
    PictureOptions,
    camera_size,
    check_renderer,
    check_request,
    declared_camera,
)
from scenegen.pictures.render.worker import RenderJob
from scenegen.pose import flat
from scenegen.processes.pool import Pool
from scenegen.processes.process import cores
from scenegen.scenes.data import SceneFile, ShapeData
from scenegen.scenes.files import scene_name, whole_files
from scenegen.scenes.own_files import is_read, own_file, read_files
from scenegen.things.colored_mesh import check_texture
from scenegen.things.meshfile import mesh_surfaces
from scenegen.things.urdf import robot_surfaces


def cameras_json(file: SceneFile, stage: PictureSetup, options: PictureOptions, looks: Sequence[Look] = ()) -> bytes:
    """The file's content. World: metres, x to the right, y away from the viewer, z up, 0 the table. Camera: x to the
    right, y down, z ahead. Pixels: u to the right, v down, (0, 0) the upper left corner of the picture, so that the
    middle of the first pixel is (0.5, 0.5)."""
    views: dict[str, Any] = {}
    for view in options.views:
        if options.is_of_look(view):  # a camera for each picture: looks.jsonl has them
            continue
        camera = options.camera(view, stage.corners())
        kind = "orthographic" if camera.orthographic else "perspective"
        views[view] = {
            "kind": kind,
            "intrinsics": camera.intrinsics(),
            "world_to_camera": [[round(value, 12) + 0.0 for value in row] for row in camera.extrinsics().tolist()],
        }
    ids = {GROUND_ID: "ground and walls" if any(look.walls_distance for look in looks) else "ground", TABLE_ID: "table"}
    boards = [region.name for region in file.regions if region.height]
    ids |= dict(enumerate([*(item.name for item in file.objects), *boards], FIRST_ID))
    data = {
        "size": list(options.size),
        "formula": {
            "perspective": "u = fx x / z + cx, v = fy y / z + cy",
            "orthographic": "u = fx x + cx, v = fy y + cy",
        },
        "depth": {"png_unit_in_metres": DEPTH_UNIT, "of": "z of the camera's frame at the middle of each pixel"},
        "views": views,
        "ids": {str(number): name for number, name in ids.items()},
    }
    return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()


def looks_record(looks: Sequence[Look], seed: int, stage: PictureSetup, options: PictureOptions) -> bytes:
    """`looks.jsonl`: each scene's pictures and look, with the camera of the view "look" if that is drawn."""
    names = [f"{scene_name(number, len(looks))}_" for number in range(1, len(looks) + 1)]
    files = [("pictures", [f"{name}{view}.png" for view in options.views]) for name in names]
    own = any(map(options.is_of_look, options.views))
    cameras = [look.camera(stage.corners(), options.size) if own else None for look in looks]
    return looks_jsonl(looks, seed, files, cameras)


def draw(
    stage: PictureSetup,
    poses: npt.NDArray[np.float64],
    options: PictureOptions,
    workers: int,
    looks: Sequence[Look] | None = None,
    models: Sequence[Model | None] = (),
    textures: Textures | None = None,
) -> Generator[dict[tuple[str, str], bytes], None, None]:
    """(view, ending) -> file of every scene, in order; `poses` is (scenes, objects, 3), `looks` has one for each scene,
    with their `textures`, `models` what is drawn of each object instead of its shape, if anything.
    The same bytes for any `workers`.

    Close the generator to end the processes early. Raises ScenegenError if one of them fails, RequestError if pybullet
    is not installed.
    """
    need("pybullet", "to draw pictures")
    places = places_of(stage, poses)
    stage, origin = stage.near_origin()
    places[..., :2] -= origin
    options = options.shift(*origin)
    given = [None] * len(places) if looks is None else [look.shift(*origin) for look in looks]
    job = RenderJob(stage, options, models, textures)
    with Pool(job, workers, what="a process that draws", unit="scene", spare="a smaller size or fewer workers") as pool:
        yield from pool.map(list(zip(places, given, strict=True)))


SHEET, CAMERAS = "contact_sheet.png", "cameras.json"
SHEET_VIEWS = (
    LOOK_VIEW,
    "perspective",
    "three-quarter",
    "front",
    "top",
)  # for the contact sheet: the first of these that is drawn


@dataclass(frozen=True, slots=True)
class Rendered:
    """The paths of the files: the pictures in scene order (all views of the first scene first), the contact sheet, the
    cameras, and for each picture its depth and its mask, if requested."""

    pictures: tuple[Path, ...]
    sheet: Path
    cameras: Path
    beside: tuple[Path, ...] = ()


def render_scenes(
    file: SceneFile,
    out: Path,
    *,
    views: tuple[str, ...] | None = None,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
    distinct: bool = False,
    transparent: bool = False,
    depth: bool = False,
    masks: bool = False,
    renderer: str = "software",
    looks: str | Path | None = None,
    seed: int = 0,
    meshes: Path | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
    rest: npt.NDArray[np.float64] | None = None,
) -> Rendered:
    """Draw every scene of a file into the folder `out` (made if its parent exists).

    Files are scene_0001_top.png, scene_0001_perspective.png, ..., contact_sheet.png and cameras.json (see `rig`).
    `views` are of "top" (straight down, x to the right, y up), "perspective" and "front" (from the viewer's side, -y,
    looking towards +y, from high and from low) and "three-quarter" (from the right of it). `size` is (width, height) in
    pixels, by default (640, 480) for a square workspace and wider for a wide one (`usual_size`). `camera` is the name
    of a camera that the scenes' spec declares: then it is the one view, and `size` has its shape. `distinct` gives
    objects that would look the same different colours. `transparent` leaves the ground below the table out. With
    `depth`, scene_0001_top_depth.png holds tenths of millimetres in 16 bits; with `masks`, scene_0001_top_mask.png
    holds the number of what each pixel shows, as cameras.json lists them; both also as arrays `depth` (float32, metres)
    and `mask` (uint16) in scene_0001_top.npz. An object that is not in the library is drawn as a block; its name is
    written beside it, unless depth or masks are saved. The contact sheet says which objects overlap. `renderer` is
    "software", which draws the same everywhere, or "egl", which needs a graphics card.

    `looks` names a TOML file of distributions, or "random": each scene then has a look of its own, drawn from `seed`
    and its index alone, the default view is "look", from a camera that the look places, and looks.jsonl says what was
    drawn (see `looks_jsonl`). Textures that the file names are found from its folder.

    `meshes` is the folder that the spec was in: objects whose shape is `mesh` or `urdf` of a file there are drawn as
    that file shows them, in its colours and textures, instead of as their outline.

    `rest` (n, N, 7) are places and quaternions, w first, of scenes that came to rest in a simulator: objects are drawn
    there instead.

    `workers` processes draw, by default one per core; the bytes do not depend on it. `progress` is called with scenes
    done and scenes in all. Files appear whole, and those of this call are removed if it fails.

    Raises RequestError for a wrong view, size or number of workers and if pybullet is not installed, DataError for a
    file without scenes or a mesh that cannot be drawn, OutputError if a file cannot be written.
    """
    declared = None
    if camera is not None:
        if views is not None:
            raise RequestError(CONFLICTING_ARGUMENTS(one="camera", other="views"))
        declared = declared_camera(file.spec.checked_spec.cameras, camera)
        size = camera_size(declared, size)
    size = usual_size(file) if size is None else size
    if views is None:
        views = USUAL_VIEWS if looks is None else (LOOK_VIEW,)
    check_request(views, size, workers, looks=looks is not None)
    views = views if declared is None else (declared.name,)
    given = None if looks is None else read_looks(looks)
    names_of_things = [item.name for item in file.objects]
    drawn = None if given is None else given.draw_looks(check_seed(seed), len(file.scenes), names_of_things)
    need("pybullet", "to draw pictures")
    views = tuple(dict.fromkeys(views))
    check_renderer(renderer)
    options = PictureOptions(views, size, transparent, depth, masks, renderer, declared)
    if not file.scenes:
        raise DataError(NO_SCENES())
    stage, poses = stage_of(file, distinct=distinct), poses_of(file)
    if rest is not None:
        poses = np.concatenate([flat(poses), rest[..., 2:]], axis=2)
    models = () if meshes is None else models_of(file, meshes)
    textures = None if given is None else Textures(given.files)
    total = len(file.scenes)
    shown_view = views[0] if declared else next(view for view in SHEET_VIEWS if view in views)
    small = thumbnail_size(size, total)
    thumbnails: list[Image.Image] = []
    names: list[str] = []
    beside: list[str] = []
    # A run that fails keeps the pictures of an earlier one.
    with whole_files(out) as put:
        drawing = draw(stage, poses, options, min(workers or cores(), total), drawn, models, textures)
        with contextlib.closing(drawing) as scenes:
            for number, files in enumerate(scenes, start=1):
                for (view, ending), data in files.items():
                    name = f"{scene_name(number, total)}_{view}{ending}"
                    put(name, data)
                    (names if ending == ".png" else beside).append(name)
                if number <= MAX_THUMBNAILS:
                    thumbnails.append(_small(files[shown_view, ".png"], small))
                if progress is not None:
                    progress(number, total)
        put(SHEET, contact_sheet(file, thumbnails, planned=rest is None))
        put(CAMERAS, cameras_json(file, stage, options, drawn or ()))
        if drawn is not None:
            put(LOOKS_FILE, looks_record(drawn, seed, stage, options))
    paths, more = (tuple(out / name for name in some) for some in (names, beside))
    return Rendered(paths, out / SHEET, out / CAMERAS, more)


def _small(data: bytes, size: tuple[int, int]) -> Image.Image:
    """A picture for the contact sheet, on its paper."""
    with Image.open(io.BytesIO(data)) as picture:
        small = picture.resize(size, Image.Resampling.LANCZOS)
    if small.mode != "RGBA":
        return small
    sheet = Image.new("RGB", size, PAPER)
    sheet.paste(small, mask=small)
    return sheet


def pictures(
    file: SceneFile,
    view: str,
    size: tuple[int, int],
    *,
    distinct: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Iterator[Image.Image]:
    """The pictures of a file's scenes, one after the other, from one view. Raises what `render_scenes` raises."""
    stage, total = stage_of(file, distinct=distinct), len(file.scenes)
    options = PictureOptions((view,), size)
    with contextlib.closing(draw(stage, poses_of(file), options, min(workers or cores(), total))) as scenes:
        for number, files in enumerate(scenes, start=1):
            with Image.open(io.BytesIO(files[view, ".png"])) as picture:
                yield picture.convert("RGB")
            if progress is not None:
                progress(number, total)


def still_outlines(file: SceneFile, folder: Path) -> tuple[str, ...]:
    """The names of objects from files that are not drawn as they are, of scenes that `models_of` has read."""
    return tuple(one.name for one in file.objects if one.shape.path and not is_read(one.shape, folder))


def models_of(file: SceneFile, folder: Path) -> tuple[Model | None, ...]:
    """The surfaces of every object whose shape is `mesh` or `asset` of a glTF, .obj, .stl or URDF file, or `urdf`, in
    the object's frame (z = 0 the lowest point of its outline); None for other objects. `folder` is where the spec lay;
    a file outside it is not read.

    Raises DataError where a file cannot be read or drawn, where it has another outline than the scenes were made
    with, and where no object has such a file.
    """
    return tuple(read_files(file, folder, lambda shape: _model(folder, shape)))


def _model(folder: Path, shape: ShapeData) -> Model:
    file = own_file(folder, shape)
    made = robot_surfaces(file.data, file.beside) if file.is_robot else mesh_surfaces(file.path, file.data, file.beside)
    for texture in {one.texture for one in made if one.texture}:
        check_texture(texture, "a texture of it")
    return tuple(replace(one, vertices=one.vertices @ file.matrix.T + file.offset) for one in made)
