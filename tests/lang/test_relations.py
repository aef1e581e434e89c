"""The relations of the prelude on scenes that were worked out on paper, and what each golden file has to show."""

import math
import re

import pytest
import torch

from scenegen.errors import Source
from scenegen.geometry import Box
from scenegen.lang.check.scope import prelude
from scenegen.lang.formula.core import Apply
from scenegen.lang.formula.interpret import phi
from scenegen.lang.syntax import ast
from scenegen.lang.syntax import ast as traversal
from scenegen.lang.syntax.parse import parse
from scenegen.learn.robustness import Robustness

from .relation_scenes import FOLDER, read

DEFINITIONS = {one.name.id: one for one in prelude().statements if isinstance(one, ast.Definition)}
FILES = sorted(FOLDER.glob("*.txt"))
SCENES = {path.stem: read(path)[1] for path in FILES}
CASES = [(name, scene) for name, scenes in SCENES.items() for scene in scenes]
EXACT = 1e-12
RIGHT = math.pi / 2.0
NUMBERS = {"leftEdge", "rightEdge", "bottomEdge", "topEdge", "mirrorImage"}  # no formulas: true of nothing


def label(case):
    return f"{case[0]}: {case[1].title}"


def test_each_definition_has_a_golden_file_and_each_file_a_definition():
    assert set(SCENES) == set(DEFINITIONS)


@pytest.mark.parametrize(("name", "scene"), CASES, ids=map(label, CASES))
def test_phi_by_hand(name, scene):
    assert phi(scene.spec().core, scene.rows)["task"] == pytest.approx(scene.phi, abs=EXACT, rel=0.0)
    if len(scene.poses) > 1:  # constants are folded when the spec is checked
        assert phi(scene.held().core, scene.rows)["task"] == pytest.approx(scene.phi, abs=EXACT, rel=0.0)


@pytest.mark.parametrize("name", SCENES)
def test_phi_by_hand_in_torch(name):
    for scene in SCENES[name]:
        rows = torch.tensor(scene.rows, dtype=torch.float64)[:, None]
        got = Robustness(scene.spec().core).rows(rows)
        assert got.item() == pytest.approx(scene.phi, abs=EXACT, rel=0.0), scene.title


def calls(scene, name):
    """How many arguments each call of the relation in a scene's task is given."""
    stack, counts = [parse(Source("task", scene.task)).bare], []
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Call) and node.function.id == name:
            counts.append(len(node.arguments))
        stack.extend(traversal.children(node))
    return counts


@pytest.mark.parametrize("name", SCENES)
def test_what_a_golden_file_shows(name):
    scenes = SCENES[name]
    assert len({scene.title for scene in scenes}) == len(scenes) >= 3
    given = [count for scene in scenes for count in calls(scene, name)]
    assert len(given) >= len(scenes)
    parameters = DEFINITIONS[name].parameters
    needed = sum(one.default is None for one in parameters)
    if needed < len(parameters):
        assert needed in given, "no scene leaves out what has a default"
        assert max(given) > needed, "no scene gives what has a default"
    if name not in NUMBERS:
        assert [scene.title for scene in scenes[:2]] == ["satisfied", "violated"]  # the pictures
        assert scenes[0].phi > 0.0 > scenes[1].phi
        assert any(abs(scene.phi) <= EXACT for scene in scenes), "no scene is at the limit"


def measures_footprints(scene):
    return any(isinstance(node, Apply) and node.shapes for node in scene.spec().core.nodes)


def askew(scene):
    """Whether a box stands at no multiple of a right angle."""
    shapes = [shape.footprint for shape in scene.spec().shapes]
    turns = [theta % RIGHT for _, _, theta in scene.poses]
    return any(isinstance(one, Box) and 0.1 < turn < RIGHT - 0.1 for one, turn in zip(shapes, turns, strict=True))


@pytest.mark.parametrize("name", [name for name, scenes in SCENES.items() if measures_footprints(scenes[0])])
def test_what_the_golden_file_of_a_footprint_relation_shows(name):
    scenes = SCENES[name]
    assert any("cylinder" in scene.text and "box" not in scene.text for scene in scenes), "no circles"
    assert any(map(askew, scenes)), "no box that stands askew"
    assert any(
        re.search(r"region|workspace|\([.\d]+, [.\d]+\)", re.sub(r"object.*", "", scene.text)) for scene in scenes
    ), "no region or point"
