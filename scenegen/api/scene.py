"""One scene of a set, with what it takes to draw it and to load it into a simulator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.scene.data import Pose, SceneData, SceneFile
from scenegen.scene.numbers import element


@dataclass(frozen=True, slots=True)
class Scene:
    """`poses` maps each object to where it stands (x and y in metres, theta in radians), `phi` each label to its value;
    `header` is the scene file it is of, without scenes; `rest` (N, 7) is as of a SceneSet. Two scenes are equal if
    poses and phi are."""

    poses: Mapping[str, Pose]
    phi: Mapping[str, float]
    header: SceneFile = field(repr=False, compare=False)
    rest: npt.NDArray[np.float64] | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        places = (
            f"{name} ({pose.x:.3f}, {pose.y:.3f}, {math.degrees(pose.theta):.0f} deg)"
            for name, pose in self.poses.items()
        )
        phi = (f"{label} {value:.3g}" for label, value in self.phi.items())
        return f"<Scene: {', '.join(places)}; phi {', '.join(phi)}>"

    def data(self) -> SceneData:
        """The scene as files hold it."""
        return SceneData(poses=dict(self.poses), phi=dict(self.phi), counts=self.counts or None)

    @property
    def counts(self) -> dict[str, int]:
        """How many things there are, by array of objects, where that is drawn; of an object of a category the number of
        its asset, from 1."""
        found: dict[str, int] = {}
        for one in self.header.counts:
            here = [k for k in range(1, one.most + 1) if element(one, k) in self.poses]
            found[one.name] = here[0] if one.assets else len(here)
        return found

    def file(self) -> SceneFile:
        """A scene file with this scene alone."""
        return self.header.model_copy(update={"scenes": [self.data()]})

    def _repr_png_(self) -> bytes | None:
        """For notebooks: the scene in perspective."""
        from scenegen.api.notebook import picture

        return picture(self.file(), self.rest)
