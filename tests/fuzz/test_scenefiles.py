"""Hostile scene files, the first of a fixed seed; `python -m tests.fuzz` goes on with others."""

import random

import pytest

from scenegen.formats import header

from . import scenefiles
from .judge import Fault
from .scenefiles import good_file, hostile, judge_file

COUNT = 24


@pytest.fixture(scope="module")
def good():
    return good_file()


def test_read_or_refused_in_time(good, tmp_path):
    read = 0
    for number in range(COUNT):
        read += judge_file(random.Random(f"files:{number}"), good, tmp_path)
    assert 0 < read < COUNT * 0.9


def test_the_same_number_is_the_same_file(good):
    assert hostile(random.Random("7"), good) == hostile(random.Random("7"), good)


def test_it_finds_what_is_wrong(good, tmp_path, monkeypatch):
    """A reader that counts every key of an object with keys that stand twice, as ours did."""

    def slow(pairs):
        keys = [key for key, _ in pairs]
        if any(keys.count(key) > 1 for key in keys for _ in range(40)):
            raise header._Twice(keys[0])
        return dict(pairs)

    monkeypatch.setattr(header, "_unique", slow)
    monkeypatch.setattr(scenefiles, "SECONDS", 0.2)
    with pytest.raises(Fault, match="bytes took"):
        for number in range(COUNT):
            judge_file(random.Random(f"files:{number}"), good, tmp_path)
