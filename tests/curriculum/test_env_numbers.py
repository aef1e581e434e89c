"""Environments of specs that draw how many things there are: absent objects are zeros, and `present` says so."""

import gymnasium
import numpy as np
import pytest
from gymnasium import error

import scenegen

NAME = "scenegen.curriculum:scenegen/TableTop-v0"
SPEC = "object block[1..3], mug\nrequire x(mug) >= 0.2\ntask: forall b in block: leftOf(b, mug)\nsafe: y(mug) >= 0.1\n"


@pytest.fixture(scope="module")
def env():
    return gymnasium.make(NAME, spec=SPEC)


def numbers(seen, names):
    return 1 + int(sum(value for value, name in zip(seen, names, strict=True) if name.endswith(".present")))


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_absent_objects_are_zeros_and_cannot_be_moved(env):
    names = env.unwrapped.views.names
    assert [name for name in names if name.endswith(".present")] == ["block[2].present", "block[3].present"]
    found = set()
    for seed in range(12):
        seen, info = env.reset(seed=seed, options={"phi": {"task": (-0.4, -0.1)}})
        assert env.observation_space.contains(seen) and -0.4 <= info["phi"]["task"] <= -0.1
        many = numbers(seen, names)
        found.add(many)
        place = names.index("block[3].x")
        assert (many == 3) == bool(seen[place] or seen[place + 1])
        if many < 3:
            again, _, over, _, _ = env.step(env.unwrapped.moves.names.index("block[3] x +"))
            assert (again == seen).all() and not over
        assert (env.reset(seed=seed, options={"phi": {"task": (-0.4, -0.1)}})[0] == seen).all()
    assert found == {1, 2, 3}


def test_many_tables_are_as_many_single_ones(env):
    many = gymnasium.make_vec(NAME, 3, vectorization_mode="vector_entry_point", spec=SPEC)
    seen, _ = many.reset(seed=5)
    rng = np.random.default_rng(0)
    single, _ = env.reset(seed=6)
    assert (single == seen[1]).all()
    for _ in range(20):
        actions = rng.integers(env.action_space.n, size=3)
        seen, reward, over, _, _ = many.step(actions)
        single, paid, ended, _, _ = env.step(int(actions[1]))
        assert (single == seen[1]).all() and paid == reward[1] and ended == over[1]
        if over.any():
            break


def test_a_scene_of_ones_own_has_any_number_of_things(env):
    scenes = scenegen.sample(scenegen.parse(SPEC), {"task": (-0.3, None)}, n=6, seed=1)
    for scene, poses in zip(scenes, scenes.poses, strict=True):
        seen, info = env.reset(options={"scene": scene})
        assert info["phi"]["task"] == scene.phi["task"]
        assert numbers(seen, env.unwrapped.views.names) == scene.counts["block"]
        assert (env.reset(options={"scene": poses})[0] == seen).all()
    for wrong in ({"mug": (0.5, 0.5)}, {"block[1]": (0.1, 0.1), "block[3]": (0.2, 0.2), "mug": (0.5, 0.5)}):
        with pytest.raises(error.Error, match=r"a scene that (lacks|has)"):
            env.reset(options={"scene": wrong})


def test_scenes_of_a_file_start_episodes(tmp_path):
    path = scenegen.sample(scenegen.parse(SPEC), {"task": (-0.3, -0.1)}, n=9, seed=2).save(tmp_path / "a.json")
    env = gymnasium.make(NAME, spec=SPEC, source=path, goal="task")
    found = [env.reset(seed=seed)[1]["phi"]["task"] for seed in range(5)]
    assert all(-0.3 <= phi <= -0.1 for phi in found)
