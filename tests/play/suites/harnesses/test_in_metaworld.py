"""A suite as tasks of Meta-World, in Meta-World itself: objects stand where the starts have them."""

import pickle

import numpy as np
import pytest

from scenegen.errors import DataError, RequestError
from scenegen.errors.worlds import METAWORLD_START
from scenegen.play.suites.harnesses.metaworld import MAX_OFF, SEEN_OBJECTS, write_metaworld
from scenegen.play.suites.new import new_suite
from scenegen.play.suites.suite import Suite

pytestmark = pytest.mark.harnesses

PUSH = """
# Push the puck to the goal.
workspace [-10 cm, 10 cm] x [60 cm, 90 cm]
object obj = cylinder(2 cm, 4 cm), target = cylinder(1 cm, 1 mm)
require y(obj) <= 70 cm & y(target) >= 80 cm & farFrom(obj, target, 15 cm)
goal: closeTo(obj, target, 5 cm)
"""
SWEEP = """
# Sweep the block off the table.
workspace [-10 cm, 10 cm] x [60 cm, 70 cm]
object obj = cylinder(2 cm, 4 cm)
goal: x(obj) >= 42 cm
"""
BIN = """
# Pick the block and place it into the other bin.
workspace [-21 cm, 20 cm] x [60 cm, 80 cm]
object obj = cylinder(2 cm, 4 cm), target = cylinder(1 cm, 1 mm) at (12 cm, 70 cm)
object wall = box(1 cm, 30 cm, 5 cm) at (0, 70 cm)
require x(obj) <= -3 cm & y(obj) >= 65 cm & y(obj) <= 75 cm
goal: closeTo(obj, target, 5 cm)
"""
SPECS = {"push-v3": PUSH, "sweep-v3": SWEEP, "bin-picking-v3": BIN}


@pytest.fixture(scope="module")
def metaworld():
    return pytest.importorskip("metaworld", reason="needs Meta-World: make test-harnesses installs it")


def suite_of(folder, specs, n=2):
    for name, text in specs.items():
        (folder / f"{name}.spec").write_text(text)
    new_suite([(name, folder / f"{name}.spec") for name in specs], folder / "s", bands=2, n=n, workers=1)
    return folder / "s"


@pytest.fixture(scope="module")
def made(metaworld, tmp_path_factory):
    folder = tmp_path_factory.mktemp("metaworld")
    suite = suite_of(folder, SPECS)
    off = write_metaworld(suite, folder / "tasks.pkl")
    return Suite.load(suite), pickle.loads((folder / "tasks.pkl").read_bytes()), off  # noqa: S301


def test_task_i_is_start_i(metaworld, made):
    """Whatever was set and done in the environment before: what it observes is the same, and phi of what stands there
    is that of the start."""
    suite, tasks, off = made
    assert len(tasks) == len(suite) and off < 1e-9
    rng, envs, states = np.random.default_rng(0), {}, {}
    for number in [*range(len(suite)), *rng.permutation(2 * len(suite)) % len(suite)]:
        start, task = suite[int(number)], tasks[int(number)]
        assert isinstance(task, metaworld.Task) and task.env_name == start.task.name
        kind = metaworld.env_dict.ALL_V3_ENVIRONMENTS[task.env_name]
        env = envs.setdefault(task.env_name, kind())
        env.set_task(task)
        observation, _ = env.reset()
        for _ in range(rng.integers(30)):
            env.step(rng.uniform(-1, 1, 4).astype(np.float32))
        fresh = (observation.tobytes(), env.unwrapped.obj_init_pos.tobytes())
        assert states.setdefault(int(number), fresh) == fresh
        poses = start.task.scenes.poses[start.row].copy()
        assert np.abs(observation[4:6] - poses[start.objects.index("obj"), :2]).max() < 1e-9
        poses[start.objects.index("obj"), :2] = observation[4:6]
        if "target" in start.objects:
            poses[start.objects.index("target"), :2] = observation[36:38]
        phi = start.task.spec.scenes(poses).phi["goal"][0]
        assert phi == pytest.approx(start.phi["goal"], abs=1e-9)


def test_meta_worlds_own_benchmark_takes_the_tasks(metaworld, made):
    suite, tasks, _ = made
    benchmark = metaworld.MT1("push-v3", seed=0)
    env = benchmark.train_classes["push-v3"]()
    mine = [number for number, task in enumerate(tasks) if task.env_name == "push-v3"]
    for task, number in zip(benchmark.train_tasks, mine, strict=False):
        env.set_task(task)
        env.reset()
        env.set_task(tasks[number])
        start, (observation, _) = suite[number], env.reset()
        assert np.abs(observation[36:38] - start.poses[start.objects.index("target"), :2]).max() < 1e-9
        assert not env.step(np.zeros(4, dtype=np.float32))[4]["success"]
        assert sorted(pickle.loads(task.data)) == sorted(pickle.loads(tasks[number].data))  # noqa: S301


FITTING = """
bin-picking button-press-topdown button-press-topdown-wall coffee-pull coffee-push hammer hand-insert
pick-out-of-hole pick-place pick-place-wall plate-slide plate-slide-side push push-back push-wall reach reach-wall
shelf-place soccer stick-pull stick-push sweep sweep-into
""".split()  # docs/harnesses.md has them


def test_environments_that_observe_what_they_place(metaworld):
    """The same check as the writer's, with the object at one end of its range and the target at the other, or in the
    middle of one of 2 mm, which stands for a point."""
    found = []
    for name, kind in metaworld.env_dict.ALL_V3_ENVIRONMENTS.items():
        env = kind()
        low, high = env._random_reset_space.low, env._random_reset_space.high
        vector = np.where(high - low < 3e-3, (low + high) / 2, np.hstack([low[:3], high[3:]]))
        data = {"rand_vec": vector, "env_cls": kind, "partially_observable": False}
        env.set_task(metaworld.Task(name, pickle.dumps(data)))
        observation, _ = env.reset()
        offs = [
            np.abs(observation[seen] - vector[3 * k : 3 * k + 2]).max()
            for k, seen in enumerate(SEEN_OBJECTS[: len(low) // 3])
        ]
        if max(offs) <= MAX_OFF:
            found.append(name.removesuffix("-v3"))
    assert sorted(found) == sorted(FITTING) and len(found) == 23


@pytest.mark.parametrize(
    "name, text, said",
    [
        ("push-v9", PUSH, "push-v9"),
        ("push-v3", PUSH.replace("target", "aim"), "aim"),
        ("push-v3", PUSH.replace("target =", "other = cylinder(1 cm, 1 cm), target ="), "other"),
        ("push-v3", PUSH.replace("& y(target) >= 80 cm", "& y(target) <= 79 cm"), "never draws it"),
        ("push-v3", PUSH.replace("& farFrom(obj, target, 15 cm)", "& closeTo(obj, target, 14 cm)"), "never takes"),
        ("push-v3", PUSH.replace("closeTo(obj", "facing(obj, target, 30 deg) & closeTo(obj"), "another phi"),
        ("basketball-v3", PUSH.replace("80 cm", "85 cm"), "`target` of start 0 is 83.0 mm off"),
    ],
)
def test_what_is_refused(metaworld, tmp_path, name, text, said):
    with pytest.raises((DataError, RequestError), match=said) as caught:
        write_metaworld(suite_of(tmp_path, {name: text}), tmp_path / "tasks.pkl")
    assert len(caught.value.diagnostics) == 1 and not (tmp_path / "tasks.pkl").exists()
    assert name == "push-v9" or caught.value.diagnostics[0].kind is METAWORLD_START
