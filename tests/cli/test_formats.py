"""Every format of scene files goes in and out of the commands."""

import json
from pathlib import Path

import pytest

from scenegen.scenes.formats.registry import FORMATS

WANTED = ["--phi", "0:0.2", "-n", "3", "--seed", "5"]


@pytest.mark.parametrize("ending", FORMATS)
def test_sample_and_eval(ending, scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", "all.json").status == 0
    sampled = scenegen("sample", "good.spec", *WANTED, "--out", f"x{ending}")
    assert sampled.status == 0 and "3 scenes (rejection" in sampled.err
    evaluated = scenegen("eval", "good.spec", f"x{ending}")
    assert evaluated.status == 0 and evaluated.err == ""
    assert evaluated.out == scenegen("eval", "good.spec", "all.json").out and len(evaluated.out.splitlines()) == 4


@pytest.mark.long
@pytest.mark.parametrize("ending", FORMATS)
def test_render(ending, scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", f"x{ending}").status == 0
    assert scenegen("render", f"x{ending}", "--out", "pictures", "--size", "32x24", "--workers", "1").status == 0
    assert len(list(Path("pictures").glob("scene_*_top.png"))) == 3


@pytest.mark.parametrize("ending", FORMATS)
def test_noise(ending, scenegen, here):
    Path(f"x{ending}").write_bytes(b"\x00noise\xff" * 10)
    refused = scenegen("eval", "good.spec", f"x{ending}")
    assert refused.status == 1 and refused.out == "" and refused.err.startswith("error[") and "help: " in refused.err


POSES = "mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta,cam\n0.2,0.5,0,0.6,0.5,0,front\n0.7,0.5,0,0.6,0.5,0,\n"


def test_poses_alone_go_everywhere_with_one_option(scenegen, here):
    (here / "w.spec").write_text("object mug, plate\nleft: leftOf(mug, plate)\n")
    (here / "mine.csv").write_text(POSES)
    scored = scenegen("eval", "w.spec", "mine.csv")
    assert scored.status == 0 and [float(line.split("\t")[1]) for line in scored.out.splitlines()[1:]] == [
        pytest.approx(0.4),
        pytest.approx(-0.1),
    ]
    assert "mine.csv has columns that the spec does not need: cam" in scored.err
    for words in (["export", "--out", "s.parquet"], ["export", "--to", "mjcf", "--out", "worlds"]):
        refused = scenegen(words[0], "mine.csv", *words[1:])
        assert refused.status == 1 and "error[not-scenes]" in refused.err and "--spec" in refused.err
        assert scenegen(words[0], "mine.csv", "--spec", "w.spec", *words[1:]).status == 0
    assert scenegen("eval", "w.spec", "s.parquet").out == scored.out
    assert sorted(path.name for path in (here / "worlds").glob("*.xml")) == ["scene_0001.xml", "scene_0002.xml"]
    refused = scenegen("export", "s.parquet", "--spec", "w.spec", "--out", "t.json")
    assert refused.status == 1 and "error[out-of-place]: spec" in refused.err
    assert scenegen("export", "s.parquet", "--mirrored", "--out", "m.json").status == 0
    values = [float(line.split("\t")[1]) for line in scenegen("eval", "w.spec", "m.json").out.splitlines()[1:]]
    assert values == [pytest.approx(-0.4), pytest.approx(0.1)]


def test_a_file_of_scenes_is_completed(scenegen, here):
    (here / "w.spec").write_text("object mug, plate, can\ntask: leftOf(mug, plate)\n")
    assert scenegen("sample", "w.spec", "--violated", "-n", "7", "--out", "a.json").status == 0
    made = scenegen("sample", "w.spec", "--satisfied", "--fix-from", "a.json", "--fix", "can", "--out", "b.json")
    assert made.status == 0 and "7 scenes (completed, " in made.err
    before, after = (json.loads((here / name).read_text())["scenes"] for name in ("a.json", "b.json"))
    assert [one["poses"]["can"] for one in before] == [one["poses"]["can"] for one in after]
    assert scenegen("sample", "w.spec", "--fix-from", "a.json", "--fix", "can", "-n", "7").status == 0
    for words, said in (
        (["--fix-from", "a.json"], "error[all-held]"),
        (["--fix-from", "a.json", "--fix", "cup"], "error[unknown-object]"),
        (["--fix-from", "a.json", "--fix", "can", "--out", "set/"], "error[out-of-place]: --fix-from"),
        (["--fix-from", "none.json", "--fix", "can"], "error[cannot-read]"),
        (["--fix-from", "a.json", "--fix", "can=0.5,0.5"], "error[out-of-place]: --fix can=0.5,0.5 has no place"),
        (["--fix-from", "a.json", "--fix", "can", "-n", "16"], "error[out-of-place]: n does not go with given scenes"),
    ):
        refused = scenegen("sample", "w.spec", "--satisfied", *words)
        assert refused.status == 1 and refused.err.startswith(said), refused.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--to", "pybullet", "--out", "o"), "scenegen.load_pybullet"),
        (("--to", "csv", "--out", "o.csv"), "to_csv"),
        (("--to", ".CSV", "--out", "o.csv"), "to_csv"),
        (("--out", "o.csv"), "to_csv"),
        (("--out", "o.PNG"), "scenegen render"),
        (("--to", "drake", "--out", "o"), "the format for drake is `sdf`"),
        (("--to", "urdf", "--out", "o"), "`mjcf`, `sdf` or `usd`"),
    ],
    ids=" ".join,
)
def test_what_is_no_format_names_what_does_it(words, said, scenegen, here):
    assert scenegen("sample", "good.spec", "-n", "1", "--out", "s.json").status == 0
    outcome = scenegen("export", "s.json", *words)
    assert outcome.status == 1 and outcome.err.count("error[") == 1 and said in outcome.err
    if "--to" not in words:
        assert said in scenegen("sample", "good.spec", "-n", "1", *words).err


@pytest.mark.parametrize("between", [",", ";", "\t"])
def test_columns_stand_between_commas_semicolons_or_tabs(between, scenegen, here):
    (here / "w.spec").write_text("object mug, plate\nleft: leftOf(mug, plate)\n")
    (here / "mine.csv").write_text(POSES)
    (here / "other.csv").write_text(POSES.replace(",", between))
    assert scenegen("eval", "w.spec", "other.csv").out == scenegen("eval", "w.spec", "mine.csv").out != ""


ALL = "mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            f"{ALL}\n0.2,0.5,90,0.6,0.5,0\n",
            "warning[doubtful-pose]: t.csv: `mug.theta` in row 1 is 90: more than a turn",
        ),
        (
            f"{ALL}\n0.2,0.5,0,0.6,0.5,0\n200,500,0,600,500,0\n",
            "t.csv: `mug.x` in row 2 is 200: outside of the workspace",
        ),
        (f"{ALL.replace(',', ';')}\n0,2;0,5;0;0,6;0,5;0\n", "numbers have a decimal point: 0.2"),
        (f'{ALL}\n"0,2",0.5,0,0.6,0.5,0\n', "numbers have a decimal point: 0.2"),
        (f"{ALL}\n0,2,0,5,0,0,6,0,5,0\n", "row 1 has 10 values, not 6"),
        (f"{ALL.replace(',', ' ')}\n0.2 0.5 0 0.6 0.5 0\n", "its columns are separated by ` `"),
        (f"{ALL.replace(',', '|')}\n0.2|0.5|0|0.6|0.5|0\n", "its columns are separated by `|`"),
        (
            "mug.x,mug.y,mug.yaw\n0.2,0.5,0\n",
            "missing are mug.theta, plate.x, plate.y, plate.theta; its columns are mug.x",
        ),
        (f"{ALL}\n0.2,0.5,x,0.6,0.5,0\n", "error[table-cell]: t.csv: `mug.theta` in row 1 is `x`"),
        (f"{ALL}\n0.2,0.5,,0.6,0.5,0\n", "every x, y and theta is a finite number"),
    ],
)
def test_tables_of_poses_that_mean_something_else(text, said, scenegen, here):
    (here / "w.spec").write_text("object mug, plate\nleft: leftOf(mug, plate)\n")
    (here / "t.csv").write_text(text)
    outcome = scenegen("eval", "w.spec", "t.csv")
    assert said in outcome.err and "trajectory" not in outcome.err
    assert outcome.err.count("error[") == outcome.status and outcome.err.count("[") == 1


def test_trajectories_in_degrees_and_with_semicolons(scenegen, here):
    (here / "w.spec").write_text("time 1 steps\nobject mug\nleft: always leftOf(mug, (0.5, 0.5))\n")
    (here / "t.csv").write_text("t;mug.x;mug.y;mug.theta\n0;0.2;0.5;0\n1;0.2;0.5;90\n")
    outcome = scenegen("eval", "w.spec", "t.csv")
    assert outcome.status == 0 and "`mug.theta` in row 2 is 90: more than a turn" in outcome.err
