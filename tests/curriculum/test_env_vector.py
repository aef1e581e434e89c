"""The batched environment does what as many single ones do, step for step and in every mode of autoreset."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from scenegen.curriculum import TableTopVector

SPECS = {
    "plain": "leftOf(mug, plate)",
    "heading": "angle(knife, NORTH, 0.2) & leftOf(knife, plate)",
    "two": "near: closeTo(mug, plate, 0.2)\nside: leftOf(mug, plate)",
    "require": "object mug = box(0.1, 0.1, 0.1)\nobject plate = box(0.1, 0.1, 0.1)\nrequire noOverlap()\n"
    "task: leftOf(mug, plate)",
}
COUNT, LIMIT = 5, 6


def same(one, other, path="info"):
    """Both hold the same, to the last bits of sine and cosine."""
    if isinstance(one, dict):
        assert set(one) == set(other), path
        for key in one:
            same(one[key], other[key], f"{path}.{key}")
    elif isinstance(one, np.ndarray) and one.dtype == object:
        assert [value is None for value in one] == [value is None for value in other], path
        for a, b in zip(one, other, strict=True):
            if a is not None:
                same(a, b, path)
    else:
        assert np.asarray(one).dtype == np.asarray(other).dtype, path
        np.testing.assert_allclose(
            one, other, atol=1e-6 if np.asarray(one).dtype == np.float32 else 1e-12, err_msg=path
        )


@pytest.mark.long
@pytest.mark.parametrize("mode", list(AutoresetMode), ids=lambda mode: mode.value)
@pytest.mark.parametrize(
    "name, moves", [("plain", "grid"), ("heading", "continuous"), ("two", "grid"), ("require", "grid")]
)
def test_it_is_as_single_ones(name, moves, mode):
    settings = {"spec": SPECS[name], "moves": moves, "reward": "dense", "step": 0.15, "phi": (-0.3, -0.01)}
    many = gymnasium.make_vec(
        "scenegen/TableTop-v0", num_envs=COUNT, max_episode_steps=LIMIT, autoreset_mode=mode, **settings
    )
    assert isinstance(many.unwrapped, TableTopVector)
    single = SyncVectorEnv(
        [lambda: gymnasium.make("scenegen/TableTop-v0", max_episode_steps=LIMIT, **settings)] * COUNT,
        autoreset_mode=mode,
    )
    assert many.single_action_space == single.single_action_space
    assert many.observation_space == single.observation_space
    same(many.reset(seed=3)[1], single.reset(seed=3)[1])
    many.action_space.seed(0)
    ended = np.zeros(3, dtype=int)
    for _ in range(36):
        actions = many.action_space.sample()
        ours, theirs = many.step(actions), single.step(actions)
        same(dict(enumerate(ours)), dict(enumerate(theirs)))
        over = ours[2] | ours[3]
        ended += [over.sum(), ours[2].sum(), ours[3].sum()]
        if mode is AutoresetMode.DISABLED and over.any():
            ours = many.reset(options={"reset_mask": over.copy()})
            theirs = single.reset(options={"reset_mask": over.copy()})
            same(dict(enumerate(ours)), dict(enumerate(theirs)))
            assert ours[1]["_phi"].tolist() == over.tolist()
    assert (ended > 2).all()  # by success or off the table, and by the limit


def test_make_vec_uses_it_and_single_ones_on_request():
    assert isinstance(gymnasium.make_vec("scenegen/TableTop-v0", 2, spec=SPECS["plain"]).unwrapped, TableTopVector)
    envs = gymnasium.make_vec("scenegen/TableTop-v0", 2, vectorization_mode="sync", spec=SPECS["plain"])
    assert isinstance(envs, SyncVectorEnv)


def test_in_other_processes():
    envs = gymnasium.make_vec("scenegen/TableTop-v0", 2, vectorization_mode="async", spec=SPECS["plain"])
    here = gymnasium.make_vec("scenegen/TableTop-v0", 2, spec=SPECS["plain"])
    try:
        same(envs.reset(seed=0, options={"phi": (-0.2, -0.1)})[0], here.reset(seed=0, options={"phi": (-0.2, -0.1)})[0])
        for _ in range(3):
            same(envs.step(np.array([1, 1]))[0], here.step(np.array([1, 1]))[0])
    finally:
        envs.close()


def test_options_are_for_all_tables():
    envs = TableTopVector(4, SPECS["plain"])
    _, infos = envs.reset(seed=0, options={"phi": (-0.2, -0.1)})
    assert ((infos["phi"]["task"] >= -0.2) & (infos["phi"]["task"] <= -0.1)).all()
    assert infos["task"]["task"].tolist() == [[-0.2, -0.1]] * 4
    assert len(set(infos["phi"]["task"].tolist())) == 4


def test_what_was_handed_out_stays_as_it_is():
    envs = TableTopVector(3, SPECS["plain"], autoreset_mode="SameStep")
    seen, infos = envs.reset(seed=0)
    kept, phi = seen.copy(), infos["phi"]["task"].copy()
    for _ in range(30):
        envs.step([1, 1, 1])
    np.testing.assert_array_equal(seen, kept)
    np.testing.assert_array_equal(infos["phi"]["task"], phi)
