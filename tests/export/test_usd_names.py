"""Names of prims and texts in USD files: any comes back. Axes of inertia, too."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scenegen.worlds.export.usd import identifiers
from scenegen.worlds.export.world import Record, principal
from tests.export.stages import faults, opened, poses, rotation, things
from tests.export.worlds import crates, scenes_of, world

pxr = pytest.importorskip("pxr")
from pxr import Sdf  # noqa: E402

from scenegen.worlds.export.usd import (  # noqa: E402
    UsdScenes,
    UsdStage,
    crate,
)

HOSTILE = [
    "block[1]",
    "block_1",
    "block[2]",
    "mug:025_mug",
    "mug_025_mug",
    "1st",
    "-",
    "é",
    "π",
    "a b",
    "a  b",
    "a_b",
    "Table",
    "_",
]


def test_names():
    found = identifiers(HOSTILE)
    assert all(Sdf.Path.IsValidIdentifier(name) and name.isascii() for name in found.values())
    assert len(set(found.values())) == len(HOSTILE)
    assert (
        found["block[1]"] == "block_1_2" and found["block[2]"] == "block_2" and found["mug:025_mug"] == "mug_025_mug_2"
    )
    assert all(found[name] == name for name in ("block_1", "mug_025_mug", "a_b", "Table", "_"))
    assert identifiers(["a[1]", "a:1", "a-1", "a_1_2"]) == {
        "a[1]": "a_1",
        "a:1": "a_1_3",
        "a-1": "a_1_4",
        "a_1_2": "a_1_2",
    }


@pytest.mark.parametrize("name", ["table", "Looks", 'a "b" <c> \\ \'"""', "é 🍜", "block[1]", "{}", "-"])
def test_objects_of_any_name(name, tmp_path):
    scenes = scenes_of(
        "object mug, plate\ntask: leftOf(mug, plate)", {"mug": (0.2, 0.5, 0.0), "plate": (0.6, 0.5, 0.0)}
    )
    first, *rest = scenes.header.objects
    header = scenes.header.model_copy(update={"objects": [first.model_copy(update={"name": name}), *rest]})
    scenes = type(scenes)(scenes.poses, scenes.phi, header, trusted=True)
    for path in (*scenes.export(tmp_path / "all", "usd"), *scenes.export(tmp_path / "all.usdc")):
        stage = opened(path)
        assert list(things(stage)) == [name, "plate"] and faults(stage) == []
        prim = things(stage)[name]
        assert name in (prim.GetName(), prim.GetDisplayName())
        assert len(stage.GetDefaultPrim().GetChildren()) == 3 and poses(stage, [name])[0, 0] == 0.2


def test_odd_letters_come_back(tmp_path):
    text = 'a\n"quoted" \'\'\' """ \\n \x1b \\x00 é 🍜 \\\n'
    stage = UsdStage("/Scene", "assembly", text)
    stage.finish()
    layer = stage
    facts = {"spec": text, "phi": {text: 0.1, "a:b": 1e-300}}
    layer.say("/Scene", facts)
    (tmp_path / "x.usda").write_bytes(layer.text())
    (tmp_path / "x.usdc").write_bytes(crate(layer.text()))
    for name in ("x.usda", "x.usdc"):
        found = opened(tmp_path / name)
        assert found.GetRootLayer().documentation == text
        assert found.GetDefaultPrim().GetCustomDataByKey("scenegen") == facts


def test_prims_have_the_same_names_in_every_scene():
    """Whoever else is there: `a:b` takes the name `a_b` even where only `a-b` is."""
    made = world(crates())
    bodies = (replace(made.bodies[0], name="a-b"),)
    record = Record("", {}, {}, {}, ("a:b", "a-b"))
    scene = UsdScenes(replace(made, bodies=bodies, poses=made.poses[:, :1], record=record), "meshes", ".usda")
    assert list(scene.names.values()) == ["a_b", "a_b_2"]
    files = [scene.one(index) for index in range(2)]
    assert all(b'def Xform "a_b_2"' in data and b'def Xform "a_b"' not in data for data in files)


def test_principal_axes_come_back_and_turn_as_little_as_they_can():
    rng = np.random.default_rng(3)
    for _ in range(200):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        values = rng.uniform(0.5, 1.0, size=3)
        matrix = turn @ np.diag(values) @ turn.T
        found, (w, x, y, z) = principal((matrix + matrix.T) / 2.0)
        assert w * w + x * x + y * y + z * z == pytest.approx(1.0) and w > math.cos(math.radians(63.0) / 2.0)
        axes = rotation(w, x, y, z)
        np.testing.assert_allclose(axes @ np.diag(found) @ axes.T, matrix, atol=1e-12)
    assert principal(np.diag([3.0, 1.0, 2.0])) == ((3.0, 1.0, 2.0), (1.0, 0.0, 0.0, 0.0))
