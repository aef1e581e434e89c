"""`scenegen arm`: its file is read as an arm, and each bad input gets one diagnostic."""

import pytest

from scenegen.things import reach
from scenegen.things.arms import read_arm
from tests.things.test_reach import planar


@pytest.fixture
def robot(here):
    (here / "arm.urdf").write_bytes(planar())
    return here


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["missing.urdf", "--tip", "l6"], "cannot read missing.urdf: no such file"),
        (["arm.urdf", "--tip", "hand"], "arm.urdf has no arm to measure: it has no link `hand`"),
        (["arm.urdf", "--tip", "l4"], "help: name that direction of the tip link as the approach"),
        (["arm.urdf", "--tip", "l6", "--base", "l1"], "`shoulder`, does not turn about the vertical"),
        (["arm.urdf", "--tip", "l6", "--approach", "down"], "--approach is no axis: down"),
        (["arm.urdf", "--tip", "l6", "--opening", "8 feet"], "--opening needs a length from 0.001 to 10 m, not 8 feet"),
        (["arm.urdf", "--tip", "l6", "--palm", "8cm"], "--palm needs 3 lengths with commas between"),
        (["arm.urdf", "--tip", "l6", "--tool", "nan"], "--tool needs a length from 0 to 10 m"),
        (["good.spec", "--tip", "l6"], "good.spec has no arm to measure: it is not well-formed XML at line 1"),
    ],
)
def test_bad_input(robot, refused, words, message):
    assert message in refused("arm", *words, "--out", "a.toml")


def test_its_file_ends_in_toml(robot, refused):
    assert "a.json does not end in .toml" in refused("arm", "arm.urdf", "--tip", "l6", "--out", "a.json")


@pytest.mark.long
def test_a_file_is_written(robot, scenegen, monkeypatch):
    for name, value in {"LEVELS": 8, "RADII": 30, "RANDOM_POSTURES": 2_000, "BATCH": 2_000, "BISECTIONS": 1}.items():
        monkeypatch.setattr(reach, name, value)
    outcome = scenegen(
        "arm", "arm.urdf", "--tip", "l6", "--out", "mine.toml", "--opening", "70mm", "--palm", "9cm,7cm,0.1"
    )
    assert (outcome.status, outcome.out) == (0, "") and "wrote mine.toml" in outcome.err
    arm = read_arm((robot / "mine.toml").read_bytes())
    assert (arm.name, arm.hand.opening, arm.hand.palm) == ("mine", 0.07, (0.09, 0.07, 0.1))
    assert arm.ring.turns_freely and max(arm.ring.farthest) == pytest.approx(0.55, abs=0.02)
