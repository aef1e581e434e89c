"""`scenegen sample` and `scenegen range` of specs over time."""

import json
import re
from pathlib import Path

import pytest

import scenegen as package

ROOT = Path(__file__).parents[2]
PASS = """object mug, plate at (0.5, 0.5)
time 3 steps
require speed(mug) <= 30 cm/s
task: eventually closeTo(mug, plate, 20 cm)
"""


@pytest.fixture
def passing(here):
    (here / "pass.spec").write_text(PASS)


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet", "csv"])
@pytest.mark.usefixtures("passing")
def test_motions_into_a_file(ending, scenegen, here):
    outcome = scenegen("sample", "pass.spec", "--phi", "task=0:0.1", "-n", "5", "--out", f"motions.{ending}")
    assert (outcome.status, outcome.out) == (0, "")
    found = re.fullmatch(
        rf"5 motions in motions\.{ending}: phi of task (\S+) \.\. (\S+) \(rejection; .*\)\n", outcome.err
    )
    assert 0.0 <= float(found[1]) <= float(found[2]) <= 0.1
    if ending == "csv":
        assert len((here / "motions.csv").read_text().splitlines()) == 1 + 5 * 4
        return
    made = package.read_motions(here / f"motions.{ending}")
    assert made.poses.shape == (5, 4, 2, 3)
    phi = package.load(here / "pass.spec").trace_robustness()(__import__("torch").from_numpy(made.poses.copy()))
    assert phi[:, 0].tolist() == pytest.approx(made.phi["task"].tolist(), abs=1e-12)


@pytest.mark.usefixtures("passing")
def test_motions_into_a_set(scenegen, here):
    options = ["pass.spec", "--phi", "task=0:0.1", "-n", "5", "--out"]
    assert scenegen("sample", *options, "motions.jsonl").status == 0
    outcome = scenegen("sample", *options, "set/", "--workers", "2")
    assert outcome.status == 0 and re.match(r"5 motions in set/: phi of task \S+ \.\. \S+ \(rejection; ", outcome.err)
    file, found = package.read_motions(here / "motions.jsonl"), package.read_motions("set/")
    assert file.poses.tobytes() == found.poses.tobytes() and file.header == found.header
    assert scenegen("sample", *options, "set/").err.startswith("error[finished-set]")
    assert scenegen("sample", *options, "set/", "--resume").err == outcome.err
    assert scenegen("sample", *options, "again.jsonl", "--resume").status == 0
    assert (here / "again.jsonl").read_bytes() == (here / "motions.jsonl").read_bytes()
    refused = scenegen("data", "set/")
    assert refused.status == 1 and refused.err.startswith("error[not-a-set]: set/ is not a set of scenes: its shards")


@pytest.mark.long
@pytest.mark.usefixtures("passing")
def test_motions_that_begin_settled(scenegen, here):
    from scenegen.worlds.physics.settling import settle_scenes

    for options in ("--out x.jsonl", "--out y.jsonl --resume", "--out z/"):
        outcome = scenegen("sample", "pass.spec", "--phi", "task=0:", "-n", "20", "--settle", *options.split())
        assert outcome.status == 0 and "warning[unsettled]" in outcome.err, outcome.err
    found = package.read_motions(here / "x.jsonl")
    assert (here / "x.jsonl").read_bytes() == (here / "y.jsonl").read_bytes()
    assert found.poses.tobytes() == package.read_motions(f"{here}/z/").poses.tobytes()
    assert found.header.sampler["settled"]
    spec = package.load(here / "pass.spec").declared
    assert settle_scenes(spec.shapes, found.poses[:, 0], fixed=tuple(spec.fixed), workers=1).kept.all()


@pytest.mark.usefixtures("passing")
def test_motions_to_the_output(scenegen):
    outcome = scenegen("sample", "pass.spec", "-n", "2", "--seed", "3")
    assert outcome.status == 0
    data = json.loads(outcome.out)
    assert data["time"] == {"steps": 3, "dt": 1.0} and len(data["motions"]) == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--raw", "error[not-for-motions]: --raw"),
        ("--shard-size 8", "error[only-for-sets]: --shard-size"),
        ("--shard-size 8 --out set/", "error[shard-size]: a shard cannot have 8 scenes"),
        ("--engine ray", "error[only-for-sets]: --engine"),
        ("--engine pool", "error["),
        ("--method growth", "error[unknown-choice]"),
        ("--out motions.xml", "error[unknown-ending]: motions.xml has the ending `.xml`"),
        ("--out pass.spec", "error[unknown-ending]"),
        ("--phi task=3:4", "error["),
        ("--phi tusk=0:", "error[unknown-label]"),
    ],
)
@pytest.mark.usefixtures("passing")
def test_what_motions_do_not_have(options, said, scenegen, here):
    before = sorted(here.iterdir())
    outcome = scenegen("sample", "pass.spec", "-n", "1", *options.split())
    assert outcome.status == 1 and outcome.out == "" and outcome.err.count("error[") == 1
    assert outcome.err.startswith(said)
    assert sorted(here.iterdir()) == before


@pytest.mark.long
@pytest.mark.usefixtures("passing")
def test_the_range_of_motions(scenegen, here, monkeypatch):
    monkeypatch.setattr("scenegen.sampling.motions.rarity.WORK", 30_000_000)
    outcome = scenegen("range", "pass.spec", "--png", "rarity.png")
    assert outcome.status == 0 and (here / "rarity.png").stat().st_size > 1000
    assert "what the spec requires is met by" in outcome.out and "of motions (log10 P =" in outcome.out
    assert "scenegen sample pass.spec --phi task=" in outcome.out and " scenes" not in outcome.out
    data = json.loads(scenegen("range", "pass.spec", "--json").out)
    low, high = data["labels"]["task"]["bounds"]
    assert low < data["labels"]["task"]["reached"][0] and high >= data["labels"]["task"]["reached"][1] > 0.19


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PASS.replace("require speed(mug) <= 30 cm/s", ""), "error[no-bound-on-steps]"),
        (PASS.replace("mug, plate", "mug at (0.1, 0.1), plate", 1), "error[no-free-object]"),
        (PASS.replace("<= 30 cm/s", "<= 30 cm/s & rightOf(mug, (1.2, 0.5))"), "error[no-motion-meets]"),
    ],
)
def test_no_range(text, said, scenegen, here, monkeypatch):
    monkeypatch.setattr("scenegen.sampling.motions.rarity.WORK", 10_000_000)
    (here / "bad.spec").write_text(text)
    outcome = scenegen("range", "bad.spec")
    assert outcome.status == 1 and outcome.out == "" and outcome.err.startswith(said)


@pytest.mark.long
@pytest.mark.parametrize("path", sorted((ROOT / "examples" / "motions").glob("[!t]*.spec")), ids=lambda path: path.stem)
def test_the_examples(path, scenegen, here):
    outcome = scenegen("sample", str(path), "--phi", "task=0:", "-n", "8", "--out", "motions.jsonl")
    assert outcome.status == 0, outcome.err
    assert (package.read_motions(here / "motions.jsonl").phi["task"] >= 0.0).all()


@pytest.fixture
def motions(passing, here):
    spec = package.load(here / "pass.spec")
    found = package.sample_motions(spec, n=2)
    found.save(here / "motions.jsonl")
    found.motion(0).save(here / "scenes.json")


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ("motions.jsonl --out x.gif", "which-motion"),
        ("motions.jsonl --out x.gif --motion 3", "no-such-motion"),
        ("motions.jsonl --out x.webm --motion 1", "unknown-choice"),
        ("motions.jsonl --out x.gif --motion 1 --label tusk", "unknown-label"),
        ("motions.jsonl --out x.gif --motion 1 --depth", "out-of-place"),
        ("motions.jsonl --out x.gif --figure gif", "out-of-place"),
        ("motions.jsonl motions.jsonl --out x.gif", "out-of-place"),
        ("motions.jsonl --out figures --motion 1", "out-of-place"),
        ("motions.jsonl --out figures --figure gif --figure sheet", "out-of-place"),
        ("motions.jsonl --out figures --figure topview", "time-not-here"),
        ("scenes.json --out x.gif", "not-one-motion"),
        ("scenes.json --out figures --figure strip", "out-of-place"),
        ("scenes.json --out figures --figure tralala", "unknown-choice"),
    ],
)
@pytest.mark.usefixtures("motions")
def test_pictures_of_motions_that_cannot_be(options, code, scenegen, here):
    before = {path.name for path in here.iterdir()}
    outcome = scenegen("render", *options.split())
    assert outcome.status == 1 and outcome.err.startswith(f"error[{code}]"), outcome.err
    assert {path.name for path in here.iterdir()} == before


@pytest.mark.usefixtures("motions")
def test_phi_of_motions_over_time_as_figures(scenegen, here):
    outcome = scenegen("render", "motions.jsonl", "--out", "figures", "--figure", "phi")
    assert outcome.status == 0, outcome.err
    assert sorted(path.name for path in (here / "figures").iterdir()) == ["motion_0001_phi.png", "motion_0002_phi.png"]


@pytest.mark.long
@pytest.mark.usefixtures("motions")
def test_a_motion_as_a_gif_file(scenegen, here):
    outcome = scenegen(
        "render", "motions.jsonl", "--out", "x.gif", "--motion", "2", "--size", "96x72", "--workers", "1"
    )
    assert (outcome.status, outcome.err) == (0, "drew x.gif\n")
    with __import__("PIL.Image").Image.open(here / "x.gif") as image:
        assert (image.n_frames, image.size[0]) == (4, 96)
