"""Worlds and policies of others: found by name, and checked; each breach of the contract is said."""

import importlib.metadata
import types
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from scenegen.conformance import check_policy, check_world
from scenegen.errors import RequestError
from scenegen.errors.requests import BAD_PLUGIN
from scenegen.play.suites.loading import check_name, load_named, versions_of
from scenegen.play.suites.run import Player
from scenegen.play.suites.suite import Suite

from . import toy

PLAIN = f"{toy.__name__}:make"


@pytest.fixture
def task(small):
    return Suite.load(small).tasks[0]


@pytest.fixture
def register(monkeypatch):
    """Registers entry points, (name, value) each, as of two packages."""

    def points(group, *pairs):
        dists = [types.SimpleNamespace(name=f"package-{k}") for k in range(len(pairs))]
        found = [
            types.SimpleNamespace(name=name, value=value, dist=dist, load=partial(load_named, "world", value))
            for (name, value), dist in zip(pairs, dists, strict=True)
        ]
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group: found if group == registered else [])
        registered = group

    return points


def test_a_world_that_keeps_to_the_contract(task):
    check_world(toy.make, task, toy.towards)
    check_world(toy.make, task, toy.Noisy())


class Toy(toy.Toy):
    """With an action space of Gymnasium's."""

    def __init__(self, task):
        super().__init__(task)
        from gymnasium.spaces import Box

        self.action_space = Box(-0.01, 0.01, (2,), np.float64)


class Deaf(toy.Toy):
    def reset(self, *, seed, options):
        start = self.task.start(0, 0)
        return super().reset(seed=start.seed, options={"start": start})


class Writes(toy.Toy):
    def reset(self, *, seed, options):
        options["start"].poses[0, 0] += 1e-9
        return super().reset(seed=seed, options=options)


class Drifts(toy.Toy):
    def step(self, action):
        self.drift = getattr(self, "drift", 0) + 1
        return super().step(action + 1e-3 * self.drift)


class OldGym(toy.Toy):
    def step(self, action):
        observation, reward, terminated, _, info = super().step(action)
        return observation, reward, terminated, info


class Silent(toy.Toy):
    def reset(self, *, seed, options):
        return super().reset(seed=seed, options=options)[0]


class Floats(toy.Toy):
    def step(self, action):
        observation, reward, _, truncated, info = super().step(action)
        return observation, reward, 0.0, truncated, info


class Endless:
    def __init__(self, task):
        self.reset = self.step = lambda **_: None


def test_actions_are_of_the_action_space_where_there_is_no_policy(task):
    check_world(Toy, task)
    with pytest.raises(AssertionError, match="no action_space"):
        check_world(toy.make, task)


@pytest.mark.parametrize(
    "make, message",
    [
        (Deaf, "two starts gave the same observation"),
        (Writes, "copy them"),
        (Drifts, "the same start, seed and actions"),
        (OldGym, "observation, reward, terminated, truncated, info"),
        (Silent, "observation, info"),
        (Floats, "terminated is 0.0"),
        (Endless, "no close"),
        (toy.unjudged, "`success` of info is 'missing'"),
    ],
)
def test_what_a_world_does_wrong_is_said(task, make, message):
    with pytest.raises(AssertionError, match=message):
        check_world(make, task, toy.towards)


OBSERVATION = {"a": np.array([0.3, 0.4], dtype=np.float32), "number": 3}


@pytest.mark.parametrize("policy", [toy.towards, toy.obedient, toy.Noisy])
def test_a_policy_that_keeps_to_the_contract(policy):
    check_policy(policy, OBSERVATION)


class Restless:
    def __init__(self):
        self.count = 0

    def reset(self, seed):
        pass

    def __call__(self, observation, instruction):
        self.count += 1
        return [float(self.count)]


@pytest.mark.parametrize(
    "policy, message",
    [
        (lambda observation, instruction: None, "None"),
        (lambda observation, instruction: object(), "does not travel"),
        (lambda observation, instruction: [float("nan")], "not finite"),
        (lambda observation, instruction: observation["a"].__imul__(2.0), "changes the observation"),
        (Restless, "gave another action"),
    ],
)
def test_what_a_policy_does_wrong_is_said(policy, message):
    with pytest.raises(AssertionError, match=message):
        check_policy(policy, OBSERVATION)


def test_worlds_and_policies_of_other_packages_have_names(register, small):
    register("scenegen.worlds", ("plain", PLAIN))
    check_name("world", "plain")
    assert load_named("world", "plain") is toy.make and {*versions_of("plain")} == {"scenegen"}
    assert Player(small, False, "plain", f"{Path(toy.__file__)}:towards", False, 30)(0).success
    register("scenegen.policies", ("good", f"{toy.__name__}:towards"))
    check_name("policy", "good")
    with pytest.raises(RequestError, match="or one of `libero`, `libero-pictures`"):
        check_name("world", "plain")
    with pytest.raises(RequestError, match="or one of `good`"):
        check_name("policy", "bad")


def test_own_names():
    assert load_named("world", "table").__module__ == "scenegen.play.suites.adapters.table"
    assert {*versions_of("table")} <= {"scenegen", "robosuite"}


@pytest.mark.parametrize("pairs", [[("table", PLAIN)], [("plain", PLAIN), ("plain", f"{toy.__name__}:unjudged")]])
def test_a_name_that_is_taken_is_one_diagnostic(register, pairs):
    register("scenegen.worlds", *pairs)
    with pytest.raises(RequestError) as caught:
        check_name("world", pairs[0][0])
    assert [one.kind for one in caught.value.diagnostics] == [BAD_PLUGIN]


def test_an_entry_point_that_cannot_be_loaded_is_one_diagnostic(register, small):
    register("scenegen.worlds", ("plain", "no.such.module:make"))
    check_name("world", "plain")
    with pytest.raises(RequestError) as caught:
        Player(small, False, "plain", f"{Path(toy.__file__)}:towards", False, 30)(0)
    assert [one.kind for one in caught.value.diagnostics] == [BAD_PLUGIN]
