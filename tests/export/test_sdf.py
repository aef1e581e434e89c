"""SDF worlds: by the specification's rules, and in the hands of PyBullet."""

import re
from xml.etree import ElementTree

import numpy as np
import pybullet
import pytest

from scenegen.things import shape_of
from scenegen.things.bodies import collision_of
from scenegen.things.meshfile import vertices
from scenegen.worlds.export.meshes import stl
from tests.export.sdf_facts import faults
from tests.export.worlds import crates, library, tower


@pytest.mark.long
@pytest.mark.parametrize("make", [tower, library])
def test_by_the_rules_of_the_specification(make, tmp_path):
    """And the meshes are there, named relatively."""
    (path,) = make().export(tmp_path / "all.sdf")
    root = ElementTree.parse(path).getroot()
    assert root.get("version") == "1.7" and faults(root) == []
    named = {uri.text for uri in root.iter("uri")}
    assert named == {f"all_meshes/{file.name}" for file in (tmp_path / "all_meshes").iterdir()}
    assert all(re.fullmatch(r"all_meshes/\w+\.obj", name) for name in named)


def test_the_rules_can_be_broken(tmp_path):
    (path,) = tower().export(tmp_path / "all.sdf")
    text = path.read_text()
    for change in (
        ("<gravity>0 0 -9.81</gravity>", ""),
        ("<gravity>0 0 -9.81</gravity>", "<gravity>0 0</gravity>"),
        ('<model name="mug">', '<model name="plate">'),
        ('<model name="mug">', "<model>"),
        ("<static>1</static>", "<static>yes</static>"),
        ("<mass>0.35</mass>", "<weight>0.35</weight>"),
        ("<geometry>", "<geometry>words"),
    ):
        assert change[0] in text
        assert len(faults(ElementTree.fromstring(text.replace(*change)))) >= 1, change


@pytest.mark.parametrize("together", [True, False])
def test_objects_are_where_the_scene_says(together, tmp_path):
    scenes = tower()
    files = scenes.export(tmp_path / ("all.world" if together else "all"), to="sdf")
    assert [path.name for path in files] == (["all.world"] if together else ["scene_0001.sdf", "scene_0002.sdf"])
    worlds = [world for path in files for world in ElementTree.parse(path).getroot()]
    assert [world.get("name") for world in worlds] == ["scene_0001", "scene_0002"]
    for k, world in enumerate(worlds):
        models = {model.get("name"): model for model in world.findall("model")}
        assert list(models) == ["floor", "table", *scenes.objects]
        found = np.array([[float(x) for x in models[name].findtext("pose").split()] for name in scenes.objects])
        np.testing.assert_allclose(found[:, [0, 1, 5]], scenes.poses[k], atol=1e-12)
        assert [name for name in models if models[name].findtext("static") == "1"] == ["floor", "table", "tray"]


@pytest.mark.parametrize("scene", [0, 1])
def test_pybullet_loads_it(scene, tmp_path, bullet):
    scenes = tower()
    path = scenes.export(tmp_path / "all", to="sdf")[scene]
    numbers = pybullet.loadSDF(str(path), physicsClientId=bullet.client)
    names = [pybullet.getBodyInfo(number, physicsClientId=bullet.client)[1].decode() for number in numbers]
    assert names == ["floor", "table", *scenes.objects]
    for number, name, (x, y, theta) in zip(numbers[2:], scenes.objects, scenes.poses[scene], strict=True):
        where, turned = bullet.frame(number)
        np.testing.assert_allclose([*where[:2], turned % (2 * np.pi)], [x, y, theta], atol=1e-6, err_msg=name)
    before = [bullet.frame(number)[0] for number in numbers]
    pybullet.setGravity(0, 0, -9.81, physicsClientId=bullet.client)
    for _ in range(240):
        pybullet.stepSimulation(physicsClientId=bullet.client)
    after = [bullet.frame(number)[0] for number in numbers]
    assert np.linalg.norm(np.subtract(after, before), axis=1).max() < 0.01


def test_pieces_read_back(tmp_path):
    """What collides: boxes written out, and OBJ files or, for PyBullet, STL files of the library's convex pieces."""
    tower().export(tmp_path / "all.sdf")
    pieces = collision_of(shape_of("mug"))
    boxes = 0
    for number, piece in enumerate(pieces, start=1):
        path = tmp_path / "all_meshes" / f"mug_hull_{number}.obj"
        boxes += not path.exists()
        if path.exists():
            np.testing.assert_allclose(vertices(path.name, path.read_bytes()), piece.vertices, atol=1e-9)
        corners = vertices("x.stl", stl(piece)).reshape(-1, 3, 3)
        np.testing.assert_allclose(corners, piece.vertices[piece.faces], atol=1e-7)
    assert boxes == 3  # the bars of the handle


def test_golden(golden, tmp_path):
    (path,) = crates().export(tmp_path / "all.sdf")
    golden("export/crates.sdf", path.read_text())
