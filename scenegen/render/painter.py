"""Pictures of scenes with pybullet's software renderer. It and `drop` are the only modules that import pybullet.

Bodies are made once and moved from scene to scene; pictures are drawn larger and averaged down where they are not huge.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pybullet

from scenegen.assets import parts_of
from scenegen.assets.mesh import Mesh, box, shaded
from scenegen.assets.palette import RGB
from scenegen.render.camera import Camera, frame
from scenegen.render.light import TOWARDS, Image, Lighting, Picture, light_camera
from scenegen.render.stage import WOOD, Stage

LARGEST = 4096  # pixels along a side that pybullet is asked for
SHADING = {"lightAmbientCoeff": 0.60, "lightDiffuseCoeff": 0.46, "lightSpecularCoeff": 0.03}


class Painter:
    """Draws scenes of one stage. Holds a connection to pybullet: use it as a context manager."""

    def __init__(self, stage: Stage, views: tuple[str, ...], size: tuple[int, int]) -> None:
        self.factor = 2 if 2 * max(size) <= LARGEST else 1
        self._light = light_camera(stage)
        self._lighting: dict[str, Lighting] = {}
        with _Studio() as bare:
            x0, y0, x1, y1 = stage.table
            slab = box(x1 - x0, y1 - y0, stage.thickness, 0.12 * stage.thickness)
            bare.add(slab.moved((x0 + x1) / 2.0, (y0 + y1) / 2.0, -stage.thickness), WOOD)
            _, light = bare.shoot(self._light)
            for view in views:
                camera = frame(view, stage.corners(), size)
                colors, depth = bare.shoot(self._raw(camera))
                self._lighting[view] = Lighting(stage, camera, self.factor, colors, depth, light)
        # Far outside every picture, yet near enough for the renderer's single precision.
        far = 20.0 * stage.side
        x0, y0, x1, y1 = stage.table
        self._low, self._high = (x0 - far, y0 - far, -math.tau), (x1 + far, y1 + far, math.tau)
        self._studio = _Studio()
        self._things: list[list[int]] = []
        for thing in stage.things:
            parts = parts_of(thing.shape, thing.color)
            self._things.append([self._studio.add(part.mesh, part.color) for part in parts])

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *_: object) -> None:
        self._studio.close()

    def paint(self, poses: npt.NDArray[np.float64]) -> dict[str, Picture]:
        """View -> picture (height, width, 3), of a scene with poses (objects, 3)."""
        for bodies, (x, y, theta) in zip(self._things, np.clip(poses, self._low, self._high), strict=True):
            for body in bodies:
                self._studio.place(body, float(x), float(y), float(theta))
        _, light = self._studio.shoot(self._light)
        return {
            view: lighting(*self._studio.shoot(self._raw(lighting.camera)), light)
            for view, lighting in self._lighting.items()
        }

    def _raw(self, camera: Camera) -> Camera:
        return camera.resized((camera.size[0] * self.factor, camera.size[1] * self.factor))


class _Studio:
    """One world of pybullet, without physics and without a window."""

    def __init__(self) -> None:
        self._client = pybullet.connect(pybullet.DIRECT)

    def __enter__(self) -> _Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        pybullet.disconnect(physicsClientId=self._client)

    def add(self, mesh: Mesh, color: RGB) -> int:
        """A body of this form and colour; returns its number."""
        vertices, normals, indices = shaded(mesh)
        shape: Any = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=vertices.tolist(),
            normals=normals.tolist(),
            indices=indices.tolist(),
            rgbaColor=(*color, 1.0),
            specularColor=(0.0, 0.0, 0.0),
            physicsClientId=self._client,
        )
        body: int = pybullet.createMultiBody(0.0, -1, shape, physicsClientId=self._client)
        return body

    def place(self, body: int, x: float, y: float, theta: float) -> None:
        turn = (0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0))
        pybullet.resetBasePositionAndOrientation(body, (x, y, 0.0), turn, physicsClientId=self._client)

    def shoot(self, camera: Camera) -> tuple[Picture, Image]:
        """Colours (height, width, 3) and pybullet's depth buffer (height, width)."""
        width, height = camera.size
        _, _, colors, depth, _ = pybullet.getCameraImage(
            width,
            height,
            camera.view.T.ravel().tolist(),
            camera.projection.T.ravel().tolist(),
            lightDirection=TOWARDS,
            shadow=0,
            flags=pybullet.ER_NO_SEGMENTATION_MASK,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
            **SHADING,
        )
        picture = np.asarray(colors, dtype=np.uint8).reshape(height, width, 4)[..., :3]
        return picture, np.asarray(depth, dtype=np.float32).reshape(height, width)
