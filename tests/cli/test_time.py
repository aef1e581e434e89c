"""`scenegen sample` and `scenegen range` of specs over time. Specs over time on the command line: checked and
formatted; what works on scenes refuses them with one diagnostic.
"""

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
    from tests.worlds.physics.drops import settle_scenes

    for options in ("--out x.jsonl", "--out y.jsonl --resume", "--out z/"):
        outcome = scenegen("sample", "pass.spec", "--phi", "task=0:", "-n", "20", "--settle", *options.split())
        assert outcome.status == 0 and "warning[unsettled]" in outcome.err, outcome.err
    found = package.read_motions(here / "x.jsonl")
    assert (here / "x.jsonl").read_bytes() == (here / "y.jsonl").read_bytes()
    assert found.poses.tobytes() == package.read_motions(f"{here}/z/").poses.tobytes()
    assert found.header.sampler["settled"]
    spec = package.load(here / "pass.spec").definition
    assert settle_scenes(spec.shapes, found.poses[:, 0], fixed=tuple(spec.fixed), workers=1).stays.all()


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
        ("--out pass.spec", "error[cannot-write]"),
        ("--out other.spec", "error[unknown-ending]"),
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
    monkeypatch.setattr("scenegen.sampling.motions.rarity.MOTION_WORK", 30_000_000)
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
        (PASS.replace("<= 30 cm/s", "<= 30 cm/s & rightOf(mug, (1.2, 0.5))"), "error[requirement-not-found]"),
    ],
)
def test_no_range(text, said, scenegen, here, monkeypatch):
    monkeypatch.setattr("scenegen.sampling.motions.rarity.MOTION_WORK", 10_000_000)
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
        ("motions.jsonl --out x.gif", "not-one-motion"),
        ("motions.jsonl --out x.gif --motion 3", "no-such-number"),
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


CARRY = """time [0, 10 s] every 0.5 s
moves all
object mug, plate
require speed(mug) <= 20 cm/s
task: initially leftOf(mug, plate) & finally rightOf(mug, plate)
"""


@pytest.fixture
def carry(here):
    (here / "carry.spec").write_text(CARRY)


@pytest.mark.usefixtures("carry")
def test_check_and_fmt(scenegen):
    outcome = scenegen("check", "carry.spec")
    assert (outcome.status, outcome.err) == (0, "")
    assert "  time       20 steps, 0.5 s each, 10 s in all; moves all\n" in outcome.out
    assert "  task: initially leftOf(mug, plate) & finally rightOf(mug, plate)\n" in outcome.out
    (report,) = json.loads(scenegen("check", "carry.spec", "--json").out)
    assert report["ok"] and report["time"] == {"steps": 20, "dt": 0.5, "moves": "all"}
    (low, high) = report["labels"]["task"]
    assert low == pytest.approx(-1.0) and high == pytest.approx(1.0)
    assert f"\n    phi in [{low:.4g}, {high:.4g}]\n" in outcome.out
    assert scenegen("fmt", "--check", "carry.spec").status == 0


@pytest.mark.usefixtures("carry")
def test_what_bounds_exclude(scenegen, here):
    (here / "far.spec").write_text(CARRY.replace("rightOf(mug, plate)", "rightOf(mug, (1.5, 0.5))"))
    outcome = scenegen("check", "far.spec")
    assert outcome.status == 1
    assert outcome.err.startswith("error[cannot-be-satisfied]: `task` can never be satisfied: phi is at most -0.5\n")
    assert scenegen("check", "far.spec", "--allow-unsatisfiable").status == 0


@pytest.mark.parametrize(
    "command",
    [
        "train carry.spec --out model.pt",
        "dataset carry.spec -n 3 --out set/",
    ],
)
@pytest.mark.usefixtures("carry")
def test_what_works_on_scenes(command, scenegen):
    outcome = scenegen(*command.split())
    assert outcome.status == 1 and outcome.out == ""
    assert outcome.err.count("error[") == 1 and "error[time-not-here]: carry.spec is a spec over time" in outcome.err


HEAD = "t,mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta\n"
ROWS = [(0.5 * k, 0.1 + 0.04 * k, 0.5, 0.1 * k, 0.5, 0.5, 0.0) for k in range(21)]
MOTION = HEAD + "".join(",".join(map(repr, row)) + "\n" for row in ROWS)


def lines():
    return "".join(json.dumps(dict(zip(HEAD.strip().split(","), row, strict=True))) + "\n" for row in ROWS)


@pytest.mark.usefixtures("carry")
def test_eval_of_a_trajectory(scenegen, here):
    (here / "a.csv").write_text(MOTION)
    outcome = scenegen("eval", "carry.spec", "a.csv")
    assert (outcome.status, outcome.err) == (0, "")
    table = [line.split("\t") for line in outcome.out.splitlines()]
    assert table[0] == ["label", "phi", "decided by", "moment", "t"]
    assert table[1] == ["task", "0.4", "leftOf(mug, plate)", "0", "0.0"]
    assert table[2][0] == "require" and float(table[2][1]) == pytest.approx(0.12)
    (here / "a.jsonl").write_text(lines())
    assert scenegen("eval", "carry.spec", "a.jsonl").out == outcome.out
    found = json.loads(scenegen("eval", "carry.spec", "a.csv", "--json").out)
    assert found["phi"]["task"]["phi"] == 0.4 and len(found["over_time"]["task"]) == 21
    assert found["over_time"]["require"][0] is None, "no step was made before moment 0"


@pytest.mark.usefixtures("carry")
def test_eval_of_parquet(scenegen, here):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    (here / "a.csv").write_text(MOTION)
    columns = list(zip(*ROWS, strict=True))
    pq.write_table(pa.table(dict(zip(HEAD.strip().split(","), map(list, columns), strict=True))), here / "a.parquet")
    assert scenegen("eval", "carry.spec", "a.parquet").out == scenegen("eval", "carry.spec", "a.csv").out


@pytest.mark.usefixtures("carry")
def test_eval_between_the_rows(scenegen, here):
    """Headings go the shorter way round; where poses are straight lines, nothing changes."""
    some = [row for k, row in enumerate(ROWS) if k not in (3, 7, 8)]
    (here / "some.csv").write_text(HEAD + "".join(",".join(map(repr, row)) + "\n" for row in some))
    refused = scenegen("eval", "carry.spec", "some.csv")
    assert refused.status == 1 and "error[trajectory-times]" in refused.err and "--resample" in refused.err
    outcome = scenegen("eval", "carry.spec", "some.csv", "--resample")
    assert outcome.status == 0 and outcome.out.splitlines()[1].split("\t")[:3] == ["task", "0.4", "leftOf(mug, plate)"]


@pytest.mark.usefixtures("carry")
def test_options_of_the_other_kind(scenegen, here):
    (here / "a.csv").write_text(MOTION)
    for words in (["carry.spec", "a.csv", "--explain", "--scene", "1"], ["good.spec", "a.csv", "--resample"]):
        outcome = scenegen("eval", *words)
        assert outcome.status == 1 and "error[out-of-place]" in outcome.err


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet", "csv"])
def test_eval_of_sampled_motions(ending, scenegen, here):
    """What `sample` wrote has the phi that it says, in every format."""
    (here / "pass.spec").write_text(PASS)
    drawn = scenegen("sample", "pass.spec", "--phi", "task=0:", "-n", "3", "--out", f"motions.{ending}")
    assert drawn.status == 0
    scenegen("sample", "pass.spec", "--phi", "task=0:", "-n", "3", "--out", "same.json")
    stored = package.read_motions(here / "same.json").phi["task"]
    outcome = scenegen("eval", "pass.spec", f"motions.{ending}")
    assert outcome.status == 0
    table = [line.split("\t") for line in outcome.out.splitlines()]
    assert table[0] == ["motion", "label", "phi", "decided by", "moment", "t"]
    tasks = {row[0]: float(row[2]) for row in table if row[1] == "task"}
    assert list(tasks) == ["1", "2", "3"] and list(tasks.values()) == pytest.approx(stored.tolist(), abs=1e-12)
    assert ("columns that the spec does not need" in outcome.err) == (ending == "csv")
    one = json.loads(scenegen("eval", "pass.spec", f"motions.{ending}", "--motion", "2", "--json").out)
    (found,) = one["motions"]
    assert found["motion"] == 2 and found["phi"]["task"]["phi"] == tasks["2"] and len(found["over_time"]["task"]) == 4


@pytest.mark.usefixtures("carry")
def test_phi_over_time_as_a_figure(scenegen, here):
    (here / "a.csv").write_text(MOTION)
    outcome = scenegen("eval", "carry.spec", "a.csv", "--figure", "phi.png")
    assert (outcome.status, outcome.err) == (0, "phi over time in phi.png\n")
    assert (here / "phi.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("rows", "options", "said"),
    [
        ("1", "--motion 3", "error[no-such-number]: there is no motion 3"),
        ("12", "--figure phi.png", "error[out-of-place]: --figure draws one motion, and a.csv has 2"),
        ("12", "--motion 2 --figure phi.jpg", "error[wrong-ending]"),
        ("121", "", "error[not-a-trajectory]: a.csv is not a trajectory: rows of one motion are not together"),
        ("1.5", "", "error[not-a-trajectory]: a.csv is not a trajectory: the column `motion` has values that are not"),
        ("1x", "", "error[table-cell]"),
    ],
)
@pytest.mark.usefixtures("carry")
def test_bad_motions(rows, options, said, scenegen, here):
    numbers = [rows] if rows in ("1.5", "1x") else list(rows)
    body = [f"{number},{line}" for number in numbers for line in MOTION.splitlines()[1:]]
    (here / "a.csv").write_text("\n".join([f"motion,{HEAD.strip()}", *body]) + "\n")
    outcome = scenegen("eval", "carry.spec", "a.csv", *options.split())
    assert outcome.status == 1 and outcome.out == "" and outcome.err.startswith(said), outcome.err
    assert not (here / "phi.png").exists()


def test_a_motion_of_another_spec(scenegen, here):
    (here / "pass.spec").write_text(PASS)
    (here / "longer.spec").write_text(PASS.replace("3 steps", "4 steps"))
    (here / "other.spec").write_text(PASS.replace("mug", "cup"))
    assert scenegen("sample", "pass.spec", "-n", "1", "--out", "motions.jsonl").status == 0
    for spec, said in (("longer", "error[trajectory-times]"), ("other", "error[table-column]")):
        outcome = scenegen("eval", f"{spec}.spec", "motions.jsonl")
        assert outcome.status == 1 and outcome.err.startswith(said), outcome.err


TABLES = {
    "text": ("cam", "front"),
    "no number": ("note", "NaN"),
    "an empty cell": ("grip.x", ""),
    "a comma at the end": ("", ""),
}


@pytest.mark.parametrize("what", TABLES)
@pytest.mark.usefixtures("carry")
def test_columns_that_nobody_needs_may_hold_anything(what, scenegen, here):
    head, cell = TABLES[what]
    (here / "a.csv").write_text(MOTION)
    wanted = scenegen("eval", "carry.spec", "a.csv").out
    lines = [f"{line},{cell if k else head}" for k, line in enumerate(MOTION.splitlines())]
    (here / "B.CSV").write_text("\n".join(lines))
    outcome = scenegen("eval", "carry.spec", "B.CSV")
    assert (outcome.status, outcome.out) == (0, wanted), outcome.err
    assert ("columns that the spec does not need" in outcome.err) == bool(head)
    (here / "rows.csv").write_text("".join(f"{line}{',' * (k > 0)}\n" for k, line in enumerate(MOTION.splitlines())))
    assert scenegen("eval", "carry.spec", "rows.csv").out == wanted
    (here / "a.csv").write_text(MOTION.replace("0.5,0.5,0.0\n", "0.5,,0.0\n", 1))
    refused = scenegen("eval", "carry.spec", "a.csv")
    assert refused.status == 1 and "error[table-cell]: a.csv: `plate.y` in row 1 is ``" in refused.err


@pytest.mark.usefixtures("carry")
def test_text_beside_numbers_in_parquet_and_json_lines(scenegen, here):
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    (here / "a.csv").write_text(MOTION)
    wanted = scenegen("eval", "carry.spec", "a.csv").out
    columns = dict(zip(HEAD.strip().split(","), map(list, zip(*ROWS, strict=True)), strict=True))
    pq.write_table(pa.table({"cam": ["front"] * 21, **columns, "hole": pa.nulls(21)}), here / "a.PARQUET")
    assert scenegen("eval", "carry.spec", "a.PARQUET").out == wanted
    (here / "a.JSONL").write_text("".join(f'{line[:-1]}, "note": [1, "x"]}}\n' for line in lines().splitlines()))
    assert scenegen("eval", "carry.spec", "a.JSONL").out == wanted


@pytest.mark.parametrize("first", [0.25, 1.7e9])
@pytest.mark.usefixtures("carry")
def test_times_may_begin_anywhere(first, scenegen, here):
    (here / "a.csv").write_text(MOTION)
    wanted = scenegen("eval", "carry.spec", "a.csv").out
    later = [(row[0] + first, *row[1:]) for row in ROWS]
    (here / "later.csv").write_text(HEAD + "".join(",".join(map(repr, row)) + "\n" for row in later))
    for options in ([], ["--resample"]):
        outcome = scenegen("eval", "carry.spec", "later.csv", *options)
        assert outcome.status == 0 and f"its first row, at {first:.12g} s, counts as the moment 0" in outcome.err
        assert [line.split("\t")[0] for line in outcome.out.splitlines()] == ["label", "task", "require"]
        phi = [float(line.split("\t")[1]) for line in outcome.out.splitlines()[1:]]
        assert phi == pytest.approx([float(line.split("\t")[1]) for line in wanted.splitlines()[1:]], abs=1e-6)
