"""Hostile scene files, the first of a fixed seed; `python -m tests.fuzz` goes on with others."""

import random
import time

import pytest

from scenegen.scenes.formats import header

from . import scenefiles
from .judge import Fault
from .scenefiles import good_file, hostile, judge_file

COUNT = 24


@pytest.fixture(scope="module")
def good():
    return good_file()


@pytest.mark.long
def test_read_or_refused_in_time(good, tmp_path):
    read = 0
    for number in range(COUNT):
        read += judge_file(random.Random(f"files:{number}"), good, tmp_path)
    assert 0 < read < COUNT * 0.9


def test_the_same_number_is_the_same_file(good):
    assert hostile(random.Random("7"), good) == hostile(random.Random("7"), good)


@pytest.mark.long
def test_it_finds_what_is_wrong(good, tmp_path, monkeypatch):
    """A reader that takes its time over keys that stand twice, as ours did: it counted every key."""

    def slow(pairs):
        if len(dict(pairs)) < len(pairs):
            until = time.process_time() + 1.0
            while time.process_time() < until:
                pass
            raise header._DuplicateKey(pairs[0][0])
        return dict(pairs)

    monkeypatch.setattr(header, "_unique", slow)
    monkeypatch.setattr(scenefiles, "SECONDS", 0.9)
    monkeypatch.setattr(scenefiles, "EACH", 0.0)
    with pytest.raises(Fault, match="bytes took"):
        for number in range(10 * COUNT):
            judge_file(random.Random(f"files:{number}"), good, tmp_path)
