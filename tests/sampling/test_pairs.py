"""Pairs of a start and a goal: in range, as many objects moved as asked for, and distributed as said."""

import numpy as np
import pytest

import scenegen
from experiments.metrics import energy_test
from scenegen.errors import DataError, RequestError
from scenegen.pose import as_rows
from scenegen.sampling import pairs
from scenegen.sampling.engine.run import draw
from scenegen.sampling.problem import Budget, make_problem
from scenegen.sampling.request import Range, SampleRequest

SPEC = scenegen.parse("object mug, plate, bowl\nrequire insideWorkspace()\ntask: leftOf(mug, plate)\n")


def phi(poses):
    return SPEC.robustness()(__import__("torch").from_numpy(poses.copy())).numpy()[:, 0]


@pytest.mark.parametrize("moved", [None, 1, 2])
def test_pairs_are_what_they_say(moved):
    made = scenegen.pairs(SPEC, (0.1, None), (None, -0.1), n=200, moved=moved, seed=3)
    start, goal = made.poses[:, 0], made.poses[:, 1]
    assert made.poses.shape == (200, 2, 3, 3) and len(made) == 200
    assert np.allclose(made.phi["start.task"], phi(start)) and np.allclose(made.phi["goal.task"], phi(goal))
    assert made.phi["start.task"].max() <= -0.1 and made.phi["goal.task"].min() >= 0.1
    differ = (start != goal).any(axis=2)
    assert (made.facts["moved"] == differ.sum(axis=1)).all()
    assert (differ.sum(axis=1) == (3 if moved is None else moved)).all()
    far = np.hypot(*np.moveaxis(start[..., :2] - goal[..., :2], -1, 0)).sum(axis=1)
    assert np.allclose(made.facts["distance"], far)


@pytest.mark.slow
@pytest.mark.parametrize("moved", [None, 2])
def test_pairs_do_not_depend_on_the_number_of_processes(moved):
    one, two = (scenegen.pairs(SPEC, n=300, moved=moved, seed=5, workers=workers) for workers in (1, 2))
    assert one.dump() == two.dump()
    with pytest.raises(RequestError):
        scenegen.pairs(SPEC, n=1, workers=0)


def test_by_default_a_start_is_anything_but_a_goal():
    made = scenegen.pairs(SPEC, (0.1, 0.2), n=400)
    assert ((made.phi["goal.task"] >= 0.1) & (made.phi["goal.task"] <= 0.2)).all()
    start = made.phi["start.task"]
    assert ((start < 0.1) | (start > 0.2)).all() and start.min() < -0.1 and start.max() > 0.3


def by_hand(count, rng):
    """Goals by plain rejection, one object at a uniform pose until the start is in range."""

    def table(n):
        poses = rng.random((n, 3, 3)) * [1.0, 1.0, 2 * np.pi]
        return poses[inside(poses)]

    def inside(poses):
        return requirement(poses) >= 0.0

    goals = table(20 * count)
    goals = goals[phi(goals) >= 0.1][:count]
    starts, left = goals.copy(), np.arange(count)
    for _ in range(4096):
        tried = goals[left].copy()
        who = rng.integers(3, size=len(left))
        tried[np.arange(len(left)), who] = rng.random((len(left), 3)) * [1.0, 1.0, 2 * np.pi]
        good = inside(tried) & (phi(tried) <= -0.1)
        starts[left[good]] = tried[good]
        left = left[~good]
        if not len(left):
            break
    return np.delete(np.concatenate([starts, goals], axis=1), left, axis=0)  # goals without a start


def requirement(poses):
    from scenegen.api.scenes import evaluate  # noqa: F401
    from scenegen.geometry import NUMPY
    from scenegen.lang.formula.core import REQUIRE, gated
    from scenegen.lang.formula.interpret import phi as score

    return score(gated(SPEC.checked.core), list(as_rows(poses)), NUMPY)[REQUIRE]


@pytest.mark.long
def test_moved_objects_are_uniform_given_that_the_start_is_in_range():
    count = 1500
    made = scenegen.pairs(SPEC, (0.1, None), (None, -0.1), n=count, moved=1, seed=5)
    ours = np.concatenate([made.poses[:, 0], made.poses[:, 1]], axis=1)
    truth = by_hand(count, np.random.default_rng(6))
    assert len(truth) > 0.9 * count
    rng = np.random.default_rng(0)
    assert energy_test(as_rows(truth), as_rows(ours), rng, permutations=499, most=count).p > 0.01
    wrong = ours.copy()
    wrong[:, :3] = ours[np.roll(np.arange(count), 1), :3]  # starts of other goals
    assert energy_test(as_rows(truth), as_rows(wrong), rng, permutations=499, most=count).p < 0.01


def test_the_same_arguments_give_the_same_pairs():
    one, two = (scenegen.pairs(SPEC, n=20, moved=1, seed=9).poses for _ in range(2))
    assert one.tobytes() == two.tobytes()
    assert one.tobytes() != scenegen.pairs(SPEC, n=20, moved=1, seed=10).poses.tobytes()


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_files_read_back_bit_for_bit(ending, tmp_path):
    made = scenegen.pairs(SPEC, n=7, moved=1)
    read = scenegen.read_motions(made.save(tmp_path / f"pairs.{ending}"))
    assert read.poses.tobytes() == made.poses.tobytes() and read.header == made.header
    for ours, theirs in ((made.phi, read.phi), (made.facts, read.facts)):
        assert list(ours) == list(theirs) and all((ours[name] == theirs[name]).all() for name in ours)
    scenes = scenegen.read_scenes(tmp_path / f"pairs.{ending}")  # every moment is a scene
    assert len(scenes) == 14 and (scenes.poses[1] == made.poses[0, 1]).all()
    assert (made.motion(0).poses == made.poses[0]).all() and (made.scenes(-1).poses == made.poses[:, -1]).all()


def test_csv_has_a_row_for_each_moment(tmp_path):
    made = scenegen.pairs(SPEC, n=3)
    lines = made.save(tmp_path / "pairs.csv").read_text().splitlines()
    names = lines[0].split(",")
    assert names[:5] == ["motion", "t", "mug.x", "mug.y", "mug.theta"]
    assert names[-4:] == ["phi.start.task", "phi.goal.task", "moved", "distance"]
    last = dict(zip(names, map(float, lines[-1].split(",")), strict=True))
    assert last["motion"] == 3 and last["t"] == 1.0 and last["mug.x"] == made.poses[2, 1, 0, 0]
    with pytest.raises(DataError, match="numbers alone"):
        scenegen.read_motions(tmp_path / "pairs.csv")


def test_goals_without_a_start_are_replaced_and_counted():
    """A start has the mug 60 cm right of the plate: with one move that takes a plate at 40 cm at most, or a mug at 60
    cm at least."""
    spec = scenegen.parse("object mug, plate\ntask: leftOf(mug, plate)\n")
    made = scenegen.pairs(spec, (0.1, 0.3), (None, -0.6), n=200, moved=1)
    assert len(made) == 200 and made.header.sampler["goals_without_start"] > 20
    x = made.poses[:, 1, :, 0]
    assert ((x[:, 1] <= 0.4) | (x[:, 0] >= 0.6)).all()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"moved": 0}, "`moved` is 0"),
        ({"moved": 4}, "4 objects cannot move"),
        ({"goal": (5.0, None)}, "no scene can have phi"),
        ({"n": 0}, "`n` is 0"),
        ({"goal": (None, -0.5), "start": (0.72, None), "moved": 1}, "found 0 of 16 pairs"),
    ],
)
def test_bad_requests(arguments, said):
    with pytest.raises(RequestError, match=said):
        scenegen.pairs(SPEC, **arguments)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"format": "scenegen/motions", "version": 7}', "version"),
        ('{"format": "scenegen/motions"}\n{"poses": 3}', "JSON"),
        ("[]", "not a motions file"),
    ],
)
def test_damaged_files(text, said, tmp_path):
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(DataError, match=said):
        scenegen.read_motions(tmp_path / "bad.json")


def test_goals_that_took_all_the_time_leave_no_starts(monkeypatch):
    """The time limit is then told, not an internal error."""
    goal = make_problem(SPEC.checked, SampleRequest({"task": Range(0.1)}, n=5, seed=1))
    budget = Budget()

    def slowly(problem, given):
        found = draw(problem, given)
        object.__setattr__(budget, "seconds", 0.0)
        return found

    monkeypatch.setattr(pairs, "draw", slowly)
    made = pairs.draw_pairs(goal, pairs.PairStarts(goal), None, budget)
    assert made.start.shape == made.goal.shape == (9, 0)
    assert "time is up" in str(made.shortfall)
