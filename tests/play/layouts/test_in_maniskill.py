"""The recipe of docs/layouts.md in ManiSkill's own environments and physics, on the CPU: 100 resets each.

ManiSkill makes materials even where nothing is rendered, and these need a Vulkan device. `without_pictures` takes away
what is only seen, so that machines without one can run this. Rendering and the simulation on a GPU are not tested."""

import numpy as np
import pytest

import scenegen
from scenegen.layouts import Layouts
from tests.play.layouts.recipes import recipe

pytestmark = [
    pytest.mark.maniskill,
    pytest.mark.filterwarnings("ignore:.*"),  # SAPIEN's, about Vulkan and numpy
]

RESETS, STEPS = 100, 20
PICK = """
workspace [-0.1, 0.1] x [-0.1, 0.1]
object cube = box(4 cm, 4 cm, 4 cm)
task: dist(cube, (0.05, 0)) <= 3 cm
"""
STACK = """
workspace [-0.1, 0.1] x [-0.1, 0.1]
object cubeA = box(4 cm, 4 cm, 4 cm), cubeB = box(4 cm, 4 cm, 4 cm)
require noOverlap()
task: closeTo(cubeA, cubeB, 8 cm) & leftOf(cubeA, cubeB)
"""
OWN = """
workspace [1.0, 1.4] x [-0.2, 0.2]  # away from the robot, which stands at (0, 0) here
object block = box(6 cm, 4 cm, 10 cm), can = cylinder(3 cm, 8 cm), slab = box(12 cm, 12 cm, 2 cm)
object cube = box(4 cm, 4 cm, 4 cm) on slab
require noCollision()
require inside(cube, slab)  # with its middle just within the edge of the slab, a cube tips over
task: closeTo(block, can, 15 cm) & leftOf(can, block)
"""


class Material:
    """Takes what a material of SAPIEN takes; nobody sees it."""

    def __init__(self, *_, **named):
        vars(self).update(named)


@pytest.fixture(autouse=True)
def without_pictures(monkeypatch):
    pytest.importorskip("mani_skill", reason="needs ManiSkill: make test-maniskill installs it")
    import mani_skill.envs  # noqa: F401 - registers the environments
    import sapien
    from mani_skill.utils.building import ActorBuilder
    from sapien.wrapper import actor_builder, urdf_loader

    for module in (sapien.render, urdf_loader):
        monkeypatch.setattr(module, "RenderMaterial", Material)
    for builder in (ActorBuilder, actor_builder.ActorBuilder):
        for name in dir(builder):
            if name.startswith("add_") and "visual" in name:
                monkeypatch.setattr(builder, name, lambda self, *_, **__: self)


def started(name, text, things, up=None, load=None):
    """An environment of ManiSkill whose episodes start as the page says, in layouts with phi in -0.05:0."""
    from mani_skill.utils.registration import REGISTERED_ENVS

    base, initialize = REGISTERED_ENVS[name].cls, recipe("initialize")

    class Started(base):
        table = scenegen.parse(text)

        def _load_scene(self, options):
            super()._load_scene(options)
            if load:
                load(self)
            self.layouts = Layouts(
                self.table, (-0.05, 0.0), quaternion="wxyz", device=self.device, origins="middle", up=up, ahead=512
            )

        def _initialize_episode(self, env_idx, options):
            super()._initialize_episode(env_idx, options)
            self.promised = initialize(self.layouts, [getattr(self, name) for name in things], env_idx)

        def poses(self):
            """(N, 7): where the things are, and their quaternions."""
            return np.array([getattr(self, name).pose.raw_pose[0].numpy() for name in things])

        def phi(self):
            x, y, _, w, _, _, k = self.poses().T.astype(float)
            return self.table.scenes(np.stack([x, y, 2 * np.arctan2(k, w)], axis=1)).phi["task"][0]

    return Started(obs_mode="state", sim_backend="physx_cpu", render_backend="none")


def own_things(env):
    """Boxes, and a cylinder, which SAPIEN lays along x."""
    import sapien
    from mani_skill.utils.building import actors

    sides = {"block": (0.03, 0.02, 0.05), "can": None, "slab": (0.06, 0.06, 0.01), "cube": (0.02, 0.02, 0.02)}
    for k, (name, half) in enumerate(sides.items()):
        aside = {"name": name, "color": [1, 0, 0, 1], "initial_pose": sapien.Pose(p=[-1.0, 0.3 * k, 0.1])}
        if half:
            thing = actors.build_box(env.scene, half_sizes=half, **aside)
        else:
            thing = actors.build_cylinder(env.scene, radius=0.03, half_length=0.04, **aside)
        setattr(env, name, thing)


@pytest.mark.parametrize(
    ("name", "text", "things", "settings"),
    [
        ("PickCube-v1", PICK, ["cube"], {}),
        ("StackCube-v1", STACK, ["cubeA", "cubeB"], {}),
        ("Empty-v1", OWN, ["block", "can", "slab", "cube"], {"up": {"can": "x"}, "load": own_things}),
    ],
)
def test_a_hundred_resets(name, text, things, settings):
    env = started(name, text, things, **settings)
    off, after, moved, seen = [], [], [], set()
    for seed in range(RESETS):
        env.reset(seed=seed)
        promised, begun = float(env.promised[0, 0]), env.poses()
        assert -0.05 <= promised <= 0.0
        seen.add(promised)
        off.append(abs(env.phi() - promised))
        for _ in range(STEPS):
            env.step(None)
        after.append(abs(env.phi() - promised))
        moved.append(np.linalg.norm(env.poses()[:, :3] - begun[:, :3], axis=1).max())
    print(f"{name}: {len(seen)} starts; phi off by at most {max(off):.1e} at reset")
    print(
        f"after {STEPS} steps {np.median(after):.1e} (median), {max(after):.1e} (most); moved {1e3 * max(moved):.3f} mm"
    )
    assert len(seen) > 80 and max(off) < 1e-6
    assert max(after) < 1e-4 and max(moved) < 1e-4


def test_the_same_seed_is_the_same_start():
    env = started("StackCube-v1", STACK, ["cubeA", "cubeB"])
    begun = {}
    for seed in (5, 6, 5, 7, 6):
        env.reset(seed=seed)
        poses = env.poses()
        assert (begun.setdefault(seed, poses) == poses).all()
    assert len({poses.tobytes() for poses in begun.values()}) == 3
