"""Several inputs of one command: a job each, the bad ones named, the bytes those of one at a time."""

import pytest


@pytest.fixture
def scenes(here, scenegen):
    (here / "bad.json").write_text("{")
    for name in ("good", "forks"):
        assert scenegen("sample", f"{name}.spec", "-n", "2", "--out", f"{name}.json", "-q").status == 0
    return "good.json", "bad.json", "forks.json"


def named(done, name):
    """The command named one failure, did the rest, and ended with status 1."""
    assert done.status == 1 and f"{name} failed:\n" in done.err, done.err
    assert f"error[some-failed]: `{name}` failed" in done.err or f"{name} failed; the others" in done.err


@pytest.mark.long
def test_settle_and_render(scenes, here, scenegen, small_pictures):
    words = ("settle", *scenes, "--in", "pybullet", "--seconds", "0.1", "--workers", "1")
    named(scenegen(*words, "--out", "rest/"), "bad")
    one = scenegen("settle", "forks.json", "--in", "pybullet", "--seconds", "0.1", "--workers", "1", "--out", "f.json")
    assert one.status == 0 and (here / "rest/forks.json").read_bytes() == (here / "f.json").read_bytes()
    assert not (here / "rest/bad.json").exists() and (here / "rest/good.json").exists()
    named(scenegen("render", *scenes, "--out", "pictures", "--workers", "1", "--view", "top"), "bad")
    drawn = sorted(str(path.relative_to(here / "pictures")) for path in (here / "pictures").rglob("*_top.png"))
    assert drawn == [f"{name}/scene_000{number}_top.png" for name in ("forks", "good") for number in (1, 2)]


@pytest.mark.long
def test_train(here, scenegen, monkeypatch):
    (here / "bad.spec").write_text("leftof(mug")
    words = ("train", "--epochs", "1", "--scenes", "64", "--no-card", "--workers", "1", "--hyper", "width=8")
    named(scenegen(*words, "good.spec", "bad.spec", "forks.spec", "--out", "models/"), "bad")
    assert scenegen(*words, "forks.spec", "--out", "alone/", "-q").status == 0
    assert (here / "models/forks.safetensors").read_bytes() == (here / "alone/forks.safetensors").read_bytes()
    monkeypatch.setattr("scenegen.learn.train.train", lambda *_, **__: pytest.fail("trained again"))
    done = scenegen(*words, "good.spec", "forks.spec", "--out", "models/", "--resume")
    assert done.status == 0 and done.err.count("complete already") == 2


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("settle", "a.json", "b.json", "--out", "one.json"), "folder-for-several"),
        (("settle", "a.json", "x/a.json", "--out", "rest/"), "same-name"),
        (("settle", "a.json", "--out", "one.json", "--engine", "ray"), "only-for-several"),
        (("render", "a.json", "--out", "p", "--address", "here"), "only-for-several"),
        (("render", "a.json", "b.json", "--out", "p", "--engine", "rai"), "unknown-engine"),
        (("train", "good.spec", "two.spec", "--out", "s3://bucket/models/"), "folder-for-several"),
    ],
)
def test_refused(words, code, here, scenegen):
    done = scenegen(*words)
    assert done.status == 1 and f"error[{code}]" in done.err and done.err.count("error[") == 1
    assert not (here / "rest").exists()
