"""`sample --satisfied` and `--violated`: short for the ranges that are asked for most."""

import json

import pytest

FLAGS = {
    "--satisfied": {"task": (0.0, None), "safe": (0.0, None)},
    "--violated": {"task": (None, 0.0), "safe": (None, 0.0)},
    "--satisfied --phi task=-0.2:0": {"task": (-0.2, 0.0), "safe": (0.0, None)},
    "--violated --phi safe=0:": {"task": (None, 0.0), "safe": (0.0, None)},
}


@pytest.mark.parametrize(("words", "wanted"), FLAGS.items())
def test_every_label_that_is_not_named(scenegen, here, words, wanted):
    outcome = scenegen("sample", "two.spec", *words.split(), "-n", "8", "--out", "s.json")
    assert outcome.status == 0
    data = json.loads((here / "s.json").read_text())
    assert data["request"]["phi"] == {name: list(ends) for name, ends in wanted.items()}
    for scene in data["scenes"]:
        for name, (low, high) in wanted.items():
            assert (low is None or scene["phi"][name] >= low) and (high is None or scene["phi"][name] <= high)


def test_short_for_phi(scenegen, here):
    for words in (["--satisfied"], ["--phi", "task=0:"]):
        assert scenegen("sample", "good.spec", *words, "-n", "4", "--out", f"{len(words)}.json").status == 0
    assert (here / "1.json").read_bytes() == (here / "2.json").read_bytes()


def test_both_contradict(refused):
    assert "contradict each other" in refused("sample", "good.spec", "--satisfied", "--violated")
