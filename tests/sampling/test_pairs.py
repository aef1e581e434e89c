"""Pairs of a start and a goal: in range, as many objects moved as asked for, and distributed as said. Pairs of specs
that draw how many things there are: a pair shares its number, in files and wherever they are read.
"""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import scenegen
from experiments.metrics import energy_test
from scenegen.api.scenes import evaluate
from scenegen.errors import DataError, RequestError
from scenegen.planning.conversion import export_problems
from scenegen.pose import as_rows
from scenegen.sampling import pairs
from scenegen.sampling.plans import draw
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget

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
    from scenegen.lang.formula.core import REQUIRE, gate
    from scenegen.lang.formula.interpret import phi as score

    return score(gate(SPEC.checked.core), list(as_rows(poses)), NUMPY)[REQUIRE]


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


ASSETS = '[asset("red", box(10 cm, 10 cm, 10 cm)), asset("blue", box(20 cm, 10 cm, 10 cm))]'
TEXT = "object block[1..3], mug\nrequire insideWorkspace()\ntask: forall b in block: leftOf(b, mug)\n"
SPEC_NUMBERED_PAIRS = scenegen.parse(TEXT)


@pytest.fixture(scope="module")
def made():
    return scenegen.pairs(SPEC_NUMBERED_PAIRS, (0.05, None), (None, -0.05), n=32, moved=2, seed=4)


def test_a_pair_is_one_of_the_spec_with_its_number(made):
    assert sorted(np.bincount(made.counts["block"])[1:].tolist()) == [10, 11, 11]
    assert made.present.sum(axis=1).tolist() == (made.counts["block"] + 1).tolist()
    assert (np.isnan(made.poses).any(axis=(1, 3)) == ~made.present).all()
    assert (made.facts["moved"] == 2).all()
    for end, moment in (("start", 0), ("goal", -1)):
        for numbers, mine in made.scenes(moment).parts():
            member = SPEC_NUMBERED_PAIRS.with_counts(numbers)
            found = evaluate(member.checked, made.scenes(moment).only(numbers, mine))
            assert np.array_equal(found["task"], made.phi[f"{end}.task"][mine])
        centres = made.scenes(moment).poses[..., :2]
        assert np.nanmin(centres) > 0.0 and np.nanmax(centres) < 1.0, "what the spec requires holds"
    assert made.phi["start.task"].max() <= -0.05 and made.phi["goal.task"].min() >= 0.05


def test_given_the_number_pairs_are_those_of_the_ordinary_spec(made):
    """The same code with the member's own seed: so no more than shares and order is new."""
    from scenegen.sampling.families import seed_of

    mine = made.poses[made.counts["block"] == 2][:, :, [0, 1, 3]]
    alone = scenegen.pairs(
        SPEC_NUMBERED_PAIRS.with_counts({"block": 2}),
        (0.05, None),
        (None, -0.05),
        n=len(mine),
        moved=2,
        seed=seed_of(4, {"block": 2}),
    )
    assert np.array_equal(np.sort(mine.reshape(len(mine), -1), axis=0), np.sort(alone.poses.reshape(len(mine), -1), 0))
    assert not np.array_equal(mine, alone.poses), "their order is drawn"


def test_fewer_pairs_than_numbers_are_of_numbers_drawn_by_the_seed():
    drawn = [scenegen.pairs(SPEC_NUMBERED_PAIRS, n=2, seed=seed).counts["block"].tolist() for seed in range(4)]
    assert all(one != two for one, two in drawn)
    assert {number for pair in drawn for number in pair} == {1, 2, 3}


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_files_read_back_bit_for_bit_numbered_pairs(made, ending, tmp_path):
    path = made.save(tmp_path / f"pairs.{ending}")
    read = scenegen.read_motions(path)
    assert read.poses.tobytes() == made.poses.tobytes() and read.header == made.header
    assert read.counts["block"].tolist() == made.counts["block"].tolist()
    assert all((made.phi[name] == read.phi[name]).all() for name in made.phi)
    assert path.read_bytes() == read.save(tmp_path / f"again.{ending}").read_bytes()
    scenes = scenegen.read_scenes(path)  # every moment is a scene
    assert scenes.counts["block"].tolist() == np.repeat(made.counts["block"], 2).tolist()


def test_files_say_how_many_there_are(made, tmp_path):
    data = json.loads(made.dump())
    assert data["counts"] == [{"name": "block", "least": 1, "most": 3}]
    for one in data["motions"]:
        blocks = [name for name in one["poses"] if name.startswith("block")]
        assert blocks == [f"block[{k}]" for k in range(1, one["counts"]["block"] + 1)]
    told = {one["numbers"]["block"]: one["pairs"] for one in data["sampler"]["numbers"]}
    assert told == {number: int((made.counts["block"] == number).sum()) for number in (1, 2, 3)}
    table = pq.read_table(made.save(tmp_path / "pairs.parquet"))
    assert table["count.block"].to_pylist() == np.repeat(made.counts["block"], 2).tolist()
    assert table["block[3].x"].null_count == 2 * int((made.counts["block"] < 3).sum()) > 0
    names, first = (line.split(",") for line in made.save(tmp_path / "pairs.csv").read_text().splitlines()[:2])
    row = dict(zip(names, first, strict=True))
    assert row["count.block"] == str(made.counts["block"][0])
    assert [name for name in names if not row[name]] == [
        f"block[{k}].{axis}" for k in range(made.counts["block"][0] + 1, 4) for axis in ("x", "y", "theta")
    ]


def test_a_file_whose_numbers_are_not_those_of_its_poses_is_damaged(made, tmp_path):
    data = json.loads(made.dump())
    data["motions"][0]["counts"]["block"] = int(made.counts["block"][0]) % 3 + 1
    (tmp_path / "a.json").write_text(json.dumps(data))
    data["motions"][0].pop("counts")
    (tmp_path / "b.json").write_text(json.dumps(data))
    table = pq.read_table(made.save(tmp_path / "c.parquet"))
    place = table.column_names.index("count.block")
    pq.write_table(table.set_column(place, table.schema.field(place), [[3] * table.num_rows]), tmp_path / "c.parquet")
    for name in ("a.json", "b.json", "c.parquet"):
        with pytest.raises(DataError, match="damaged"):
            scenegen.read_motions(tmp_path / name)


def test_numbers_without_pairs_are_left_out():
    spec = scenegen.parse("object block[2..4], mug\ntask: x(mug) >= block.count * 0.3\n")
    made = scenegen.pairs(spec, n=8)
    assert sorted(made.counts["block"].tolist()) == [2] * 4 + [3] * 4
    assert [(one.code, one.facts["counted"]) for one in made.warnings] == [("number-left-out", "block[4]")]
    assert [one["numbers"] for one in made.header.sampler["left_out"]] == [{"block": 4}]
    made = scenegen.pairs(SPEC_NUMBERED_PAIRS, n=8, moved=3)
    assert set(made.counts["block"]) == {2, 3} and "3 objects cannot move" in made.warnings[0].title


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ({"moved": 9}, "no-number-possible"),
        ({"goal": (5.0, None)}, "no-number-possible"),
        ({"goal": {"nothing": (0.0, None)}}, "unknown-label"),
        ({"n": 0}, "out-of-range"),
        ({"seed": -1}, "out-of-range"),
    ],
)
def test_bad_requests_are_one_diagnostic(arguments, code):
    with pytest.raises(RequestError) as raised:
        scenegen.pairs(SPEC_NUMBERED_PAIRS, **arguments)
    assert [one.code for one in raised.value.diagnostics] == [code]


def test_a_pair_has_one_asset():
    spec = scenegen.parse(f'object mug of category("mug", {ASSETS}), plate\ntask: leftOf(mug, plate)\n')
    made = scenegen.pairs(spec, n=6)
    assert sorted(made.counts["mug"].tolist()) == [1, 1, 1, 2, 2, 2]
    assert (made.present.sum(axis=1) == 2).all()
    told = [one["assets"] for one in made.header.sampler["numbers"]]
    assert told == [{"mug": "red"}, {"mug": "blue"}]


def test_problems_of_planners_have_the_things_that_are_there(made, tmp_path):
    export_problems(made, tmp_path, facts=["leftOf"])
    for number, many in enumerate(made.counts["block"], start=1):
        text = (tmp_path / f"scene_{number:04d}.pddl").read_text()
        assert text.count("- block ;") == many
        goal = text.partition("(:goal")[2]
        assert all(f"(leftOf block_{k} mug)" in goal for k in range(1, many + 1))


def test_charts_are_of_the_things_that_are_there(made, tmp_path):
    few = scenegen.MotionSet(
        made.poses[:3], *({k: v[:3] for k, v in one.items()} for one in (made.phi, made.facts)), made.header
    )
    assert len(few.figures(tmp_path, "phi")) == 3
