"""Specs over time on the command line: checked and formatted; what works on scenes refuses them with one diagnostic."""

import json

import pytest

CARRY = """time [0, 10 s] every 0.5 s
moves all
object mug, plate
require speed(mug) <= 20 cm/s
task: initially leftOf(mug, plate) & finally rightOf(mug, plate)
"""


@pytest.fixture
def carry(here):
    (here / "carry.spec").write_text(CARRY)


@pytest.mark.usefixtures("carry")
def test_check_and_fmt(scenegen):
    outcome = scenegen("check", "carry.spec")
    assert (outcome.status, outcome.err) == (0, "")
    assert "  time       20 steps, 0.5 s each, 10 s in all; moves all\n" in outcome.out
    assert "  task: initially leftOf(mug, plate) & finally rightOf(mug, plate)\n" in outcome.out
    (report,) = json.loads(scenegen("check", "carry.spec", "--json").out)
    assert report["ok"] and report["time"] == {"steps": 20, "dt": 0.5, "moves": "all"}
    (low, high) = report["labels"]["task"]
    assert low == pytest.approx(-1.0) and high == pytest.approx(1.0)
    assert f"\n    phi in [{low:.4g}, {high:.4g}]\n" in outcome.out
    assert scenegen("fmt", "--check", "carry.spec").status == 0


@pytest.mark.usefixtures("carry")
def test_what_bounds_exclude(scenegen, here):
    (here / "far.spec").write_text(CARRY.replace("rightOf(mug, plate)", "rightOf(mug, (1.5, 0.5))"))
    outcome = scenegen("check", "far.spec")
    assert outcome.status == 1
    assert outcome.err.startswith("error[cannot-be-satisfied]: `task` can never be satisfied: phi is at most -0.5\n")
    assert scenegen("check", "far.spec", "--allow-unsatisfiable").status == 0


@pytest.mark.parametrize(
    "command",
    [
        "train carry.spec --out model.pt",
        "dataset carry.spec -n 3 --out set/",
    ],
)
@pytest.mark.usefixtures("carry")
def test_what_works_on_scenes(command, scenegen):
    outcome = scenegen(*command.split())
    assert outcome.status == 1 and outcome.out == ""
    assert outcome.err.count("error[") == 1 and "error[time-not-here]: carry.spec is a spec over time" in outcome.err


HEAD = "t,mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta\n"
ROWS = [(0.5 * k, 0.1 + 0.04 * k, 0.5, 0.1 * k, 0.5, 0.5, 0.0) for k in range(21)]
MOTION = HEAD + "".join(",".join(map(repr, row)) + "\n" for row in ROWS)


def lines():
    return "".join(json.dumps(dict(zip(HEAD.strip().split(","), row, strict=True))) + "\n" for row in ROWS)


@pytest.mark.usefixtures("carry")
def test_eval_of_a_trajectory(scenegen, here):
    (here / "a.csv").write_text(MOTION)
    outcome = scenegen("eval", "carry.spec", "a.csv")
    assert (outcome.status, outcome.err) == (0, "")
    table = [line.split("\t") for line in outcome.out.splitlines()]
    assert table[0] == ["label", "phi", "decided by", "moment", "t"]
    assert table[1] == ["task", "0.4", "leftOf(mug, plate)", "0", "0.0"]
    assert table[2][0] == "require" and float(table[2][1]) == pytest.approx(0.12)
    (here / "a.jsonl").write_text(lines())
    assert scenegen("eval", "carry.spec", "a.jsonl").out == outcome.out
    found = json.loads(scenegen("eval", "carry.spec", "a.csv", "--json").out)
    assert found["phi"]["task"]["phi"] == 0.4 and len(found["over_time"]["task"]) == 21
    assert found["over_time"]["require"][0] is None, "no step was made before moment 0"


@pytest.mark.usefixtures("carry")
def test_eval_of_parquet(scenegen, here):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    (here / "a.csv").write_text(MOTION)
    columns = list(zip(*ROWS, strict=True))
    pq.write_table(pa.table(dict(zip(HEAD.strip().split(","), map(list, columns), strict=True))), here / "a.parquet")
    assert scenegen("eval", "carry.spec", "a.parquet").out == scenegen("eval", "carry.spec", "a.csv").out


@pytest.mark.usefixtures("carry")
def test_eval_between_the_rows(scenegen, here):
    """Headings go the shorter way round; where poses are straight lines, nothing changes."""
    some = [row for k, row in enumerate(ROWS) if k not in (3, 7, 8)]
    (here / "some.csv").write_text(HEAD + "".join(",".join(map(repr, row)) + "\n" for row in some))
    refused = scenegen("eval", "carry.spec", "some.csv")
    assert refused.status == 1 and "error[trajectory-times]" in refused.err and "--resample" in refused.err
    outcome = scenegen("eval", "carry.spec", "some.csv", "--resample")
    assert outcome.status == 0 and outcome.out.splitlines()[1].split("\t")[:3] == ["task", "0.4", "leftOf(mug, plate)"]


@pytest.mark.usefixtures("carry")
def test_options_of_the_other_kind(scenegen, here):
    (here / "a.csv").write_text(MOTION)
    for words in (["carry.spec", "a.csv", "--explain", "--scene", "1"], ["good.spec", "a.csv", "--resample"]):
        outcome = scenegen("eval", *words)
        assert outcome.status == 1 and "error[out-of-place]" in outcome.err
