"""The first random tables of a seed, and whether faults are found: `make fuzz-tables` samples a hundred."""

import pytest

import scenegen

from . import tables_run
from .tables import FEWEST, Table, table
from .tables_run import FULL, PROOF, SCENES, SCENES_CAME, Run, run, summary

QUICK = 0, 13  # one with many boxes left by pruning, one with few
EASY = "object a[3] = cylinder(0.02, 0.05)\nrequire noOverlap()\ntask: leftOf(a[1], a[2])\n"


@pytest.mark.long
@pytest.mark.parametrize("number", QUICK)
def test_quick_tables_are_answered_with_scenes(number):
    one = run(0, number, 60.0)
    assert not one.fault, one
    assert one.kind == SCENES_CAME


def test_tables_are_valid_and_do_not_change():
    for number in range(16):
        case = table(0, number, number > 7)
        assert case == table(0, number, number > 7)
        spec = scenegen.parse(case.text)
        assert set(spec.labels) == set(case.ranges)
        assert len(spec.objects) >= FEWEST
    assert len({table(seed, 0).text for seed in range(8)}) == 8


def test_wrong_scenes_are_found(tmp_path):
    out = tmp_path / "scenes.json"
    scenegen.sample_to(out, scenegen.parse(EASY), {"task": (0.0, None)}, SCENES)
    ranges = {"task": (0.0, None)}
    assert tables_run._verify(Table(EASY, ranges), out) == ("rejection", "")
    assert "out of range" in tables_run._verify(Table(EASY, {"task": (0.5, None)}), out)[1]
    closer = EASY.replace("noOverlap()", "noOverlap() & closeTo(a[1], a[2], 1 cm)")
    assert "requires" in tables_run._verify(Table(closer, ranges), out)[1]


def test_scenes_that_were_overlooked_are_found(monkeypatch):
    monkeypatch.setattr(tables_run, "PLAIN", 0.1)
    assert "plain rejection finds" in tables_run._plain(Table(EASY, {"task": (0.0, None)}))
    assert tables_run._plain(Table(EASY, {"task": (0.999, None)})) == ""


@pytest.mark.long
def test_answers_are_told_apart(monkeypatch):
    """A proof is an answer; an error that nobody knows is a fault."""
    monkeypatch.setattr(tables_run, "PLAIN", 0.1)
    hopeless = Table(EASY + "safe: x(a[1]) >= 2\n", {"safe": (0.0, None)})
    monkeypatch.setattr(tables_run, "table", lambda *_: hopeless)
    one = run(0, 0, 60.0)
    assert (one.kind, one.fault) == (PROOF, "")
    broken = Table("object a\ntask: leftOf(a, \n", {"task": (0.0, None)})
    monkeypatch.setattr(tables_run, "table", lambda *_: broken)
    assert run(0, 0, 60.0).fault == "an unknown answer"
    lines = summary([one, Run(1, FULL, "-", 1.0, 1.0, 1, "")])
    assert "1 of 2 proof" in lines
    assert "faults: none" in lines
