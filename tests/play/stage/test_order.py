"""Orders of episodes: things move little, pairs are drawn by lot, and a run takes them as they are."""

import numpy as np
import pytest

from scenegen.errors import DataError
from scenegen.play.stage.order import key_of, order_starts, read_order, travel_of, write_order


@pytest.fixture(scope="module")
def ordered(suite):
    return order_starts(suite, [suite[number] for number in range(200)])


def test_things_move_little_from_one_to_the_next(suite, ordered):
    stored = [suite[number] for number in range(200)]
    assert sorted(one.number for one in ordered) == list(range(200)) and ordered[0].number == 0
    assert travel_of(suite, ordered) <= 0.55 * travel_of(suite, stored)


def test_within_one_task_too(suite):
    starts = [one for one in suite if one.task.name == "order"][:100]
    assert travel_of(suite, order_starts(suite, starts)) <= 0.55 * travel_of(suite, starts)


def test_travel_of_two_starts_of_a_task(suite):
    one, other = [start for start in suite if start.task.name == "beside"][:2]
    poses = [start.task.scenes.poses[start.row, :, :2] for start in (one, other)]
    assert travel_of(suite, [one, other]) == pytest.approx(np.hypot(*(poses[0] - poses[1]).T).sum())


def test_pairs_are_back_to_back_and_drawn_by_lot(suite, ordered, tmp_path):
    trials, letters = write_order(suite, ordered, True)
    rows = [line.split(",") for line in trials.decode().splitlines()[1:]]
    key = [line.split(",")[1] for line in letters.decode().splitlines()[1:]]
    assert len(rows) == len(key) == 400 and all(a[1] == b[1] for a, b in zip(rows[::2], rows[1::2], strict=True))
    assert all({a, b} == {"A", "B"} for a, b in zip(key[::2], key[1::2], strict=True))
    assert 70 < key[::2].count("A") < 130 and b"A" not in trials.splitlines()[1][:4]
    path = tmp_path / "o.csv"
    path.write_bytes(trials)
    assert list(read_order(path, suite, range(100)).trials) == [one.number for one in ordered if one.number < 100]
    key_of(path).write_bytes(letters)
    of = {letter: read_order(path, suite, range(2500), letter) for letter in "AB"}
    for number, (a, b) in {number: (of["A"].trials[number], of["B"].trials[number]) for number in range(200)}.items():
        assert abs(a - b) == 1 and {rows[a - 1][1], rows[b - 1][1]} == {str(number)}
        assert (key[a - 1], key[b - 1]) == ("A", "B")
    assert of["A"].digest == of["B"].digest and list(of["A"].trials) == [one.number for one in ordered]


def test_an_order_of_another_suite(suite, tmp_path):
    path = tmp_path / "o.csv"
    path.write_text("trial,episode\n1,2500\n")
    with pytest.raises(DataError) as caught:
        read_order(path, suite, range(2500))
    assert caught.value.diagnostics[0].kind.code == "not-a-suite"


@pytest.mark.parametrize("key", ["trial,policy\n1,A\n", "trial,policy\n1,A\n2,C\n", "trial,letter\n1,A\n2,B\n"])
def test_a_key_of_another_order(suite, tmp_path, key):
    path = tmp_path / "o.csv"
    path.write_text("trial,episode\n1,7\n2,7\n")
    key_of(path).write_text(key)
    with pytest.raises(DataError, match="letters of 2 trials"):
        read_order(path, suite, range(2500), "A")
