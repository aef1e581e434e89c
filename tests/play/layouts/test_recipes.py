"""The recipes of docs/layouts.md, with stand-ins for the simulators' objects."""

import sys
from types import ModuleType, SimpleNamespace

import pytest
import torch

import scenegen
from scenegen.layouts import Layouts
from tests.play.layouts.recipes import recipe

SPEC = scenegen.parse(
    "object red = box(4 cm, 4 cm, 4 cm), blue\nrequire noOverlap()\ntask: closeTo(red, blue, 30 cm)\n"
)


@pytest.fixture
def layouts():
    return Layouts(SPEC, (0.0, None), quaternion="wxyz", ahead=16)


@pytest.fixture
def expected():
    return Layouts(SPEC, (0.0, None), quaternion="wxyz", ahead=16).take(5)


def test_maniskill(layouts, monkeypatch):
    """test_in_maniskill.py has the real one."""
    module = ModuleType("mani_skill.utils.structs.pose")
    module.Pose = SimpleNamespace(create_from_pq=lambda p, q: (p, q))
    for name in ("mani_skill", "mani_skill.utils", "mani_skill.utils.structs"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setitem(sys.modules, module.__name__, module)
    put = {}
    actors = [SimpleNamespace(set_pose=lambda pose, name=name: put.update({name: pose})) for name in ("red", "blue")]
    torch.manual_seed(3)
    phi = recipe("initialize")(layouts, actors, torch.arange(5))
    expected = Layouts(SPEC, (0.0, None), quaternion="wxyz", ahead=16).take(5, torch.Generator().manual_seed(3))
    assert torch.equal(phi, expected.phi)
    for k, name in enumerate(("red", "blue")):
        assert torch.equal(torch.cat(put[name], dim=1), expected.poses[:, k])


def test_isaac_lab(layouts, expected):
    class Scene(dict):
        env_origins = 10.0 * torch.arange(24.0).reshape(8, 3)

    class Asset:
        def write_root_pose_to_sim(self, poses, env_ids):
            self.poses, self.ids = poses, env_ids

        def write_root_velocity_to_sim(self, speeds, env_ids):
            self.speeds = speeds

    scene, ids = Scene(red=Asset(), blue=Asset()), torch.tensor([7, 0, 3, 2, 1])
    recipe("reset_layout")(SimpleNamespace(scene=scene), ids, layouts)
    for k, name in enumerate(("red", "blue")):
        moved = scene[name].poses
        assert torch.allclose(moved[:, :3] - Scene.env_origins[ids], expected.poses[:, k, :3], atol=1e-4)
        assert torch.equal(moved[:, 3:], expected.poses[:, k, 3:]) and torch.equal(scene[name].ids, ids)
        assert scene[name].speeds.shape == (5, 6) and not scene[name].speeds.any()


def test_isaac_lab_with_usd(tmp_path, monkeypatch):
    """Each object that can be moved is where the scene has it; what is held in place is none."""
    pytest.importorskip("pxr", reason="usd-core is not installed (pip install 'scenegen-dsl[usd]')")
    assets, sim = ModuleType("isaaclab.assets"), ModuleType("isaaclab.sim")
    sim.UsdFileCfg = assets.AssetBaseCfg = SimpleNamespace

    class RigidObjectCfg(SimpleNamespace):
        InitialStateCfg = SimpleNamespace

    assets.RigidObjectCfg = RigidObjectCfg
    for module in (ModuleType("isaaclab"), assets, sim):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    spec = scenegen.parse("object tray at (0.5, 0.5), block[2], mug\nrequire noOverlap()\ntask: leftOf(mug, block[1])")
    scenes = scenegen.sample(spec, n=1, seed=1)
    (path,) = scenes.export(tmp_path / "stages", "usd")
    found = recipe("usd_scene")(str(path))
    assert found.pop("table").spawn.usd_path == str(path)
    assert list(found) == ["block_1", "block_2", "mug"]
    for cfg, pose in zip(found.values(), scenes.poses7()[0, 1:], strict=True):
        assert (*cfg.init_state.pos, *cfg.init_state.rot) == pytest.approx(tuple(pose), abs=1e-9)
    assert found["mug"].prim_path == "{ENV_REGEX_NS}/Scene/mug" and found["mug"].spawn is None
