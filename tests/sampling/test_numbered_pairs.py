"""Pairs of specs that draw how many things there are: a pair shares its number, in files and wherever they are read."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import scenegen
from scenegen.api.scenes import evaluate
from scenegen.errors import DataError, RequestError
from scenegen.worlds.planning import export_problems

ASSETS = '[asset("red", box(10 cm, 10 cm, 10 cm)), asset("blue", box(20 cm, 10 cm, 10 cm))]'
TEXT = "object block[1..3], mug\nrequire insideWorkspace()\ntask: forall b in block: leftOf(b, mug)\n"
SPEC = scenegen.parse(TEXT)


@pytest.fixture(scope="module")
def made():
    return scenegen.pairs(SPEC, (0.05, None), (None, -0.05), n=32, moved=2, seed=4)


def test_a_pair_is_one_of_the_spec_with_its_number(made):
    assert sorted(np.bincount(made.counts["block"])[1:].tolist()) == [10, 11, 11]
    assert made.present.sum(axis=1).tolist() == (made.counts["block"] + 1).tolist()
    assert (np.isnan(made.poses).any(axis=(1, 3)) == ~made.present).all()
    assert (made.facts["moved"] == 2).all()
    for end, moment in (("start", 0), ("goal", -1)):
        for numbers, mine in made.scenes(moment).parts():
            member = SPEC.with_counts(numbers)
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
        SPEC.with_counts({"block": 2}), (0.05, None), (None, -0.05), n=len(mine), moved=2, seed=seed_of(4, {"block": 2})
    )
    assert np.array_equal(np.sort(mine.reshape(len(mine), -1), axis=0), np.sort(alone.poses.reshape(len(mine), -1), 0))
    assert not np.array_equal(mine, alone.poses), "their order is drawn"


def test_fewer_pairs_than_numbers_are_of_numbers_drawn_by_the_seed():
    drawn = [scenegen.pairs(SPEC, n=2, seed=seed).counts["block"].tolist() for seed in range(4)]
    assert all(one != two for one, two in drawn)
    assert {number for pair in drawn for number in pair} == {1, 2, 3}


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_files_read_back_bit_for_bit(made, ending, tmp_path):
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
    made = scenegen.pairs(SPEC, n=8, moved=3)
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
        scenegen.pairs(SPEC, **arguments)
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
