"""Placement with objects that have robosuite's interface; test_in_robosuite.py has the real ones."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.play.frame import TableFrame, inverse, times, upright
from scenegen.play.strategies import strategy
from scenegen.play.tasks import PhiBox
from scenegen.robosuite import Placement, phi_space
from tests.play.robosuite.stubs import Corner, Thing, Turned, simulation

TEXT = """
workspace [-0.2, 0.2] x [-0.2, 0.2]
object red = box(4 cm, 4 cm, 4 cm), cubeB = box(5 cm, 5 cm, 5 cm)
require noOverlap()
task: closeTo(red, cubeB, 12 cm) & leftOf(red, cubeB)
"""
SPEC = scenegen.parse(TEXT)
TABLE = (0.1, -0.3, 0.8)


def placement(phi=(-0.1, 0.0), spec=SPEC, **settings):
    things = settings.pop("things", None) or [Thing("cubeA"), Thing("cubeB", 0.025)]
    return Placement(spec, phi, names={"red": "cubeA"}, reference_pos=TABLE, mujoco_objects=things, **settings)


def codes(error):
    return [one.code for one in error.value.diagnostics]


def test_a_sample_has_the_form_and_the_phi_that_was_asked_for():
    here = placement()
    for _ in range(50):
        placed = here.sample()
        assert list(placed) == ["cubeA", "cubeB"]
        (x, y, z), quaternion, model = placed["cubeA"]
        assert model is here.mujoco_objects[0] and quaternion.shape == (4,)
        assert z == pytest.approx(0.82) and placed["cubeB"][0][2] == pytest.approx(0.825)
        assert abs(x - 0.1) <= 0.2 and abs(y + 0.3) <= 0.2
        assert -0.1 <= here.phi["task"] <= 0.0
        # by hand, from the definitions of the two relations
        bx, by, _ = placed["cubeB"][0]
        assert here.phi["task"] == pytest.approx(min(0.12 - math.hypot(x - bx, y - by), bx - x), abs=1e-9)


def test_the_same_seed_gives_the_same_scenes_and_another_gives_others():
    first, same, other = (placement(seed=seed) for seed in (3, 3, 4))
    drawn = [[one.sample()["cubeA"][0] for _ in range(5)] for one in (first, same, other)]
    assert drawn[0] == drawn[1] and not set(drawn[0]) & set(drawn[2]) and len(set(drawn[0])) == 5


@pytest.mark.parametrize(
    "things",
    [None, [Turned("cubeA"), Thing("cubeB", 0.025)]],
    ids=["upright", "laid"],
)
@pytest.mark.parametrize("turn", [0.0, -math.pi / 2, 2.5])
def test_phi_is_read_back_from_a_simulation(turn, things):
    here = placement(turn=turn, things=things)
    placed = here.sample()
    sim = simulation(placed)
    assert here.phi_in(sim)["task"] == pytest.approx(here.phi["task"], abs=1e-12)
    found = here.poses(sim)
    wanted = 2.0 * np.arctan2(here.start.poses[:, 6], here.start.poses[:, 3])
    assert np.cos(found[:, 2] - wanted) == pytest.approx(1.0)
    sim.data.body_xpos[0] += (math.cos(turn) * 0.05, math.sin(turn) * 0.05, 0.0)  # 5 cm along the spec's x axis
    assert here.poses(sim)[0] - found[0] == pytest.approx([0.05, 0.0, 0.0])


def test_turned_for_the_robot_left_is_left():
    """A robot at the origin looks along x of the world: its left is the world's +y."""
    placed = placement((0.01, None), turn=-math.pi / 2).sample()
    assert placed["cubeA"][0][1] > placed["cubeB"][0][1]


def test_towers_stand_on_what_carries_them():
    spec = scenegen.parse(
        "object cubeB = box(5 cm, 5 cm, 5 cm), red = box(4 cm, 4 cm, 4 cm) on cubeB\ntask: x(red) >= 0\n"
    )
    placed = placement(None, spec, z_offset={"cubeA": 0.01}).sample()
    assert placed["cubeB"][0][2] == pytest.approx(0.825)
    assert placed["cubeA"][0][2] == pytest.approx(0.8 + 0.05 + 0.02 + 0.01)


def test_references_and_fixtures():
    board = Thing("board", half=0.1, horizontal_radius=0.01)
    fixtures = {"board": ((5.0, 5.0, 1.0), np.array([1.0, 0.0, 0.0, 0.0]), board)}
    here = placement()
    on = here.sample(fixtures, reference="board")
    assert list(on) == ["board", "cubeA", "cubeB"] and on["cubeA"][0][2] == pytest.approx(1.0 + 0.1 + 0.02)
    assert here.phi_in(simulation(on))["task"] == pytest.approx(here.phi["task"], abs=1e-12)
    level = here.sample(reference=(1.0, 2.0, 3.0), on_top=False)["cubeA"][0]
    assert level[2] == 3.0 and math.dist(level[:2], (1.0, 2.0)) < 0.3
    assert fixtures.keys() == {"board"}  # it is the caller's

    in_the_way = {"pole": ((*TABLE[:2], 0.8), None, Thing("pole", 1.0, 0.1))}
    for _ in range(20):
        placed = here.sample(in_the_way)
        for name in ("cubeA", "cubeB"):
            assert math.dist(placed[name][0][:2], TABLE[:2]) > 0.13
    with pytest.raises(RequestError) as error:
        here.sample({"wall": ((*TABLE[:2], 0.8), None, Thing("wall", 1.0, 1.0))})
    assert codes(error) == ["placement"]
    loose = placement(ensure_valid_placement=False)
    assert len(loose.sample({"wall": ((*TABLE[:2], 0.8), None, Thing("wall", 1.0, 1.0))})) == 3


def test_bad_requests_are_answered():
    cases = [
        ("placement", lambda: placement().sample(reference="board")),
        ("wrong-value", lambda: placement().sample(reference=(1, 2))),
        ("placement", lambda: placement().sample({"cubeA": ((0, 0, 0), None, Thing("cubeA"))})),
        ("placement", lambda: placement(things=[Thing("cubeB")]).sample()),
        ("placement", lambda: placement(things=[Thing("cubeA"), Thing("cubeB"), Thing("x")]).sample()),
        ("no-episode", lambda: placement().phi),
        ("unknown-choice", lambda: Placement(SPEC, names={"blue": "cubeA"})),
        ("unknown-label", lambda: placement({"goal": (0, None)}).sample()),
        ("range-not-a-pair", lambda: placement(3)),
        ("wrong-value", lambda: placement(seed="one")),
        ("wrong-value", lambda: placement(turn=math.nan)),
        ("wrong-value", lambda: placement(z_offset="high")),
        ("wrong-value", lambda: Placement(SPEC, names=["cubeA"])),
        ("wrong-value", lambda: Placement(SPEC, reference_pos=(0, 0, math.inf))),
        ("same-name", lambda: Placement(SPEC, names={"red": "cubeB"})),
        ("not-a-task", lambda: placement(lambda: PhiBox((0.0, 0.0), (0.1, 0.1))).sample()),
    ]
    for code, act in cases:
        with pytest.raises(RequestError) as error:
            act()
        assert codes(error) == [code]


def test_an_unreachable_range_is_a_diagnostic_each_time():
    here = placement((0.5, None))
    for _ in range(2):
        with pytest.raises(RequestError) as error:
            here.sample()
        assert codes(error) == ["beyond-bounds"]


def test_objects_without_a_model_must_be_held_in_place():
    spec = scenegen.parse("object peg = cylinder(2 cm, 10 cm) at (0.5, 0.5), red\ntask: closeTo(red, peg, 10 cm)\n")
    here = placement((0, None), spec, things=[Thing("cubeA")])
    placed = here.sample()
    assert list(placed) == ["cubeA"]
    assert here.phi_in(simulation(placed))["task"] == pytest.approx(here.phi["task"], abs=1e-12)


def test_a_function_chooses_the_range_of_each_start():
    wanted = iter([(-0.1, -0.05), {"task": (0.0, None)}, PhiBox((-0.2,), (-0.1,)), (-0.1, -0.05)])
    here = placement(lambda: next(wanted))
    found = []
    for _ in range(4):
        here.sample()
        found.append(here.phi["task"])
    assert -0.1 <= found[0] <= -0.05 and found[1] >= 0.0 and -0.2 <= found[2] <= -0.1 and -0.1 <= found[3] <= -0.05
    assert found[0] != found[3]


@pytest.mark.long
def test_a_strategy_chooses_and_hears_of_outcomes():
    space = phi_space(SPEC)
    lessons = strategy("self_paced", space, np.random.default_rng(0), levels=4)
    here, begun = placement(lessons), []
    for _ in range(400):
        placed = here.sample()
        task = here.start.task
        assert task.low[0] - 1e-9 <= here.phi["task"] <= task.high[0] + 1e-9
        assert here.phi_in(simulation(placed))["task"] == pytest.approx(here.phi["task"], abs=1e-12)
        begun.append(task.low[0])
        here.report(success=True)
    assert np.mean(begun[:40]) > np.mean(begun[-40:]) and min(begun) == pytest.approx(space.low[0])


def test_it_takes_the_place_of_an_environment_s_own_sampler():
    class Env:
        """Makes its sampler anew with each model, as PickPlace does."""

        def _get_placement_initializer(self):
            bin1 = Corner([Thing("cubeA"), Thing("cubeB"), Thing("left")])
            marks = Corner([Thing("VisualCubeA")], (9.0, 9.0, 9.0))
            things = [*bin1.mujoco_objects, *marks.mujoco_objects]
            parts = {"bin": bin1, "marks": marks}
            self.placement_initializer = SimpleNamespace(mujoco_objects=things, samplers=parts)

    env = Env()
    env._get_placement_initializer()
    here = Placement(SPEC, (0, None), names={"red": "cubeA"}, reference_pos=TABLE)
    here.use_in(env)
    for _ in range(2):
        assert env.placement_initializer is here
        placed = here.sample()
        assert list(placed) == ["cubeA", "cubeB", "left", "VisualCubeA"]
        assert placed["VisualCubeA"][0] == (9.0, 9.0, 9.0) and placed["left"][0] == (0.5, 0.5, 0.8)
        assert here.phi["task"] >= 0.0
        before = here.mujoco_objects
        env._get_placement_initializer()
        assert here.mujoco_objects[0] is not before[0]


def test_frames_and_quaternions():
    frame = TableFrame((1.0, 2.0, 3.0), math.pi / 2)
    at, quaternion = frame.place([0.1, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0])
    assert at == pytest.approx([1.0, 2.1, 3.5])
    assert quaternion == pytest.approx([math.sqrt(0.5), 0, 0, math.sqrt(0.5)])
    assert frame.pose(at, quaternion) == pytest.approx((0.1, 0.0, 0.0))
    one = np.array([0.5, 0.5, -0.5, 0.5])
    assert times(one, inverse(one)) == pytest.approx([1, 0, 0, 0])
    half = math.sqrt(0.5)
    for lying in ([1, 0, 0, 0], [half, half, 0, 0], [half, 0, half, 0]):
        assert upright(lying) == pytest.approx(lying)
        turned = times((math.cos(0.4), 0, 0, math.sin(0.4)), lying)
        assert upright(turned) == pytest.approx(lying)
    assert upright([0, 0, half, half]) == pytest.approx([half, half, 0, 0])  # LIBERO's soup: half a turn about y + z
    i, j, k = np.eye(4)[1:]
    assert times(i, j) == pytest.approx(k) and times(j, i) == pytest.approx(-k)


def test_a_strategy_without_gymnasium_says_what_to_install(monkeypatch):
    lessons = strategy("uniform", PhiBox((-0.1,), (0.0,)), np.random.default_rng(0))
    monkeypatch.setattr("scenegen.needs.is_installed", lambda package: False)
    with pytest.raises(RequestError, match=r"not-installed.*\n.*scenegen-dsl\[rl\]"):
        placement(lessons)
