"""A task of LIBERO as a world: the same number, the same start; and a scripted policy that LIBERO accepts."""

from types import SimpleNamespace

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE, UNKNOWN_CHOICE
from scenegen.play.suites.adapters.libero import make
from scenegen.play.suites.new import new_suite
from scenegen.play.suites.suite import Suite

pytestmark = pytest.mark.libero
TASK = "pick_up_the_butter_and_place_it_in_the_basket"


@pytest.fixture(scope="module")
def world():
    pytest.importorskip("libero", reason="needs LIBERO: make test-libero installs it")
    return make(SimpleNamespace(name=TASK, spec=scenegen.parse("leftOf(a, b)")))


def start(row):
    return {"start": SimpleNamespace(row=row, number=row, seed=row, goal=None)}


def test_starts_are_the_same_bit_for_bit(world):
    begun = {}
    for row in (0, 1, 0, 2, 2):
        observation, info = world.reset(options=start(row))
        state = world.sim.get_state().flatten()
        assert np.array_equal(begun.setdefault(row, state), state) and info == {"success": False}
        assert observation["objects"].shape == (len(observation["names"]), 7)
        world.step(np.random.default_rng(0).uniform(-1, 1, 7))
    assert not np.array_equal(begun[0], begun[1])


@pytest.fixture
def scripted(root, monkeypatch):
    monkeypatch.syspath_prepend(root / "examples" / "policies")
    from scripted_libero import Scripted

    return Scripted


def test_a_scripted_policy_is_accepted(world, scripted):
    policy, won = scripted(world), 0
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


def test_graded_starts_of_the_environments_own_spec(world, scripted, tmp_path):
    """A suite of the spec that `spec_of` makes: things stand where its starts have them, and the policy solves most."""
    text = tmp_path / f"{TASK}.spec"
    text.write_text(scripted(world).own.text)
    new_suite([(TASK, text)], tmp_path / "graded", bands=2, n=2, workers=1)
    suite = Suite.load(tmp_path / "graded")
    there = make(suite.tasks[0])
    policy, won, off, begun = scripted(there), 0, [], {}
    for start in (*suite, *suite):
        observation, info = there.reset(options={"start": start})
        state = there.sim.get_state().flatten()
        assert np.array_equal(begun.setdefault(start.number, state), state) and info == {"success": False}
        seen = dict(zip(observation["names"], observation["objects"], strict=True))
        off += [
            np.linalg.norm(seen[name][:2] - start.poses[k][:2]) for k, name in enumerate(start.objects) if name in seen
        ]
    for start in suite:
        observation, _ = there.reset(options={"start": start})
        policy.reset(start.seed)
        for _ in range(200):
            observation, _, success, _, _ = there.step(policy(observation, ""))
            if success:
                break
        won += success
    print(f"LIBERO accepts {won} of {len(suite)}; things are off by at most {1e3 * max(off):.1f} mm")
    assert won >= 3 and max(off) < 0.01


def test_what_is_not_there_is_refused(world):
    with pytest.raises(RequestError) as caught:
        make(SimpleNamespace(name="put_the_moon_on_the_plate", spec=None))
    assert caught.value.diagnostics[0].kind == UNKNOWN_CHOICE
    with pytest.raises(RequestError) as caught:
        world.reset(options=start(10_000))
    assert caught.value.diagnostics[0].kind == OUT_OF_RANGE
