"""Shares that a spec's cameras see, held against pictures of the meshes that the library's objects are drawn with.

    python -m experiments.sight OUT.jsonl [--pairs 10000] [--seed 0]
    python -m experiments.sight OUT.jsonl --table

Tables of six objects drawn by lot from the library, each seen by a camera drawn by lot, 60 cm to 1.5 m away and 15 to
60 degrees over the table. Of each object that the spec or the picture says is partly hidden, a line of JSON has both
shares: that of a picture is the number of pixels that show the object, over those that show it where it is alone, in a
picture of 96 x 96 that it fills.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import scenegen
from scenegen.lang.sights import label_values, sights_of
from scenegen.looks.camera import Camera, from_place
from scenegen.pictures.render.painter import Studio, heading_quaternion
from scenegen.pose import as_rows
from scenegen.things.bodies import parts_of_asset
from scenegen.things.furniture import Cabinet, Crate, Drawer, Rack, RoundSolid, ShelfUnit, Vessel
from scenegen.things.library import ASSETS
from scenegen.things.mesh import join

THINGS, SCENES, PIXELS = 6, 40, 96
SIDE = 0.6  # metres: of the table
NEAR = 0.02  # of the way to where the camera looks: what is nearer is not drawn
AWAY = (0.0, 0.0, -50.0)
LOW = 0.03  # metres: what is lower lies flat
OPEN = ("rack", "shelfunit")  # which can be seen through


def kind_of(name: str) -> str:
    """What a thing is, as far as its sight goes."""
    asset = ASSETS[name]
    if isinstance(asset.form, ShelfUnit | Cabinet | Drawer | Rack):
        return "furniture"
    if isinstance(asset.form, Vessel | Crate):
        return "vessels and crates"
    if isinstance(asset.form, RoundSolid):
        return "turned on an axis"
    if asset.flat:
        return "blocks and boards"
    return "flat things" if asset.height < LOW else "others"


class Table:
    """The meshes of some things, and pictures of them."""

    def __init__(self, names: list[str], studio: Studio) -> None:
        self.studio, self.meshes = studio, [join([part.mesh for part in parts_of_asset(ASSETS[one])]) for one in names]
        self.bodies = [studio.add(mesh, (0.5, 0.5, 0.5)) for mesh in self.meshes]

    def put(self, which: int, pose: Any) -> None:
        w, *axis = heading_quaternion(float(pose[2]))
        self.studio.place(self.bodies[which], (float(pose[0]), float(pose[1]), 0.0), (*axis, w))

    def share(self, which: int, poses: Any, eye: Any, target: Any, field: float) -> float:
        """The share of a thing that the picture shows, where the others are at their places."""
        x, y, theta = poses[which]
        points = self.meshes[which].turn(float(theta)).shift(float(x), float(y)).vertices
        near = eye + NEAR * (target - eye)  # whatever stands before the thing is drawn
        camera = close_up(from_place(np.vstack([points, near]), (PIXELS, PIXELS), eye, target, field), points)
        counts = []
        for others in (True, False):
            for one in range(len(poses)):
                if one == which or others:
                    self.put(one, poses[one])
                else:
                    self.studio.place(self.bodies[one], AWAY, (0.0, 0.0, 0.0, 1.0))
            counts.append(int((self.studio.shoot(camera.centre_pixels())[2] == self.bodies[which]).sum()))
        return counts[0] / max(counts[1], 1)


def close_up(camera: Camera, points: Any) -> Camera:
    """The part of a picture that some points fill."""
    pixels = camera.project(points) / PIXELS
    (left, top), (right, bottom) = pixels.min(axis=0) - 0.01, pixels.max(axis=0) + 0.01
    cut = np.eye(4)
    cut[0, 0], cut[1, 1] = 1.0 / (right - left), 1.0 / (bottom - top)
    cut[0, 3], cut[1, 3] = -(left + right - 1.0) * cut[0, 0], (top + bottom - 1.0) * cut[1, 1]
    return Camera(camera.view, cut @ camera.projection, camera.size)


def measure(seed: int) -> Iterator[dict[str, Any]]:
    """Lines without end."""
    rng = np.random.default_rng(seed)
    for number in itertools.count():
        names = [str(one) for one in rng.choice(sorted(ASSETS), THINGS)]
        turn, rise, far, field = rng.uniform((0.0, 15.0, 0.6, 35.0), (math.tau, 60.0, 1.5, 60.0)).tolist()
        flat = far * math.cos(math.radians(rise))
        eye = SIDE / 2 + flat * math.cos(turn), SIDE / 2 + flat * math.sin(turn), far * math.sin(math.radians(rise))
        target = SIDE / 2, SIDE / 2, 0.03
        places = (", ".join(f"{one:.4f}" for one in point) for point in (eye, target))
        text = f"workspace [0, {SIDE}] x [0, {SIDE}]\n" + "camera one = at ({}) looks at ({})".format(*places)
        text += f" fov {field:.4f} deg, 1:1\n"
        text += "".join(f"object t{place} = {name}\n" for place, name in enumerate(names)) + "all: noOverlap()\n"
        spec = scenegen.parse(text)
        try:
            drawn = scenegen.sample(spec, phi={"all": (0.002, None)}, n=SCENES, seed=number, timeout=10)
        except scenegen.ScenegenError:
            continue
        sights = sights_of(spec.checked)
        assert sights is not None
        camera = spec.checked.cameras[0]
        rows = as_rows(drawn.poses)
        views, shares = sights.views(rows), label_values(sights.of_shares, rows)
        with Studio("software") as studio:
            table = Table(names, studio)
            for scene, poses in enumerate(drawn.poses):
                for one in views:
                    beyond = float(shares[f"share {one.thing} {one.camera}"][scene]) > 1.0  # clear of all shadows
                    if beyond or not one.any[scene]:
                        continue
                    share = table.share(one.thing, poses, np.array(camera.eye), np.array(camera.target), field)
                    mine = float(one.share[scene])
                    if 0.0 < share < 1.0 or 0.0 < mine < 1.0:
                        others = [name for place, name in enumerate(names) if place != one.thing]
                        yield {"thing": names[one.thing], "others": others, "spec": mine, "picture": share}


def table(lines: list[dict[str, Any]]) -> None:
    """Prints how far the two shares are apart, by kind of the thing that is seen."""
    kinds: dict[str, list[float]] = {}
    for line in lines:
        error = abs(line["spec"] - line["picture"])
        open_ = not {line["thing"], *line["others"]}.isdisjoint(OPEN)
        for kind in (kind_of(line["thing"]), f"all {'with' if open_ else 'without'} a rack or a shelf unit", "all"):
            kinds.setdefault(kind, []).append(error)
    print("| seen | pairs | within 2 points | within 5 points | median | 9 of 10 within |")
    print("|---|---|---|---|---|---|")
    for kind, errors in sorted(kinds.items(), key=lambda item: (item[0].startswith("all"), item[0])):
        off = np.array(errors)
        cells = [kind, f"{len(off):,}", f"{(off <= 0.02).mean():.0%}", f"{(off <= 0.05).mean():.0%}"]
        cells += [f"{100 * np.median(off):.1f}", f"{100 * np.quantile(off, 0.9):.1f}"]
        print(f"| {' | '.join(cells)} |")


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("out", type=Path)
    reader.add_argument("--pairs", type=int, default=10_000)
    reader.add_argument("--seed", type=int, default=0)
    reader.add_argument("--table", action="store_true")
    given = reader.parse_args()
    if not given.table:
        with given.out.open("w") as file:
            for line in itertools.islice(measure(given.seed), given.pairs):
                file.write(json.dumps(line) + "\n")
    table([json.loads(line) for line in given.out.read_text().splitlines()])


if __name__ == "__main__":
    main()
