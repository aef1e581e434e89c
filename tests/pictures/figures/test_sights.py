"""Top views with robots and cameras: rings, frames, hands, and the share that is seen."""

import math
import re
from xml.etree import ElementTree as ET

import pytest

import scenegen
from scenegen.api.scene_arrays import rows_of
from scenegen.lang.formula.interpret import deciding_atom, evaluate
from scenegen.lang.spec import SpecCamera
from scenegen.looks.overlay import Ring
from scenegen.pictures.figures.dimensions import FigureScene, dimensions
from scenegen.pictures.figures.sights import FigureSights
from scenegen.pictures.figures.topview import topview

SVG = "{http://www.w3.org/2000/svg}"
FRONT = SpecCamera("front", (0.5, 0.1, 0.5), (0.5, 0.6, 0.0), math.radians(40.0), 4.0 / 3.0)


def ways(text, stroke):
    """The corners of every closed path of a colour, in pixels."""
    paths = [one.get("d") for one in ET.fromstring(text).iter(f"{SVG}path") if one.get("stroke") == stroke]
    return [
        [tuple(map(float, pair.split())) for pair in re.split("[ML]", way) if pair]
        for path in paths
        for way in path.rstrip("Z").split("Z")
    ]


def test_a_ring_has_its_two_circles_or_is_a_sector():
    def drawn(bearing):
        ring = Ring(0.1, 0.4, bearing)
        return ways(topview(FigureScene([], sights=FigureSights([((0.5, 0.5, 1.0), ring)])), width=264), "#2f6f9f")

    outer, inner = drawn(None)  # 240 pixels are a metre; the middle is in the middle
    assert {round(math.dist(one, (132, 132))) for one in outer} == {96}
    assert {round(math.dist(one, (132, 132))) for one in inner} == {24}
    (sector,) = drawn((-0.5, 0.5))
    assert {round(math.dist(one, (132, 132))) for one in sector} == {96, 24}
    turns = [math.atan2(132 - y, x - 132) for x, y in sector]
    assert (min(turns), max(turns)) == (pytest.approx(0.5, abs=0.01), pytest.approx(1.5, abs=0.01))


def test_a_camera_has_its_frame_its_eye_and_its_name():
    text = topview(FigureScene([], sights=FigureSights(cameras=[FRONT])), width=264)
    frame, _ = ways(text, "#9a5b13")
    assert len(frame) == 4 and "front" in [one.text for one in ET.fromstring(text).iter(f"{SVG}text")]
    (eye,) = ET.fromstring(text).iter(f"{SVG}circle")
    assert (float(eye.get("cx")), float(eye.get("cy"))) == (132.0, 264 - 12 - 24.0)


def test_of_many_clearances_only_the_one_that_decides_is_a_dimension():
    text = "robot arm = panda at (0.5, -0.25, NORTH)\nobject can, mug, bowl, box1\n"
    spec = scenegen.parse(text + "task: handRoom(can, arm, 0 deg, 2 cm) >= 0")
    scenes = scenegen.sample(spec, phi={"task": (-0.02, -0.001)}, n=20, seed=0)
    core, found = spec.checked.core, []
    for row in rows_of(spec.checked, scenes).T:
        values = evaluate(core, row.tolist())
        found.append(len(dimensions(core, deciding_atom(core, "task", values), row.tolist())))
    assert set(found) == {0, 1}  # none where it is how far the hand is above something


@pytest.mark.long
def test_figures_of_scenes(tmp_path):
    text = (
        "robot arm = panda at (0.5, -0.25, NORTH)\ncamera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) "
        "fov 60 deg, 4:3\nobject can, mug, bottle\nrequire noOverlap()\n"
        "task: graspable(can, arm) & visible(mug, front, 20 %, 70 %)"
    )
    scenes = scenegen.sample(scenegen.parse(text), phi={"task": (0.0, None)}, n=1, seed=0)
    (path,) = scenes.figures(tmp_path, "topview")
    words = [one.text for one in ET.fromstring(path.read_text()).iter(f"{SVG}text")]
    (mug,) = [one for one in words if one.startswith("mug: front sees ")]
    assert 20 <= int(mug.split()[3]) <= 70 and {"can", "bottle", "arm", "front"} <= set(words)
    assert len(ways(path.read_text(), "#3a3f47")) == 3  # two fingers and a palm
