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
    assert report["labels"] == {"task": [None, None]}
    assert scenegen("fmt", "--check", "carry.spec").status == 0


@pytest.mark.parametrize(
    "command",
    [
        "sample carry.spec --phi task=0: -n 1",
        "sample carry.spec -n 1 --out scenes.json",
        "sample carry.spec -n 1 --out set/",
        "range carry.spec",
        "train carry.spec --out model.pt",
        "dataset carry.spec -n 3 --out set/",
    ],
)
@pytest.mark.usefixtures("carry")
def test_what_works_on_scenes(command, scenegen):
    outcome = scenegen(*command.split())
    assert outcome.status == 1 and outcome.out == ""
    assert outcome.err.count("error[") == 1 and "error[time-not-here]: carry.spec is a spec over time" in outcome.err
