"""`scenegen data`: a report of a set, sets made of sets, and options that do not belong to an action."""

import json

import pytest


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    import scenegen

    place = tmp_path_factory.mktemp("data") / "set"
    scenegen.sample_to(f"{place}/", scenegen.parse("task: leftOf(mug, plate)"), (0.0, 0.5), n=300, workers=1)
    return place


def test_report_and_edits(folder, scenegen, tmp_path):
    said = scenegen("data", f"{folder}/", "--json", "--verify", "--timeout", "0")
    report = json.loads(said.out)
    assert said.status == 0 and report["scenes"] == 300 and report["verified"] and report["repeated"] == 0
    assert sum(report["phi"]["task"]["counts"]) == 300 and [one["fault"] for one in report["shards"]] == [None]
    done = scenegen("data", "split", f"{folder}/", "--share", "a=0.5", "--share", "b=0.5", "--out", f"{tmp_path}/p/")
    assert done.status == 0
    done = scenegen("data", "merge", f"{tmp_path}/p/a", f"{tmp_path}/p/b", "--out", f"{tmp_path}/m/")
    assert done.status == 0 and "300 scenes in 1 shard in" in done.err
    assert "300 in 1 shard," in scenegen("data", f"{tmp_path}/m/", "--timeout", "0").out


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--share", "a=1"), "out-of-place"),
        (("--seed", "3"), "out-of-place"),
        (("--out", "new/"), "out-of-place"),
    ],
)
def test_options_of_another_action(words, code, folder, scenegen):
    done = scenegen("data", f"{folder}/", *words)
    assert done.status == 1 and f"error[{code}]" in done.err and words[0] in done.err
