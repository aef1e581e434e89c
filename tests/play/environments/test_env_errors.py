"""Bad requests raise gymnasium's own errors, in a sentence that helps."""

import gymnasium
import numpy as np
import pytest
from gymnasium import error

import scenegen
from scenegen.curriculum import Curriculum, PhiBox, TableTop, TableTopVector, VectorCurriculum
from scenegen.play.strategies.levels import Uniform

LEFT = "leftOf(mug, plate)"
APART = (
    "object mug = box(0.1, 0.1, 0.1)\nobject plate = box(0.1, 0.1, 0.1)\nrequire noOverlap()\ntask: leftOf(mug, plate)"
)
HELD = "object mug\nobject plate at (0.5, 0.5)\ntask: leftOf(mug, plate)"
POSES = {"mug": (0.2, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}

MAKING = [
    ({}, error.MissingArgument, "say what the table is about: spec="),
    ({"spec": 3}, error.Error, "`spec` is of type int"),
    ({"spec": "object mug at (0.5, 0.5)\ntask: x(mug) <= 0.4"}, error.Error, "no object is free"),
    ({"spec": LEFT, "goal": "tusk"}, error.Error, "the spec has no label `tusk`"),
    ({"spec": LEFT, "goal": ()}, error.Error, "`goal` is empty"),
    ({"spec": LEFT, "moves": "contineous"}, error.Error, "did you mean `continuous`"),
    ({"spec": LEFT, "move": "mag"}, error.Error, "the spec has no object `mag`"),
    ({"spec": HELD, "move": ["plate"]}, error.Error, "`plate` is held in place by the spec already"),
    ({"spec": LEFT, "move": ()}, error.Error, "`move` is empty"),
    (
        {"spec": f"object mug, plate, fork\ntask: {LEFT}", "move": "fork"},
        error.Error,
        "give it an object that phi of `task` depends on: `m",
    ),
    (
        {"spec": f"object mug, plate, fork\ntask: {LEFT}\nb: x(fork) <= 0.5", "move": "fork", "goal": "task"},
        error.Error,
        "`task` depends on",
    ),
    ({"spec": LEFT, "step": 0.0}, error.Error, "`step` is 0"),
    ({"spec": LEFT, "step": float("nan")}, error.Error, "`step` is nan"),
    ({"spec": LEFT, "turn": 7.0}, error.Error, "`turn` is 7"),
    ({"spec": LEFT, "reward": "dens"}, error.Error, "did you mean `dense`"),
    ({"spec": LEFT, "render_mode": "human"}, error.UnsupportedMode, "unknown render mode `human`"),
    ({"spec": LEFT, "render_mode": "rgb_array", "view": "tap"}, error.Error, "did you mean `top`"),
    ({"spec": LEFT, "render_mode": "rgb_array", "size": (4, 4)}, error.Error, "16 to 4096 pixels"),
    ({"spec": LEFT, "phi": (0.3, 0.1)}, error.InvalidBound, "reversed"),
    ({"spec": LEFT, "goal": 3}, error.Error, "`goal` is 3"),
    ({"spec": LEFT, "goal": [3]}, error.Error, r"`goal` is \[3\]"),
    ({"spec": LEFT, "goal": b"task"}, error.Error, "`goal` is b'task'"),
    ({"spec": LEFT, "move": 3}, error.Error, "`move` is 3"),
    ({"spec": LEFT, "moves": None}, error.Error, "unknown moves `None`"),
    ({"spec": LEFT, "reward": ["dense"]}, error.Error, r"unknown reward `\['dense'\]`"),
    ({"spec": LEFT, "step": "0.1"}, error.Error, r"`step` is '0\.1'"),
    ({"spec": LEFT, "step": True}, error.Error, "`step` is True"),
    ({"spec": LEFT, "turn": [1.0]}, error.Error, r"`turn` is \[1\.0\]"),
    ({"spec": LEFT, "view": 3}, error.Error, "`view` is 3"),
    ({"spec": LEFT, "size": (64, 64, 3)}, error.Error, r"`size` is \(64, 64, 3\)"),
    ({"spec": LEFT, "size": (64.5, 64)}, error.Error, "in whole pixels"),
]


@pytest.mark.parametrize("settings, kind, text", MAKING, ids=[str(number) for number in range(len(MAKING))])
def test_what_an_environment_cannot_be(settings, kind, text):
    with pytest.raises(kind, match=text):
        TableTop(**settings)


ASKING = [
    ({"phi": (2.0, 3.0)}, error.InvalidBound, r"2:3; phi of `task` lies between -1 and 1.*nearest.*`task` 0\.9"),
    ({"phi": (-7.0, -5.0)}, error.InvalidBound, r"nearest scene that was met has phi of `task` -0\.9"),
    ({"phi": (0.2, 0.1)}, error.InvalidBound, "this range of phi of `task` is reversed"),
    ({"phi": (0.2, 0.2)}, error.InvalidBound, r"phi of `task` is exactly 0\.2 with probability 0"),
    ({"phi": (0.2, float("nan"))}, error.InvalidBound, "NaN cannot end a range of phi of `task`"),
    ({"phi": 0.2}, error.InvalidBound, "write \\(lowest, highest\\)"),
    ({"phi": ("a", "b")}, error.InvalidBound, "write \\(lowest, highest\\)"),
    ({"phi": {"taks": (0.0, 0.1)}}, error.Error, "no label `taks`; did you mean `task`"),
    ({"phi": PhiBox((0.0, 0.0), (1.0, 1.0))}, error.Error, "phi of 2 labels; the spec has `task`"),
    ({"phy": (0.0, 0.1)}, error.Error, "unknown option `phy`; did you mean `phi`"),
    ({"phi": (0.0, 0.1), "scene": POSES}, error.Error, "`phi` and `scene` contradict each other"),
    (
        {"scene": {"mug": (0.2, 0.5, 0.0)}},
        error.Error,
        "a scene that lacks `plate` does not place the objects of its spec",
    ),
    (
        {"scene": {**POSES, "cup": (0.2, 0.5, 0.0)}},
        error.Error,
        "a scene that has `cup` does not place the objects of its spec",
    ),
    ({"scene": {**POSES, "mug": (0.2, 0.5)}}, error.Error, "the pose of `mug`.*in metres and radians"),
    ({"scene": {**POSES, "mug": (0.2, float("nan"), 0.0)}}, error.Error, r"the pose of `mug` is \(0\.2, nan, 0\)"),
    ({"scene": {**POSES, "mug": (1.2, 0.5, 0.0)}}, error.Error, "`mug` is outside of the workspace"),
    ({"scene": np.zeros((3, 3))}, error.Error, r"a scene is a Scene, a pose for each object, or an array \(2, 3\)"),
    ({"scene": "mug"}, error.Error, r"a scene is a Scene, a pose for each object, or an array \(2, 3\)"),
    ({"scene": [["a", "b", "c"], [0.5, 0.5, 0.0]]}, error.Error, "not all numbers"),
    ({"scene": [[0.2, 0.5], [0.5, 0.5, 0.0]]}, error.Error, "not all numbers"),
    ({"scene": np.full((2, 3), 0.5j)}, error.Error, "not all numbers"),
    ({"scene": {"poses": 3}}, error.Error, r"a scene is a Scene, a pose for each object, or an array \(2, 3\)"),
    ({"scene": {**POSES, "mug": "123"}}, error.Error, "the pose of `mug` is '123'"),
    ({"scene": {**POSES, "mug": (10**400, 0.5, 0.0)}}, error.Error, "the pose of `mug`"),
    (
        {"scene": {**POSES, "mug": {"x": 0.2, "y": 0.5, "thta": 1.0}}},
        error.Error,
        "the pose of `mug` is one with `thta`",
    ),
    ({"phi": (-0.3, 10**400)}, error.InvalidBound, "a number that large cannot end a range of phi of `task`"),
    (
        {"phi": (float("inf"), float("inf")), "nearest": True},
        error.InvalidBound,
        "inf at both sides cannot end a range of phi of `task`",
    ),
    ({"phi": PhiBox((-0.3,), (-0.1, 0.2))}, error.Error, "phi of 2 labels"),
    ({"phi": PhiBox(-0.3, -0.1)}, error.InvalidBound, r"PhiBox\(low=-0\.3, high=-0\.1\) is no task"),
    ({"phi": (-0.3, -0.1), "nearest": "no"}, error.Error, "`nearest` is 'no'"),
    (3, error.Error, "`options` is 3"),
    ([("phi", (-0.3, -0.1))], error.Error, r"`options` is \[\('phi', \(-0\.3, -0\.1\)\)\]"),
]


@pytest.mark.parametrize("options, kind, text", ASKING, ids=[str(number) for number in range(len(ASKING))])
def test_what_cannot_be_asked_for(options, kind, text):
    env = TableTop(LEFT)
    with pytest.raises(kind, match=text):
        env.reset(seed=0, options=options)
    env.reset(seed=0)  # nothing is broken by that


def test_a_scene_that_breaks_what_is_required():
    env = TableTop(APART)
    with pytest.raises(error.Error, match="does not meet what the spec requires"):
        env.reset(options={"scene": {"mug": (0.45, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}})
    with pytest.raises(error.Error, match="`plate` is held"):
        TableTop(HELD).reset(options={"scene": {"mug": (0.4, 0.5, 0.0), "plate": (0.6, 0.5, 0.0)}})


@pytest.mark.parametrize(
    "moves, action, text",
    [
        ("grid", 8, "no action 8; they are numbered from 0 to 7"),
        ("grid", -1, "no action -1"),
        ("grid", 1.5, "whole number"),
        ("grid", [0, 1], "whole number"),
        ("grid", None, "whole number"),
        ("grid", [[0], [0, 1]], "whole number"),
        ("continuous", [0.0, 0.0, 1.5, 0.0], "`plate x` of the action is 1.5; it has to be from -1 to 1"),
        ("continuous", [0.0, float("nan"), 0.0, 0.0], "`mug y` of the action is not a number"),
        ("continuous", [0.0, 0.0], r"an action is 4 numbers \(mug x, mug y, plate x, plate y\)"),
        ("continuous", None, "an action is 4 numbers"),
    ],
)
def test_actions_that_are_none(moves, action, text):
    env = TableTop(LEFT, moves=moves)
    env.reset(options={"scene": POSES})
    with pytest.raises(error.InvalidAction, match=text):
        env.step(action)


def test_episodes_begin_with_a_reset():
    env = TableTop(LEFT, render_mode="rgb_array")
    with pytest.raises(error.ResetNeeded, match="no episode has begun"):
        env.step(0)
    with pytest.raises(error.ResetNeeded, match="nothing to draw"):
        env.render()
    env.reset(options={"scene": {"mug": (0.52, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}})
    assert env.step(1)[2]
    with pytest.raises(error.ResetNeeded, match="the episode is over"):
        env.step(1)


def test_sources(tmp_path):
    scenes = scenegen.sample(scenegen.parse(LEFT), {"task": (0.1, 0.2)}, 4)
    with pytest.raises(error.Error, match="every scene of the source satisfies the goal already"):
        TableTop(LEFT, source=scenes).reset()
    with pytest.raises(error.InvalidBound, match=r"the file has no scene with phi of `task` in -0.2:-0.1; the nearest"):
        TableTop(LEFT, source=scenes).reset(options={"phi": (-0.2, -0.1)})
    with pytest.raises(error.Error, match="these scenes are not of this spec"):
        TableTop("leftOf(mug, fork)", source=scenes).reset()
    with pytest.raises(error.Error, match=r"cannot read|no such|there is no"):
        TableTop(LEFT, source=tmp_path / "nothing.json").reset()
    with pytest.raises(error.Error, match="`source` is of type list"):
        TableTop(LEFT, source=[])
    with pytest.raises(error.Error, match="there are no scenes"):
        TableTop(LEFT, source=scenes[:0]).reset()
    with pytest.raises(error.Error, match=r"every scene satisfies the goal `task` already.*lies between 0 and 1.414"):
        TableTop("!closeTo(mug, plate, 0)").reset()
    with pytest.raises(error.Error, match=r"no scene satisfies the goal.*lies between -2 and -1"):
        TableTop("object mug\nobject plate\ntask: x(mug) >= 2").reset()
    both = "one: x(mug) - x(plate) >= 0.1\nother: x(plate) - x(mug) >= 0.1"
    with pytest.raises(error.Error, match=r"no scene satisfies the goal `one & other`, so there is nothing to learn"):
        TableTop(f"object mug, plate\n{both}").reset(seed=0)


def test_a_spec_with_mistakes_is_shown(tmp_path):
    with pytest.raises(error.Error, match=r"<spec>:1:1(.|\n)*did you mean `leftOf`"):
        TableTop("leftOff(mug, plate)")
    with pytest.raises(error.Error, match=r"nothing\.spec"):
        TableTop(tmp_path / "nothing.spec")


@pytest.mark.parametrize(
    "settings, text",
    [
        ({"num_envs": 0}, "`num_envs` is 0"),
        ({"num_envs": 2, "max_episode_steps": 0}, "`max_episode_steps` is 0"),
        ({"num_envs": 2, "autoreset_mode": "Never"}, "unknown autoreset mode `Never`"),
    ],
)
def test_what_a_vector_cannot_be(settings, text):
    with pytest.raises(error.Error, match=text):
        TableTopVector(spec=LEFT, **settings)


def test_what_cannot_be_asked_of_a_vector():
    envs = TableTopVector(2, LEFT, autoreset_mode="Disabled")
    with pytest.raises(error.ResetNeeded, match="no episode has begun"):
        envs.step([0, 0])
    with pytest.raises(error.ResetNeeded, match="leave `reset_mask` out"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(error.Error, match="3 seeds; give it one, or 2"):
        envs.reset(seed=[1, 2, 3])
    envs.reset(options={"scene": {"mug": (0.52, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}})
    with pytest.raises(error.Error, match="2 bools, at least one of them True"):
        envs.reset(options={"reset_mask": np.array([False, False])})
    with pytest.raises(error.InvalidAction, match=r"2 actions are needed, whole numbers from 0 to 7, not \[0, 1, 2\]"):
        envs.step([0, 1, 2])
    with pytest.raises(error.Error, match="`options` is 3"):
        envs.reset(options=3)
    with pytest.raises(error.Error, match=r"`seed` is 1.5; give it a python integer, or a list of 2"):
        envs.reset(seed=1.5)
    envs.step([1, 0])
    with pytest.raises(error.ResetNeeded, match="the episode is over on table 0"):
        envs.step([0, 0])


def test_a_request_that_cannot_be_met_changes_nothing():
    envs = TableTopVector(2, LEFT)
    with pytest.raises(error.InvalidBound):
        envs.reset(seed=0, options={"phi": (2.0, 3.0)})
    with pytest.raises(error.ResetNeeded):  # not on tables with all objects in the corner
        envs.step([0, 0])
    env, other = TableTop(LEFT), TableTop(LEFT)
    env.reset(seed=0)
    other.reset(seed=0)
    with pytest.raises(error.Error):
        env.reset(seed=1, options={"phy": (0.0, 0.1)})
    np.testing.assert_array_equal(env.reset()[0], other.reset()[0])


def test_whose_action_is_none():
    envs = TableTopVector(2, LEFT, moves="continuous")
    envs.reset(options={"scene": POSES})
    with pytest.raises(error.InvalidAction, match="`mug y` of the action on table 1 is not a number"):
        envs.step([[0.0, 0.0, 0.0, 0.0], [0.0, float("nan"), 0.0, 0.0]])


class Wrong:
    """A strategy whose tasks are none."""

    def next_task(self):
        return (-0.3, -0.1)

    def report(self, outcome):
        raise AssertionError(outcome)


@pytest.mark.parametrize("kind, made", [(Curriculum, TableTop), (VectorCurriculum, TableTopVector)])
def test_what_a_curriculum_cannot_be(kind, made):
    env = made(spec=LEFT)
    for strategy in (None, "linear", Wrong):
        with pytest.raises(error.Error, match=r"`strategy` is .*; give it one: strategy"):
            kind(env, strategy)
    with pytest.raises(error.Error, match=f"`env` is a CartPoleEnv; give it a {made.__name__}"):
        kind(gymnasium.make("CartPole-v1"), Wrong())
    with pytest.raises(error.Error, match=r"\(-0\.3, -0\.1\) is no task"):
        kind(env, Wrong()).reset()
    far = Uniform(PhiBox((-50.0,), (-40.0,)), np.random.default_rng(0))
    with pytest.raises(error.InvalidBound, match=r"about phi from -50 to -40 of label 0.*`env.unwrapped.space`"):
        kind(env, far).reset()
    with pytest.raises(error.Error, match="`options` is 3"):
        kind(env, Uniform(env.space, np.random.default_rng(0))).reset(options=3)
