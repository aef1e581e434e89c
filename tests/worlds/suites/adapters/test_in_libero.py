"""A task of LIBERO as a world: the same number, the same start; and a scripted policy that LIBERO accepts."""

from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE
from scenegen.worlds.suites.adapters.libero import make

pytestmark = pytest.mark.libero
TASK = "pick_up_the_butter_and_place_it_in_the_basket"


@pytest.fixture(scope="module")
def world():
    pytest.importorskip("libero", reason="needs LIBERO: make test-libero installs it")
    return make(SimpleNamespace(name=TASK))


def start(row):
    return {"start": SimpleNamespace(row=row, number=row, seed=row)}


def test_starts_are_the_same_bit_for_bit(world):
    begun = {}
    for row in (0, 1, 0, 2, 2):
        observation, info = world.reset(options=start(row))
        state = world.sim.get_state().flatten()
        assert np.array_equal(begun.setdefault(row, state), state) and info == {"success": False}
        assert observation["objects"].shape == (len(observation["names"]), 7)
        world.step(np.random.default_rng(0).uniform(-1, 1, 7))
    assert not np.array_equal(begun[0], begun[1])


def test_a_scripted_policy_is_accepted(world, root, monkeypatch):
    monkeypatch.syspath_prepend(root / "examples" / "policies")
    from scripted_libero import Scripted

    policy, won = Scripted(world), 0
    for row in range(3):
        observation, info = world.reset(options=start(row))
        policy.reset(row)
        for _ in range(200):
            observation, _, success, _, info = world.step(policy(observation, ""))
            if success:
                break
        assert info["success"] is success is bool(world.env.check_success())
        won += success
    print(f"LIBERO accepts {won} of 3")
    assert won >= 2


def test_what_is_not_there_is_refused(world):
    with pytest.raises(RequestError) as caught:
        make(SimpleNamespace(name="put_the_moon_on_the_plate"))
    assert caught.value.diagnostics[0].kind == UNKNOWN_CHOICE
    with pytest.raises(RequestError) as caught:
        world.reset(options=start(10_000))
    assert caught.value.diagnostics[0].kind == OUT_OF_RANGE
