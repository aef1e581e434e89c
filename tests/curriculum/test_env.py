"""scenegen/TableTop-v0: what a step does, what it pays, and what gymnasium and Stable-Baselines3 think of it."""

import math
import warnings

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import scenegen
from scenegen.curriculum import PhiBox, TableTop

LEFT = "leftOf(mug, plate)"
KNIFE = "angle(knife, NORTH, 0.2) & leftOf(knife, plate)"
APART = (
    "object mug = box(0.1, 0.1, 0.1)\nobject plate = box(0.1, 0.1, 0.1)\nrequire noOverlap()\ntask: leftOf(mug, plate)"
)
TWO = "near: closeTo(mug, plate, 0.2)\nside: leftOf(mug, plate)"
HELD = "object mug\nobject plate at (0.5, 0.5)\ntask: leftOf(mug, plate)"


def begin(spec, scene, **settings):
    env = TableTop(spec, **settings)
    seen, info = env.reset(options={"scene": scene})
    return env, seen, info


@pytest.mark.parametrize("moves", ["grid", "continuous"])
@pytest.mark.parametrize("spec", [LEFT, KNIFE, APART, TWO, HELD], ids=["plain", "heading", "require", "two", "held"])
def test_the_checkers_have_nothing_to_say(spec, moves):
    settings = {"spec": spec, "moves": moves, "reward": "dense"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make("scenegen/TableTop-v0", **settings)
        check_env(env.unwrapped, skip_render_check=True)
        check_env_sb3(gymnasium.make("scenegen/TableTop-v0", **settings))


def test_the_name_brings_the_module_along():
    env = gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=LEFT)
    assert env.spec.id == "scenegen/TableTop-v0" and env.spec.max_episode_steps == 100


def test_an_episode_by_hand():
    env, seen, info = begin(LEFT, {"mug": (0.62, 0.5, 1.0), "plate": (0.5, 0.25, 0.0)})
    assert env.moves.names == tuple(
        f"{name} {way}" for name in ("mug", "plate") for way in ("x +", "x -", "y +", "y -")
    )
    assert env.views.names == ("mug.x", "mug.y", "plate.x", "plate.y")
    np.testing.assert_allclose(seen, [0.24, 0.0, 0.0, -0.5], atol=1e-6)
    assert info["phi"] == pytest.approx({"task": -0.12}) and info["is_success"] is False
    paid = []
    for action in (1, 6, 1, 1):
        seen, reward, terminated, truncated, info = env.step(action)
        paid.append((reward, terminated))
        assert truncated is False
    assert paid == [(0.0, False), (0.0, False), (0.0, False), (10.0, True)]
    assert info["phi"] == pytest.approx({"task": 0.03}) and info["is_success"] is True
    np.testing.assert_allclose(seen, [-0.06, 0.0, 0.0, -0.4], atol=1e-6)


def test_off_the_table():
    env, _, _ = begin(LEFT, {"mug": (0.98, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)})
    seen, reward, terminated, _, info = env.step(0)
    assert (reward, terminated, info["off_table"], info["is_success"]) == (-10.0, True, True, False)
    assert seen[0] == 1.0
    # what leaves the table has not reached the goal, whatever phi says
    env, _, _ = begin("leftOf(mug, plate) & aboveOf(mug, plate)", {"mug": (0.48, 0.98, 0), "plate": (0.5, 0.99, 0)})
    _, reward, terminated, _, info = env.step(2)
    assert (reward, terminated, info["is_success"]) == (-10.0, True, False)


def test_the_edge_is_still_the_table():
    env, _, _ = begin("rightOf(mug, plate) & !closeTo(mug, plate, 2)", {"mug": (0.1, 0.5, 0), "plate": (0.5, 0.5, 0)})
    for _ in range(18):  # twenty times 0.05 is not 1 for computers
        _, _, terminated, _, _ = env.step(0)
        assert not terminated
    assert env.step(0)[2]


def test_headings_turn_where_phi_depends_on_them():
    env, seen, _ = begin(KNIFE, {"knife": (0.2, 0.5, 0.05), "plate": (0.5, 0.5, 2.0)})
    assert env.views.names == ("knife.x", "knife.y", "knife.cos", "knife.sin", "plate.x", "plate.y")
    np.testing.assert_allclose(seen[2:4], [math.cos(0.05), math.sin(0.05)], atol=1e-6)
    plus, minus = (env.moves.names.index(f"knife theta {sign}") for sign in "+-")
    env.step(minus)  # through 0
    for _ in range(5):
        *_, info = env.step(plus)
    assert info["is_success"]
    assert not any("theta" in name for name in TableTop(LEFT).moves.names)


def test_a_move_that_breaks_what_is_required_is_not_made():
    env, before, _ = begin(APART, {"mug": (0.62, 0.5, 0), "plate": (0.5, 0.5, 0)}, moves="continuous", step=0.05)
    seen, reward, terminated, _, info = env.step([-1.0, 0.0, 0.0, 0.0])
    assert info["blocked"] and not terminated and reward == 0.0
    np.testing.assert_array_equal(seen, before)
    *_, info = env.step([0.0, 1.0, 0.0, 0.0])
    assert not info["blocked"]


def test_continuous_moves_are_in_units_of_step_and_turn():
    scene = {"knife": (0.2, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}
    env, _, _ = begin(KNIFE, scene, moves="continuous", move="knife", step=0.1, turn=0.5)
    assert env.moves.names == ("knife x", "knife y", "knife theta")
    seen, *_ = env.step(np.array([0.5, -1.0, 0.2], dtype=np.float32))
    np.testing.assert_allclose(seen[:4], [-0.5, -0.2, math.cos(0.1), math.sin(0.1)], atol=1e-6)


def test_dense_rewards_add_up_to_what_phi_gained():
    env, _, info = begin(LEFT, {"mug": (0.9, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}, reward="dense", step=0.1)
    first, total = info["phi"]["task"], 0.0
    for action in (1, 2, 1, 1, 1, 1):
        _, reward, over, _, info = env.step(action)
        total += reward
    assert over and total == pytest.approx(10.0 + (info["phi"]["task"] - first) / 0.1)


def test_all_labels_are_the_goal_unless_one_is_named():
    scene = {"mug": (0.4, 0.5, 0.0), "plate": (0.9, 0.5, 0.0)}
    env, _, info = begin(TWO, scene, step=0.35)
    assert list(info["phi"]) == ["near", "side", "near & side"]
    assert info["phi"]["near & side"] == info["phi"]["near"] < 0.0 < info["phi"]["side"]
    assert env.step(0)[4]["is_success"]
    _, _, info = begin(TWO, scene, goal="side")
    assert list(info["phi"]) == ["near", "side"] and info["is_success"]


def test_held_objects_stay():
    env = TableTop(HELD)
    env.reset(seed=0)
    assert all(name.startswith("mug ") for name in env.moves.names) and env.views.names == ("mug.x", "mug.y")


def test_phi_and_observations_are_those_of_the_scene():
    spec = scenegen.parse(KNIFE)
    env = TableTop(spec, moves="continuous")
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(20):
        _, _, over, _, info = env.step(env.action_space.sample())
        poses = env.episodes.rows.T.reshape(1, -1, 3)
        exact = float(spec.robustness()(torch.from_numpy(poses))[0, 0])
        assert info["phi"]["task"] == pytest.approx(exact, abs=1e-12)
        if over:
            break


def test_a_curriculum_goes_from_hard_to_satisfied():
    space = TableTop(LEFT).space
    assert isinstance(space, PhiBox) and space.high == (0.0,) and -1.0 < space.low[0] < -0.9
