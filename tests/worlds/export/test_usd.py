"""USD in the hands of its own library: stages are by its rules, and hold what the world has, bit for bit or nearly.
Names of prims and texts in USD files: any comes back. Axes of inertia, too.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from pxr import Sdf, UsdGeom, UsdLux, UsdPhysics

import scenegen
from scenegen.resources import shipped_specs
from scenegen.worlds.export.usd import UsdScenes, UsdStage, crate, identifiers
from scenegen.worlds.export.world import SpecRecord, principal
from tests.worlds.export.stages import (
    color,
    corners,
    faults,
    frame,
    friction,
    inertia,
    opened,
    physics,
    poses,
    rotation,
    things,
)
from tests.worlds.export.test_sdf import ROBOT, SPEC
from tests.worlds.export.worlds import crates, library, scenes_of, tower, world

pxr = pytest.importorskip("pxr")

HEIGHTS = [[0.0, 0.007, 0.02, 0.07, 0.0], [0.0] * 5]  # plate, mug, two blocks and the tray of `tower`


def plausible(stage):
    """Every rigid body has a mass, and moments that a body can have; returns their paths."""
    bodies = physics(stage).get("RigidBody", {})
    for path, one in bodies.items():
        prim = stage.GetPrimAtPath(path)
        mass, _, moments = inertia(prim)
        a, b, c = np.linalg.eigvalsh(moments)
        assert mass > 0.0 and a > 0.0 and a + b >= c * (1.0 - 1e-6) and len(one.collisions) > 0, path
        axes = UsdPhysics.MassAPI(prim).GetPrincipalAxesAttr().Get()
        assert axes.GetLength() == pytest.approx(1.0, abs=1e-6)
    return set(bodies)


@pytest.mark.parametrize("out", ["all", "all.usda", "all.usdc", "all.usd"])
def test_objects_are_where_the_scene_says(out, tmp_path):
    scenes = tower()
    files = scenes.export(tmp_path / out, to="usd")
    together = "." in out
    assert [path.name for path in files] == ([out] if together else ["scene_0001.usda", "scene_0002.usda"])
    for k, heights in enumerate(HEIGHTS):
        stage = opened(files[0], f"scene_000{k + 1}") if together else opened(files[k])
        assert list(things(stage)) == list(scenes.objects)
        found = poses(stage, scenes.objects)
        np.testing.assert_allclose(found[:, [0, 1, 3]], scenes.poses[k], atol=1e-9)
        np.testing.assert_allclose(found[:, 2], heights, atol=1e-9)
    if together:
        shown = opened(files[0])
        names = shown.GetDefaultPrim().GetVariantSet("scene").GetVariantNames()
        assert names == ["scene_0001", "scene_0002"]
        np.testing.assert_array_equal(poses(shown, scenes.objects)[:, 2], HEIGHTS[0])


@pytest.mark.long
@pytest.mark.parametrize("make", [tower, library])
def test_what_is_drawn_and_what_collides_are_the_worlds(make, tmp_path):
    scenes = make()
    made, stage = world(scenes), opened(scenes.export(tmp_path / "all", "usd")[0])
    for body, (x, y, z, theta) in zip(made.bodies, made.poses[0], strict=True):
        prim = things(stage)[body.name]
        cos, sin = math.cos(theta), math.sin(theta)

        def placed(points, cos=cos, sin=sin, at=(x, y, z)):
            return points @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]).T + at

        visuals, collisions = prim.GetChild("visuals").GetChildren(), prim.GetChild("collisions").GetChildren()
        assert len(visuals) == len(body.form.parts) and len(collisions) == len(body.form.pieces)
        for part, mesh, wanted in zip(visuals, body.form.parts, body.colors, strict=True):
            np.testing.assert_allclose(corners(part), placed(mesh.vertices), atol=1e-6)
            drawn = UsdGeom.Mesh(part)
            assert np.array_equal(np.array(drawn.GetFaceVertexIndicesAttr().Get()), mesh.faces.ravel())
            assert len(drawn.GetNormalsAttr().Get()) == mesh.faces.size
            assert (
                UsdGeom.Imageable(part).ComputePurpose() == "default"
                and drawn.GetSubdivisionSchemeAttr().Get() == "none"
            )
            for seen in color(part):
                assert seen == pytest.approx(wanted, abs=1e-6)
        for piece, solid in zip(collisions, body.form.pieces, strict=True):
            assert UsdGeom.Imageable(piece).ComputePurpose() == "guide"
            found, wanted = corners(piece), placed(solid.mesh.vertices)
            if solid.box is None:
                np.testing.assert_allclose(found, wanted, atol=1e-6)
                assert UsdPhysics.MeshCollisionAPI(piece).GetApproximationAttr().Get() == "convexHull"
            else:
                assert piece.IsA(UsdGeom.Cube) and len(found) == 8
                far = np.linalg.norm(found[:, None] - wanted[None], axis=2)
                assert far.min(axis=1).max() < 1e-6


@pytest.mark.long
@pytest.mark.parametrize("make", [tower, library])
def test_masses_inertia_and_friction_are_the_worlds(make, tmp_path):
    """As USD's own reader of physics finds them."""
    scenes = make()
    made, stage = world(scenes), opened(scenes.export(tmp_path / "all", "usd")[0])
    kinds = physics(stage)
    moving = {f"/Scene/{things(stage)[body.name].GetName()}": body for body in made.bodies if not body.fixed}
    assert set(kinds["RigidBody"]) == set(moving) == plausible(stage)
    for path, body in moving.items():
        mass, center, moments = inertia(stage.GetPrimAtPath(path))
        assert mass == pytest.approx(body.mass)
        np.testing.assert_allclose(center, body.form.inertia.center, atol=1e-7)
        np.testing.assert_allclose(moments, body.moments, atol=1e-6 * body.moments.max())
    by_path = {f"/Scene/{things(stage)[body.name].GetName()}": body for body in made.bodies}
    shapes = {**kinds.get("MeshShape", {}), **kinds["CubeShape"]}
    assert len(shapes) == 6 + sum(len(body.form.pieces) for body in made.bodies)  # floor, table
    for path, shape in shapes.items():
        root = "/".join(path.split("/")[:3])
        body = by_path.get(root)
        assert str(shape.rigidBody) == (root if body is not None and not body.fixed else "")
        wanted = 0.01 if body is None else body.friction
        assert [friction(stage, one) for one in shape.materials] == [pytest.approx((wanted, wanted))]
        combine = stage.GetPrimAtPath(str(shape.materials[0])).GetAttribute("physxMaterial:frictionCombineMode").Get()
        assert combine == ("max" if body is None else None)


@pytest.mark.long
@pytest.mark.parametrize("make", [tower, library, crates])
def test_by_the_rules_of_usd(make, tmp_path):
    """And it can be moved: all that it refers to is named relatively."""
    make().export(tmp_path / "all", "usd")
    make().export(tmp_path / "one.usdc")
    (tmp_path / "moved").mkdir()
    for path in list(tmp_path.iterdir()):
        if path.name != "moved":
            path.rename(tmp_path / "moved" / path.name)
    for path in (tmp_path / "moved").rglob("*.usd*"):
        assert faults(opened(path)) == [], path
    (path,) = (tmp_path / "moved").glob("one.usdc")
    stage = opened(path)
    for name in stage.GetDefaultPrim().GetVariantSet("scene").GetVariantNames():
        assert faults(opened(path, name)) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('    upAxis = "Z"\n', ""),
        ('defaultPrim = "Scene"', 'defaultPrim = "Scenes"'),
        ("meshes/box.usda", "meshes/lost.usda"),
        ('["MaterialBindingAPI", "PhysicsCollisionAPI"]', '["PhysicsCollisionAPI"]'),
        ("float inputs:roughness = 0.6", "bool inputs:roughness = 1"),
        ('"PhysxMaterialAPI"', '"PhysicsRigidBodyAPI"'),
    ],
)
def test_the_rules_can_be_broken(old, new, tmp_path):
    path, _ = crates().export(tmp_path / "all", "usd")
    text = path.read_text()
    assert old in text
    (tmp_path / "all" / "broken.usda").write_text(text.replace(old, new))
    assert faults(opened(tmp_path / "all" / "broken.usda"))


def test_the_stage(tmp_path):
    stage = opened(crates().export(tmp_path / "all", "usd")[0])
    assert UsdGeom.GetStageMetersPerUnit(stage) == UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and stage.GetRootLayer().documentation == "Crates on a mat."
    root = stage.GetDefaultPrim()
    kinds = {str(prim.GetPath()): pxr.Usd.ModelAPI(prim).GetKind() for prim in (root, *root.GetChildren())}
    children = ("table", "crate_1", "crate_2", "base")
    assert kinds == {"/Scene": "assembly", **{f"/Scene/{name}": "component" for name in children}}
    assert {prim.GetName() for prim in stage.Traverse() if prim.HasAPI(UsdLux.LightAPI)} == {"sun", "fill"}
    (gravity,) = (prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.Scene))
    assert UsdPhysics.Scene(gravity).GetGravityMagnitudeAttr().Get() == pytest.approx(9.81)
    # Who refers to a scene gets none of what a stage has once.
    assert all(
        str(prim.GetPath()).startswith("/Environment") for prim in (gravity, stage.GetPrimAtPath("/Environment/sun"))
    )


def test_what_is_known_of_a_scene(tmp_path):
    scenes = tower()
    phi = {"task": np.array([0.125, math.pi])}
    scenes = type(scenes)(scenes.poses, phi, scenes.header, trusted=True)
    (together,) = scenes.export(tmp_path / "all.usda")
    for k, path in enumerate(scenes.export(tmp_path / "all", "usd")):
        for stage in (opened(path), opened(together, f"scene_000{k + 1}")):
            facts = stage.GetDefaultPrim().GetCustomDataByKey("scenegen")
            spec = scenes.header.spec.source
            assert facts == {"spec": spec, "scene": k + 1, "phi": {"task": phi["task"][k]}}


def test_what_is_held_in_place_and_regions(tmp_path):
    stage = opened(tower().export(tmp_path / "all", "usd")[0])
    tray = things(stage)["tray"]
    assert not tray.HasAPI(UsdPhysics.RigidBodyAPI) and not tray.HasAPI(UsdPhysics.MassAPI)
    assert things(stage)["mug"].HasAPI(UsdPhysics.RigidBodyAPI)
    table = stage.GetPrimAtPath("/Scene/table")
    collides = {prim.GetName(): prim.HasAPI(UsdPhysics.CollisionAPI) for prim in table.GetChildren()}
    del collides["Looks"]
    assert collides == {"top": True, **{f"leg_{k}": True for k in range(1, 5)}, "region_1": False, "region_2": False}


@pytest.mark.long
@pytest.mark.parametrize("name", ["fruit_bowl", "pantry_shelf", "wall_shelf", "cutlery_drawer", "served_pot", "first"])
def test_scenes_of_specs(name, tmp_path):
    """Heights are those of `poses7`; boards at heights carry."""
    scenes = scenegen.sample(scenegen.load(shipped_specs()[name]), n=2, seed=1)
    wanted = scenes.poses7()
    for k, path in enumerate(scenes.export(tmp_path / "all", "usd")):
        stage = opened(path)
        assert faults(stage) == [] and plausible(stage)
        for prim, (x, y, z, w, i, j, turn) in zip(things(stage).values(), wanted[k], strict=True):
            np.testing.assert_allclose(frame(prim)[:3, 3], [x, y, z], atol=1e-9)
            cos, sin = w * w - turn * turn, 2.0 * w * turn
            np.testing.assert_allclose(frame(prim)[:2, :2], [[cos, -sin], [sin, cos]], atol=1e-9)
            assert i == j == 0.0
        boards = world(scenes).boards
        collides = [p for p in stage.GetPrimAtPath("/Scene/table").GetChildren() if p.GetName().startswith("region")]
        assert sum(p.HasAPI(UsdPhysics.CollisionAPI) for p in collides) == len(boards)
    assert (len(boards) > 0) == (name == "wall_shelf")


@pytest.mark.long
def test_scenes_that_differ_in_how_many_things_there_are(tmp_path):
    text = "object mug, block[1..3]\nrequire noOverlap()\ntask: leftOf(mug, block[1])"
    scenes = scenegen.sample(scenegen.parse(text), n=6, seed=2)
    assert len(set(scenes.counts["block"].tolist())) > 1
    for k, path in enumerate(scenes.export(tmp_path / "all", "usd")):
        stage = opened(path)
        there = [name for name, here in zip(scenes.objects, scenes.present[k], strict=True) if here]
        assert list(things(stage)) == there and faults(stage) == []
        assert stage.GetDefaultPrim().GetCustomDataByKey("scenegen:counts") == {"block": scenes.counts["block"][k]}
        np.testing.assert_allclose(poses(stage, there)[:, :2], scenes.poses[k][scenes.present[k]][:, :2], atol=1e-9)
    with pytest.raises(scenegen.RequestError) as caught:
        scenes.export(tmp_path / "all.usda")
    assert caught.value.diagnostics[0].code == "one-file-many-numbers"


def test_bodies_of_own_files(tmp_path):
    (tmp_path / "r.urdf").write_text(ROBOT)
    (tmp_path / "s.spec").write_text(SPEC)
    scenes = scenegen.sample(scenegen.load(tmp_path / "s.spec"), {"task": (0.1, None)}, n=1, seed=3)
    for meshes, pieces in ((tmp_path, 2), (None, 1)):
        (path,) = scenes.export(tmp_path / f"all_{pieces}", "usd", meshes=meshes)
        stage = opened(path)
        assert faults(stage) == [] and plausible(stage) == {"/Scene/r", "/Scene/c"}
        robot = things(stage)["r"]
        assert len(robot.GetChild("collisions").GetChildren()) == pieces
        assert (inertia(robot)[0] == pytest.approx(0.7)) == (meshes is not None)


def test_golden(golden, tmp_path):
    path, _ = crates().export(tmp_path / "all", "usd")
    golden("worlds/export/crates.usda", path.read_text())
    golden("worlds/export/crates_box.usda", (tmp_path / "all" / "meshes" / "box.usda").read_text())


def test_a_form_is_once_in_a_folder_and_can_be_used_alone(tmp_path):
    crates().export(tmp_path / "all", "usd")
    assert sorted(path.name for path in (tmp_path / "all" / "meshes").iterdir()) == ["box.usda", "box2.usda"]
    stage = opened(tmp_path / "all" / "meshes" / "box.usda")
    assert plausible(stage) == {"/box"} and faults(stage) == []


def test_text_and_binary_say_the_same(tmp_path):
    texts = []
    for ending in ("usda", "usdc", "usd"):
        (tmp_path / ending).mkdir()
        (path,) = crates().export(tmp_path / ending / f"all.{ending}")
        assert path.read_bytes().startswith(b"#usda" if ending == "usda" else b"PXR-USDC")
        texts.append(Sdf.Layer.FindOrOpen(str(path)).ExportToString())
    assert texts[0] == texts[1] == texts[2]
    assert texts[0] == (tmp_path / "usda" / "all.usda").read_text()


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


def test_objects_of_any_name(tmp_path):
    names = ["table", "Looks", 'a "b" <c> \\ \'"""', "é 🍜", "block[1]", "{}", "-"]
    places = {f"cup{k}": (0.1 + 0.13 * k, 0.5, 0.0) for k in range(len(names))}
    text = f"object {', '.join(f'{name} = block' for name in places)}, plate\ntask: leftOf(cup0, plate)"
    scenes = scenes_of(text, places | {"plate": (0.6, 0.8, 0.0)})
    *cups, plate = scenes.header.objects
    renamed = [one.model_copy(update={"name": name}) for one, name in zip(cups, names, strict=True)]
    header = scenes.header.model_copy(update={"objects": [*renamed, plate]})
    scenes = type(scenes)(scenes.poses, scenes.phi, header, trusted=True)
    for path in (*scenes.export(tmp_path / "all", "usd"), *scenes.export(tmp_path / "all.usdc")):
        stage = opened(path)
        assert list(things(stage)) == [*names, "plate"] and faults(stage) == []
        for name, (x, _, _) in zip(names, places.values(), strict=True):
            prim = things(stage)[name]
            assert name in (prim.GetName(), prim.GetDisplayName())
            assert poses(stage, [name])[0, 0] == pytest.approx(x)
        assert len(stage.GetDefaultPrim().GetChildren()) == 1 + len(names) + 1


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
    record = SpecRecord("", {}, {}, {}, ("a:b", "a-b"))
    scene = UsdScenes(replace(made, bodies=bodies, poses=made.poses[:, :1], record=record), "meshes", ".usda")
    assert list(scene.names.values()) == ["a_b", "a_b_2"]
    files = [scene.scene_file(index) for index in range(2)]
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
