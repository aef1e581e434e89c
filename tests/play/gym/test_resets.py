"""Episodes that start from scenes, in a small environment of our own; the other files have panda-gym and Fetch."""

import math
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError, ScenegenError, SpecError
from scenegen.gym import SceneResets, keep_clear, phi_space
from scenegen.play.starts import RangeStarts
from scenegen.play.strategies import strategy

SPEC = scenegen.parse("""
workspace [-0.2, 0.2] x [-0.2, 0.2]
object can = cylinder(3 cm, 8 cm), block = box(6 cm, 4 cm, 2 cm), mark = cylinder(5 mm, 5 mm) at (0.1, 0.1)
require dist(can, block) >= 7 cm
task: dist(can, block) <= 12 cm
side: leftOf(can, block)
""")
WANTED = {"task": (-0.1, 0.0), "side": (0.0, None)}


class Table(gymnasium.Env):
    """Things have poses, and nothing moves; the second step is the last."""

    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (21,), np.float64)
    action_space = gymnasium.spaces.Discrete(2)

    def __init__(self):
        self.poses = {}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.poses, self.left = dict.fromkeys(SPEC.objects, np.zeros(7)), 2
        return self.seen(), {"is_success": True, "kept": self.np_random.random()}

    def step(self, action):
        self.left -= 1
        return self.seen(), 1.5, not self.left, False, {"is_success": bool(action)}

    def seen(self):
        return np.concatenate(list(self.poses.values()))


def put(env, name, pose):
    env.poses[name] = pose


def started(phi=WANTED, **settings):
    calls = {"put": put, "observe": Table.seen, "get": lambda env, name: env.poses[name], "quaternion": "wxyz"}
    return SceneResets(Table(), settings.pop("spec", SPEC), phi, **{**calls, **settings})


def test_an_episode_starts_from_a_scene_of_the_range():
    env = started(seed=3)
    for _ in range(20):
        seen, info = env.reset()
        can, block, mark = seen.reshape(3, 7)
        assert info["phi"]["task"] == pytest.approx(0.12 - math.dist(can[:2], block[:2]))
        assert -0.1 <= info["phi"]["task"] <= 0.0 <= info["phi"]["side"]
        assert mark[:2] == pytest.approx([0.1, 0.1]) and set(info) == {"kept", "phi"}
        assert env.phi_now() == pytest.approx(info["phi"], abs=1e-12)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_poses_are_in_the_simulators_frame_and_are_read_back(order):
    settings = {"origin": (1.0, 2.0, 0.4), "turn": 0.7, "origins": "middle", "up": {"can": "x"}, "quaternion": order}
    env, plain = started(**settings), started()
    seen, info = env.reset(seed=4)
    flat, _ = plain.reset(seed=4)
    at, before = seen.reshape(3, 7), flat.reshape(3, 7)
    cosine, sine = math.cos(0.7), math.sin(0.7)
    x, y = before[1, :2]
    assert at[1, :3] == pytest.approx([1 + cosine * x - sine * y, 2 + sine * x + cosine * y, 0.41])
    assert at[0, 2] == pytest.approx(0.44)
    w, qx, qy, qz = at[0, [3, 4, 5, 6] if order == "wxyz" else [6, 3, 4, 5]]
    assert 2 * (qx * qz - qy * w) == pytest.approx(1.0)  # the can's own x axis points up
    assert env.phi_now() == pytest.approx(info["phi"], abs=1e-12)
    headings = 2 * np.arctan2(before[:, 6], before[:, 3])
    assert np.cos(env.poses_now()[:, 2] - headings) == pytest.approx(1.0)
    env.unwrapped.poses["can"] = at[0] + [cosine * 0.05, sine * 0.05, 0, 0, 0, 0, 0]  # 5 cm along the spec's x axis
    assert env.phi_now()["side"] == pytest.approx(info["phi"]["side"] - 0.05)


def test_the_same_seed_is_the_same_start_whatever_was_before():
    env, other = started(), started()
    first = {seed: env.reset(seed=seed)[0] for seed in (1, 2, 3)}
    after = env.reset()[0]
    other.reset()
    assert all((other.reset(seed=seed)[0] == first[seed]).all() for seed in (3, 1, 2, 3))
    assert (other.reset()[0] == after).all()
    assert len({one.tobytes() for one in [*first.values(), after]}) == 4
    assert (started(seed=5).reset()[0] == started(seed=5).reset()[0]).all()
    few = started(ahead=3)
    assert len({few.reset()[0].tobytes() for _ in range(30)}) == 3
    many = gymnasium.vector.SyncVectorEnv([started, started])
    seen, _ = many.reset(seed=2)
    assert (seen == [first[2], first[3]]).all()


@pytest.mark.parametrize("name", ["self_paced", "learnability"])
def test_a_strategy_chooses_the_start_and_hears_how_it_ended(name):
    heard = []

    def fresh():
        lessons = strategy(name, phi_space(SPEC, "task"), np.random.default_rng(0))
        tell = lessons.report
        lessons.report = lambda outcome: (heard.append(outcome), tell(outcome))
        return started(lessons, goal="task")

    env = fresh()
    _, begun = env.reset(seed=1)
    env.step(0)
    _, begun = env.reset(seed=2)  # an episode that is interrupted is not reported
    env.step(0)
    _, _, over, _, info = env.step(1)
    assert over and len(heard) == 1
    (outcome,) = heard
    assert (outcome.success, outcome.total, outcome.steps) == (True, 3.0, 2)
    assert dict(zip(SPEC.labels, outcome.phi, strict=True)) == begun["phi"]
    assert info["outcome"]["phi"] == list(outcome.phi) and info["outcome"]["low"] == list(outcome.task.low)
    again = fresh()
    again.reset(seed=1)
    assert again.reset(seed=2)[1]["phi"] == begun["phi"]


def test_ranges_by_a_function_and_other_sources_of_starts():
    ranges = iter([{"task": (0.0, None)}, {"task": (-0.3, -0.2)}])
    env = started(lambda: next(ranges))
    assert env.reset()[1]["phi"]["task"] >= 0
    assert -0.3 <= env.reset()[1]["phi"]["task"] <= -0.2

    class Every:
        """Starts in their own order, which no seed changes."""

        def __init__(self):
            self.source = RangeStarts(SPEC, lambda: WANTED, 0, 60.0)

        def take(self):
            return self.source.take()

    expected = Every()
    env = started(Every())
    assert [env.reset(seed=1)[1]["phi"] for _ in range(3)] == [expected.take().phi for _ in range(3)]


def test_it_is_a_world_of_a_suite():
    """A start that is given is where the episode begins, and is no business of a strategy."""
    heard = []
    lessons = strategy("uniform", phi_space(SPEC), np.random.default_rng(0))
    lessons.report = heard.append
    env, start = started(lessons), RangeStarts(SPEC, lambda: WANTED, 0, 60.0).take()
    seen, info = env.reset(seed=3, options={"start": start})
    assert (seen.reshape(3, 7) == start.poses).all() and info["phi"] == start.phi
    assert env.step(0)[4]["success"] is False and env.step(1)[4]["success"] is True
    assert not heard


def test_one_episode_at_another_range():
    env, other = started(), started()
    asked = {"task": (-0.3, -0.2)}
    seen, info = env.reset(seed=1, options={"phi": asked})
    assert -0.3 <= info["phi"]["task"] <= -0.2
    assert (other.reset(seed=1, options={"phi": asked})[0] == seen).all()
    assert -0.1 <= env.reset(seed=1)[1]["phi"]["task"] <= 0.0
    assert (env.reset(seed=2)[0] == started().reset(seed=2)[0]).all()  # others are as they were


def test_options_that_are_none():
    start = RangeStarts(SPEC, lambda: WANTED, 0, 60.0).take()
    for code, options in [
        ("wrong-value", {"start": 7}),
        ("wrong-value", {"start": 0}),
        ("wrong-value", {"start": SimpleNamespace(poses=start.poses[:2], phi={})}),
        ("wrong-value", {"start": SimpleNamespace(poses=start.poses, phi={}, objects=("a", "b", "c"))}),
        ("wrong-value", 7),
        ("wrong-value", [("phi", (0, 1))]),
        ("conflicting-arguments", {"start": start, "phi": (-0.1, 0)}),
        ("unknown-label", {"phi": {"tusk": (-0.1, 0)}}),
        ("range-not-a-pair", {"phi": {"task": -0.1}}),
        ("beyond-bounds", {"phi": {"task": (5.0, None)}}),
    ]:
        env = started()
        with pytest.raises(RequestError) as caught:
            env.reset(options=options)
        assert caught.value.diagnostics[0].code == code and not env.unwrapped.poses, options


@pytest.mark.parametrize("said", [math.nan, 0.3, "False", np.array([True, False])])
def test_a_success_that_is_none(said):
    env = started()
    env.reset()
    env.unwrapped.step = lambda action: (None, 0.0, True, False, {"is_success": said})
    with pytest.raises(ScenegenError, match="does not judge"):
        env.step(0)


def test_things_keep_clear_of_a_hand_at_rest():
    clear = keep_clear(SPEC, 0.05, -0.05, 0.06)
    assert clear.labels == SPEC.labels and clear.objects == SPEC.objects
    scenes = scenegen.sample(clear, WANTED, n=200)
    distance = np.linalg.norm(scenes.poses[:, :, :2] - [0.05, -0.05], axis=2)
    assert distance[:, 0].min() >= 0.09 and distance[:, 1].min() >= 0.06 + 0.02  # the can's radius, half the block
    free = scenegen.sample(SPEC, WANTED, n=200)
    assert np.linalg.norm(free.poses[:, 0, :2] - [0.05, -0.05], axis=1).min() < 0.09
    with pytest.raises(RequestError, match="out-of-range"):
        keep_clear(SPEC, 0.0, 0.0, 0.0)
    with pytest.raises((RequestError, SpecError)):
        scenegen.sample(keep_clear(SPEC, 0.0, 0.0, 1.0), n=1)


def test_bad_requests_are_answered():
    for code, settings in [
        ("wrong-value", {"put": None}),
        ("wrong-value", {"get": 3}),
        ("unknown-choice", {"quaternion": "wzyx"}),
        ("wrong-value", {"origin": (0, 0)}),
        ("out-of-range", {"ahead": 0}),
        ("range-not-a-pair", {"phi": {"task": 0.1}}),
        ("beyond-bounds", {"phi": {"task": (0.5, None)}}),
        ("unknown-choice", {"origins": {"cup": 0.1}}),
    ]:
        with pytest.raises(RequestError) as error:
            started(**settings).reset()
        assert error.value.diagnostics[0].code == code
    for code, env in [
        ("no-episode", started()),
        ("missing-argument", started(get=None)),
        ("wrong-value", started(get=lambda env, name: (0, 0))),
    ]:
        if code != "no-episode":
            env.reset()
        with pytest.raises(RequestError) as error:
            env.phi_now()
        assert error.value.diagnostics[0].code == code
    env = started(strategy("uniform", phi_space(SPEC), np.random.default_rng(0)), success="success")
    env.reset()
    env.step(0)
    with pytest.raises(RequestError, match="unknown-choice"):
        env.step(0)
