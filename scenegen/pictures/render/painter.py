"""Pictures of scenes with pybullet's software renderer. Only it, `drop` and `load` import pybullet.

Bodies are made once and moved from scene to scene; pictures are drawn larger and averaged down unless they are very
large.
"""

from __future__ import annotations

import importlib.util
import io
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import PIL.Image
import pybullet

from scenegen.geometry import Polygon
from scenegen.geometry.workspace import BOARD
from scenegen.looks.camera import Camera
from scenegen.looks.look import Look, Tint
from scenegen.looks.stage import WOOD, PictureRegion, PictureSetup
from scenegen.looks.textures import Textures
from scenegen.pictures.render.files import FIRST_ID, Image, Model, Picture, PictureOptions, RenderedView
from scenegen.pictures.render.light import TOWARDS, Lighting, landscape_camera, light_camera
from scenegen.things import PLAIN
from scenegen.things.bodies import parts_of
from scenegen.things.colored_mesh import ColoredMesh
from scenegen.things.library import RGB
from scenegen.things.mesh import Mesh, box, plain, shade_mesh
from scenegen.things.outline import Floats
from scenegen.things.palette import mix

Bodies = npt.NDArray[np.int32]

MAX_BODY_FACES = 20_000  # of a body: pybullet takes no more than some 130,000 corners
MAX_RAW_SIDE = 4096  # maximum side of pybullet's pictures in pixels
SHADING = {"lightAmbientCoeff": 0.60, "lightDiffuseCoeff": 0.46, "lightSpecularCoeff": 0.03}


class Painter:
    """Draws scenes of one stage. Holds a connection to pybullet: use it as a context manager."""

    def __init__(
        self,
        stage: PictureSetup,
        options: PictureOptions,
        look: Look | None = None,
        models: Sequence[Model | None] = (),
        textures: Textures | None = None,
    ) -> None:
        self.factor = 2 if 2 * max(options.size) <= MAX_RAW_SIDE else 1
        self._stage, self._options = stage, options
        self._textures = Textures({}) if textures is None else textures
        self._landscape = landscape_camera(stage)
        # Far outside every picture, but near enough for the renderer's single precision.
        far = 20.0 * stage.side
        x0, y0, x1, y1 = stage.table
        self._low, self._high = (x0 - far, y0 - far, -math.tau, 0.0), (x1 + far, y1 + far, math.tau, far)
        self._studio = Studio(options.renderer)
        self._things: list[list[int]] = []
        for thing, model in zip(stage.things, models or [None] * len(stage.things), strict=True):
            if model is not None:
                self._things.append([body for surface in model for body in self._studio.show(surface, thing.color)])
                continue
            parts = parts_of(thing.shape, thing.color)
            if look is not None and (thing.shape.asset in PLAIN or isinstance(thing.shape.footprint, Polygon)):
                parts = parts[:1]  # pictures to train with show no mark for the heading
            self._things.append([self._studio.add(part.mesh, part.color) for part in parts])
        boards = [[self._board(patch)] for patch in stage.patches if patch.height]
        self._studio.tidy_up()
        shown = (*self._things, *boards)
        owners = [(body, number) for number, bodies in enumerate(shown, FIRST_ID) for body in bodies]
        self._owner = np.zeros(1 + max((body for body, _ in owners), default=0), dtype=np.uint16)
        for body, number in owners:
            self._owner[body] = number
        self.dress(look)

    def dress(self, look: Look | None) -> None:
        """Colour the objects and light the bare table by a look, or as usual: once for all scenes that share it."""
        stage = self._stage
        if look is not None:
            for bodies, tint in zip(self._things, look.tints, strict=False):  # a look has none, or one for each
                for body in bodies:
                    self._studio.tint(body, tint)
        self._look, self._lighting = look, {}
        self._light = light_camera(stage, TOWARDS if look is None else look.towards)
        with Studio(self._options.renderer) as bare:
            x0, y0, x1, y1 = stage.table
            slab = box(x1 - x0, y1 - y0, stage.thickness, 0.12 * stage.thickness)
            middle = (x0 + x1) / 2.0, (y0 + y1) / 2.0
            bare.add(slab.shift(*middle, -stage.thickness), WOOD if look is None else look.table)
            _, light, _ = bare.shoot(self._light, look)
            for view in self._options.views:
                if look is not None and self._options.is_of_look(view):
                    camera = look.camera(stage.corners(), self._options.size)
                else:
                    camera = self._options.camera(view, stage.corners())
                colors, depth, _ = bare.shoot(self._raw(camera), look)
                self._lighting[view] = Lighting(
                    stage,
                    camera,
                    self.factor,
                    colors,
                    depth,
                    light,
                    transparent=self._options.transparent,
                    look=look,
                    textures=self._textures,
                )

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *_: object) -> None:
        self._studio.close()

    def paint(self, places: npt.NDArray[np.float64]) -> dict[str, RenderedView]:
        """View -> picture of a scene with places (objects, 4): x, y, theta, and the height of what they stand on; NaN
        of objects that are not there. In (objects, 8) a quaternion follows, w first, which counts instead of theta."""
        places, turns = places[:, :4], places[:, 4:].tolist()
        places = np.where(np.isnan(places[:, :1]), (*self._high[:2], 0.0, 0.0), places)
        clipped = np.clip(places, self._low, self._high)
        for bodies, (x, y, theta, z), turn in zip(self._things, clipped, turns, strict=True):
            w, *axis = turn if turn and not math.isnan(turn[0]) else heading_quaternion(float(theta))
            for body in bodies:
                self._studio.place(body, (float(x), float(y), float(z)), (*axis, w))
        _, light, _ = self._studio.shoot(self._light, self._look)
        _, landscape, _ = self._studio.shoot(self._landscape, self._look)
        shots = {}
        for view, lighting in self._lighting.items():
            colors, depth, seen = self._studio.shoot(self._raw(lighting.camera), self._look)
            shots[view] = lighting(colors, depth, self._owner[np.maximum(seen, 0)], light, landscape)
        return shots

    def _board(self, patch: PictureRegion) -> int:
        """A body for a region at a height, put in its place."""
        thick = min(BOARD, patch.height)
        x, y, theta = patch.pose
        (part, *_) = plain(patch.footprint, thick, mix(patch.color, WOOD, 0.5))
        body = self._studio.add(part.mesh, part.color)
        w, *axis = heading_quaternion(theta)
        self._studio.place(body, (x, y, patch.height - thick), (*axis, w))
        return body

    def camera(self, view: str) -> Camera:
        """The picture of one view."""
        return self._lighting[view].camera

    def _raw(self, camera: Camera) -> Camera:
        raw = camera.with_size((camera.size[0] * self.factor, camera.size[1] * self.factor))
        return raw if self.factor > 1 else raw.centre_pixels()


def _shading(look: Look) -> dict[str, Any]:
    strength = {"lightAmbientCoeff": look.light_ambient, "lightDiffuseCoeff": look.light_intensity}
    return SHADING | strength | {"lightColor": look.light_color}


class Studio:
    """One world of pybullet, without physics and without a window."""

    def __init__(self, renderer: str) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)
        self._plugin: int | None = None
        self._textures: dict[bytes, int] = {}
        self._colors: dict[int, RGB] = {}  # of the bodies, as they were made
        self._renderer = pybullet.ER_TINY_RENDERER
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        if renderer == "egl":
            library = importlib.util.find_spec("eglRenderer")
            assert library is not None and library.origin is not None
            self._plugin = pybullet.loadPlugin(library.origin, "_eglRendererPlugin", physicsClientId=self._client)
            self._renderer = pybullet.ER_BULLET_HARDWARE_OPENGL
            self._folder = tempfile.TemporaryDirectory(prefix="scenegen.")

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._plugin is not None:
            pybullet.unloadPlugin(self._plugin, physicsClientId=self._client)
        pybullet.disconnect(physicsClientId=self._client)
        self.tidy_up()

    def tidy_up(self) -> None:
        """Remove the files of the meshes after all bodies were made, so that processes end without a warning."""
        if self._folder is not None:
            self._folder.cleanup()

    def show(self, surface: ColoredMesh, color: RGB) -> list[int]:
        """Bodies for a surface, with its texture; `color` is for one that has none."""
        bodies = []
        # Files have a vertex for each texture and normal that meets in a point: together they are shaded smoothly.
        points, same = np.unique(surface.vertices, axis=0, return_inverse=True)
        for start in range(0, len(surface.faces), MAX_BODY_FACES):
            faces = surface.faces[start : start + MAX_BODY_FACES]
            uv = None
            if surface.uv is not None and surface.texture:
                uv = surface.uv[faces.ravel()] * (1.0, -1.0) + (0.0, 1.0)
            body = self.add(Mesh(points, same.ravel()[faces]), surface.color or color, uv)
            if surface.texture:
                pybullet.changeVisualShape(
                    body, -1, textureUniqueId=self._texture(surface.texture), physicsClientId=self._client
                )
            bodies.append(body)
        return bodies

    def _texture(self, data: bytes) -> int:
        """pybullet's number of a texture, which it reads from a file alone."""
        if data not in self._textures:
            with tempfile.TemporaryDirectory(prefix="scenegen.") as folder:
                path = Path(folder) / "texture.png"
                with PIL.Image.open(io.BytesIO(data)) as image:
                    image.convert("RGB").save(path)
                self._textures[data] = pybullet.loadTexture(str(path), physicsClientId=self._client)
        return self._textures[data]

    def add(self, mesh: Mesh, color: RGB, uv: Floats | None = None) -> int:
        """A body of this form and colour, with places in a texture for the corners of its faces, (3F, 2), if it has
        one; returns its number."""
        shape: Any = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            **self._form(mesh, uv),
            rgbaColor=(*color, 1.0),
            specularColor=(0.0, 0.0, 0.0),
            physicsClientId=self._client,
        )
        body: int = pybullet.createMultiBody(0.0, -1, shape, physicsClientId=self._client)
        self._colors[body] = color
        return body

    def tint(self, body: int, tint: Tint) -> None:
        """Give a body another colour than it was made with."""
        color = tint(self._colors[body])
        pybullet.changeVisualShape(body, -1, rgbaColor=(*color, 1.0), physicsClientId=self._client)

    def _form(self, mesh: Mesh, uv: Floats | None) -> dict[str, Any]:
        """A mesh as pybullet takes it; the card's renderer does not support meshes in memory."""
        vertices, normals, indices = shade_mesh(mesh)
        if self._folder is None:
            form = {"vertices": vertices.tolist(), "normals": normals.tolist(), "indices": indices.tolist()}
            return form if uv is None else form | {"uvs": uv.tolist()}
        path = Path(self._folder.name) / f"{len(list(Path(self._folder.name).iterdir()))}.obj"
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
        lines += [f"vn {x:.6g} {y:.6g} {z:.6g}" for x, y, z in normals]
        corners = indices.reshape(-1, 3) + 1
        if uv is None:
            lines += [f"f {a}//{a} {b}//{b} {c}//{c}" for a, b, c in corners]
        else:
            lines += [f"vt {u:.9g} {v:.9g}" for u, v in uv]
            lines += [f"f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}" for a, b, c in corners]
        path.write_text("\n".join(lines) + "\n")
        return {"fileName": str(path)}

    def place(self, body: int, at: tuple[float, float, float], turn: tuple[float, ...]) -> None:
        """`turn` is a quaternion, w last."""
        pybullet.resetBasePositionAndOrientation(body, at, turn, physicsClientId=self._client)

    def shoot(self, camera: Camera, look: Look | None = None) -> tuple[Picture, Image, Bodies]:
        """Colours (height, width, 3), pybullet's depth buffer and numbers of bodies (height, width), -1: none."""
        width, height = camera.size
        _, _, colors, depth, bodies = pybullet.getCameraImage(
            width,
            height,
            camera.view.T.ravel().tolist(),
            (camera.projection if self._plugin is None else camera.for_card()).T.ravel().tolist(),
            lightDirection=TOWARDS if look is None else look.towards,
            shadow=0,
            renderer=self._renderer,
            physicsClientId=self._client,
            **(SHADING if look is None else _shading(look)),
        )
        picture = np.asarray(colors, dtype=np.uint8).reshape(height, width, 4)[..., :3]
        buffer = np.asarray(depth, dtype=np.float32).reshape(height, width)
        if self._plugin is not None:
            buffer = camera.from_card(buffer)
        return picture, buffer, np.asarray(bodies, dtype=np.int32).reshape(height, width)


def heading_quaternion(theta: float) -> tuple[float, float, float, float]:
    """The quaternion of a heading, w first."""
    return math.cos(theta / 2.0), 0.0, 0.0, math.sin(theta / 2.0)
