"""`scenegen dataset`: equal shares, how rare each scene is, shards that come back from their seeds."""

import json
import shutil

import numpy as np
import polars
import pytest
import yaml

GOOD = "object mug, plate\ntask: leftOf(mug, plate)\n"
NEAR = "object mug, plate\nrequire noOverlap()\ntask: closeTo(mug, plate, 30 cm)\nsafe: farFrom(mug, plate, 5 cm)\n"


WORDS = ("dataset", "good.spec", "bad.spec", "near.spec", "-n", "900", "--license", "mit", "--out", "data/")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A data set, made once; from few chains, so the rarities are rough, and cheap."""
    from scenegen.api.dataset import make_dataset

    folder = tmp_path_factory.mktemp("dataset")
    for name, text in (("good", GOOD), ("bad", "leftof(mug"), ("near", NEAR)):
        (folder / f"{name}.spec").write_text(text)
    failed = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenegen.sampling.rarity.WORK", 4_000_000)
        make_dataset(
            f"{folder}/data", [(name, folder / f"{name}.spec") for name in ("good", "bad", "near")], 900,
            license="mit", workers=1, told=lambda what, ended, *_: failed.extend([ended.name] if ended.errors else []),
        )  # fmt: skip
    assert failed == ["bad"]
    return folder


@pytest.fixture
def made(whole, here):
    """A copy of it in the working directory."""
    shutil.copytree(whole, here, dirs_exist_ok=True)
    return here


def table(folder):
    return polars.read_parquet(f"{folder}/part-*.parquet")


@pytest.mark.long
def test_shares_rarity_and_cards(made, here, scenegen):
    done = scenegen(*WORDS, "--workers", "1", "--resume")  # nothing is left to be done
    assert done.status == 1 and "bad failed:\n" in done.err and "600 scenes of 2 specs in data/" in done.err
    assert "near: left out: safe: no scene with phi < 0 was found" in done.err
    good = table("data/good")
    assert good.height == 300 and (good["phi.task"] >= 0).sum() == 150
    near = json.loads((here / "data/near/manifest.json").read_text())
    assert [(*shard["made"]["phi"], shard["scenes"]) for shard in near["shards"]] == [
        ("task", 100), ("task", 100), ("safe", 100)
    ]  # fmt: skip
    assert near["complete"] and near["missing"] == ["safe: no scene with phi < 0 was found"]
    seeds = [shard["made"]["seed"] for shard in near["shards"]]
    assert len(set(seeds)) == 3 and max(seeds) < 2**53
    assert list(table("data/near").columns[-4:]) == ["phi.task", "phi.safe", "log10p.task", "log10p.safe"]
    front = yaml.safe_load((here / "data/README.md").read_text().split("---")[1])
    assert front["license"] == "mit" and [one["config_name"] for one in front["configs"]] == ["good", "near"]
    card = (here / "data/near/README.md").read_text()
    assert yaml.safe_load(card.split("---")[1])["license"] == "mit" and NEAR.rstrip() in card
    assert "* bad: nothing was made" in (here / "data/README.md").read_text()


@pytest.mark.long
def test_how_rare_is_what_counting_says(made):
    """mug.x and plate.x are uniform: P(plate.x - mug.x >= t) = (1 - t)^2 / 2, and the same on the other side."""
    good = table("data/good")
    exact = np.log10((1.0 - np.abs(good["phi.task"].to_numpy())) ** 2 / 2.0)
    off = good["log10p.task"].to_numpy() - exact
    assert np.abs(off[exact > -3.0]).max() < 0.35 and abs(np.median(off)) < 0.1


def test_a_shard_comes_back(made, here, scenegen):
    file = here / "data/near/part-000001.parquet"
    before = file.read_bytes()
    assert "the same bytes as there" in scenegen("data", "remake", "data/near", "--shard", "1").err
    file.write_bytes(before[:-1] + b"x")
    assert scenegen("data", "data/near/", "--verify", "--timeout", "0").status == 1
    assert "put back" in scenegen("data", "remake", "data/near", "--shard", "1").err
    assert file.read_bytes() == before
    said = scenegen("data", "data/near/", "--verify", "--json", "--timeout", "0")
    assert said.status == 0 and json.loads(said.out)["verified"]
    assert "--shard is 3" in scenegen("data", "remake", "data/near", "--shard", "3").err
    # parts of it keep how rare their scenes are
    assert scenegen("data", "split", "data/near/", "--share", "a=0.5", "--out", "parts/").status == 0
    assert "log10p.task" in table("parts/a").columns


@pytest.mark.long
def test_resumed_with_two_workers(made, here, scenegen, snapshot):
    """What is missing is made, to the same bytes, whoever makes it; what is there stays."""
    before = snapshot(here / "data")
    manifest = here / "data/near/manifest.json"
    facts = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(facts | {"complete": False, "shards": facts["shards"][1:2]}))
    assert "error[finished-set]" in scenegen(*WORDS).err
    assert scenegen(*WORDS, "--workers", "2", "--resume").status == 1
    assert snapshot(here / "data") == before
