"""Reports: figures for people, every digit in JSON, and tables held by a golden file. Pages: text by hand around
tables that are filled in; those in docs/experiments hold what their JSON files say. The table of experiments: every
entry loads, and is told to people. Figures say what the scenes say. Every experiment, with tiny settings: the files
are there, and hold what they should. `python -m experiments`: what it refuses, and that it refuses before any work.
"""

import dataclasses
import importlib
import inspect
import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from experiments import compare, semantics, trainings
from experiments.__main__ import main, parser
from experiments.bench import Row
from experiments.charts import small_png
from experiments.compare import Comparison
from experiments.figures import orderings as fig9
from experiments.figures.isomap import Query, isomap
from experiments.figures.overlay import overlay
from experiments.figures.steering import STEPS
from experiments.figures.strip import strips
from experiments.measure import phi_of
from experiments.page import block, fill, names, picture, table
from experiments.plan import Plan
from experiments.problems import ORDERINGS, PROBLEMS
from experiments.report import Report, short, spread, write
from experiments.run import run
from experiments.samplers import EXACT
from experiments.semantics import PLATE, TEXT, way
from experiments.table import ALL, EXPERIMENTS, chosen
from experiments.tables import best, data, tables
from experiments.variants import VARIANTS
from scenegen.errors import RequestError
from tests.experiments.pages import MAKERS, tables_of


@pytest.mark.parametrize(
    "values, digits, text",
    [([], 2, "-"), ([0.5], 2, "0.50"), ([0.1, 0.2, 0.6], 2, "0.30 [0.10, 0.60]"), ([0.501, 0.502], 2, "0.50")],
)
def test_spread(values, digits, text):
    assert spread(values, digits) == text


@pytest.mark.parametrize("value, text", [(433, "433"), (16_500, "16.5k"), (1.2e6, "1.2M"), (3e9, "3G"), (0.5, "0.5")])
def test_short(value, text):
    assert short(value) == text


def made(name, family, recipe, error, coverage, share=0.25):
    """A row of two seeds, a little apart."""
    runs = []
    for off in (0.0, 0.002):
        run = {"mean:sorted": -error, "std:sorted": 0.01, "error:sorted": error + off, "within": 0.9}
        run |= {
            "coverage": coverage - off,
            "ks": 0.1,
            "handed_ks": 0.05,
            "near": 0.1,
            "near_truth": 0.12,
            "handed": 1.0,
            "handed_in_range": 1.0,
        }
        run |= {"handed_coverage": 0.93, "handed_speed": 20_000.0, "speed": 150_000.0, "bytes": 5e5, "cpu": 100.0}
        run |= {f"raw:{which}": share for which in ORDERINGS}
        runs.append(run)
    return Row(name, tuple(runs), family, recipe)


def comparison():
    problem = PROBLEMS["exp3_7"]
    known = Row("published weights, GAN", ({"error:sorted": 0.1, "coverage": 0.12, "speed": 270e3},), "gan")
    rows = (
        known,
        made("good", "gan", "default", 0.01, 0.9),
        made("collapsed", "gan", "default", 0.01, 0.1, share=0.1),
        made("inaccurate", "flow", "default", 0.2, 0.9),
        made("the paper's", "gan", "paper", 0.1, 0.3),
        Row(EXACT, ({"error:sorted": 0.006, "handed_coverage": 0.97, "bytes": 98.0},)),
    )
    return Comparison(problem, problem.load(), rows, {}, {}, {}, np.empty((21, 0)))


def test_tables(golden):
    made = tables(comparison())
    assert list(made) == [f"exp3_7-{name}" for name in ("accuracy", "diversity", "orderings", "cost", "bars")]
    golden("experiments/tables.md", "\n\n".join(made.values()) + "\n")


def test_the_best_model_is_the_least_short_of_both_bars():
    """In shares of the bars: good 0.73 and 0.94, collapsed 0.73 and 8.5, inaccurate 13.4 and 0.94."""
    found = comparison()
    assert best(found).name == "good"
    worse = dataclasses.replace(found, rows=tuple(row for row in found.rows if row.name != "good"))
    assert best(worse).name == "collapsed"


def test_data_has_every_digit():
    found = data(comparison())
    assert found["rows"][1]["runs"][1]["error:sorted"] == 0.01 + 0.002
    assert [row["recipe"] for row in found["rows"]] == ["", "default", "default", "default", "paper", ""]


def test_a_report_is_written(tmp_path):
    blocks = {"numbers": table(["", "a"], [["b", "1" * 200]]), "fig": picture("x.png", "Fig. 1")}
    report = Report("thing", "A thing", blocks, {"answer": 0.1 + 0.2}, {"x.png": b"png"})
    names = write(Plan(tmp_path, (0, 1), True, 1, print), report)
    assert names == ["x.png", "thing.json", "thing.md"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    found = json.loads((tmp_path / "thing.json").read_text())
    assert found["answer"] == 0.1 + 0.2 and found["quick"] and found["seeds"] == [0, 1]
    assert found["figures"] == ["x.png"]
    page = tmp_path / "thing.md"
    assert page.read_text().startswith("# A thing\n\n<!-- begin made -->\n") and "![Fig. 1](x.png)" in page.read_text()
    assert "`python -m experiments thing --quick`" in page.read_text() and "numbers mean nothing" in page.read_text()


def test_a_page_keeps_its_text_and_tells_what_is_stale(tmp_path):
    page, told = tmp_path / "thing.md", []
    page.write_text(f"# By hand\n\n{block('numbers', 'old')}\n\nWhat it means.\n\n{block('gone', 'older')}\n")
    write(Plan(tmp_path, (0,), False, 1, told.append), Report("thing", "A thing", {"numbers": "new"}, {}))
    text = page.read_text()
    assert (
        text.startswith(f"# By hand\n\n{block('numbers', 'new')}\n\nWhat it means.") and block("gone", "older") in text
    )
    assert block("made", "Tables")[:26] in text and "numbers mean nothing" not in text
    assert len(told) == 1 and "gone" in told[0]


def test_of_models_that_meet_every_bar_the_most_accurate_is_best():
    found = comparison()
    slow = made("slow", "flow", "default", 0.002, 0.99)
    slow.runs[0]["speed"] = 20e3
    better = made("better", "energy", "default", 0.003, 0.9)
    assert best(dataclasses.replace(found, rows=(*found.rows, slow, better))).name == "better"


def test_filling_keeps_the_text():
    page = f"# Title\n\nBefore.\n\n{block('one', 'old')}\n\nBetween.\n\n{block('gone', 'left')}\n"
    filled, stale = fill(page, {"one": "new | 1", "two": "more"})
    assert filled == (
        f"# Title\n\nBefore.\n\n{block('one', 'new | 1')}\n\nBetween.\n\n{block('gone', 'left')}\n\n"
        f"## two\n\n{block('two', 'more')}\n"
    )
    assert stale == ["gone"] and names(filled) == ["one", "gone", "two"]
    assert fill(filled, {"one": "new | 1", "two": "more"})[0] == filled


def test_what_looks_like_a_group_of_a_pattern_is_text():
    assert r"\1 \g<name>" in fill(block("one", ""), {"one": r"\1 \g<name>"})[0]


@pytest.mark.parametrize("name", MAKERS)
def test_the_tables_in_docs_are_those_of_the_data(name, root, derived):
    path = root / "docs" / "experiments" / f"{name}.md"
    page, tables = path.read_text(encoding="utf-8"), tables_of(path.with_suffix(".json"))
    filled, _ = fill(page, tables)
    derived(f"docs/experiments/{name}.md", filled)
    assert set(tables) <= set(names(page))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_entry_is_a_function_of_a_plan(name):
    module, _, function = EXPERIMENTS[name].function.partition(":")
    assert list(inspect.signature(getattr(importlib.import_module(module), function)).parameters) == ["plan"]


def test_one_by_name_or_all():
    assert list(chosen("exp1")) == ["exp1"]
    assert chosen(ALL) == EXPERIMENTS


def test_a_misspelt_name_is_answered():
    with pytest.raises(RequestError) as caught:
        chosen("semantic")
    [diagnostic] = caught.value.diagnostics
    assert diagnostic.title == "unknown experiment `semantic`" and diagnostic.help == "did you mean `semantics`?"


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


class Recorder:
    """Axes that note the lines drawn on them."""

    def __init__(self):
        self.lines = []

    def plot(self, x, y, **style):
        self.lines.append((np.asarray(x), np.asarray(y), style))


@pytest.mark.parametrize(
    "x, y, place, start, end",
    [
        ([0.1, 0.5, 0.55], [0.2, 0.3, 0.9], 0, (0.5, 0.3), (0.55, 0.3)),
        ([0.9, 0.6, 0.55], [0.2, 0.3, 0.9], 1, (0.6, 0.3), (0.55, 0.3)),
        ([0.1, 0.5, 0.2], [0.2, 0.25, 0.9], 2, (0.1, 0.2), (0.1, 0.25)),
        ([0.1, 0.5, 0.2], [0.9, 0.4, 0.35], 3, (0.5, 0.4), (0.5, 0.35)),
    ],
)
def test_the_red_bar_is_as_long_as_phi_and_at_the_closest_pair(x, y, place, start, end):
    axes = Recorder()
    fig9._bar(axes, np.array(x), np.array(y), place, 0.05)
    bar_x, bar_y, style = axes.lines[0]
    assert style["color"] == fig9.RED
    assert np.allclose([bar_x[0], bar_y[0]], start) and np.allclose([bar_x[1], bar_y[1]], end)


@pytest.mark.long
def test_an_ordering_that_is_missing_is_said():
    rng = np.random.default_rng(0)
    scene = np.sort(rng.random(3))[:, None] * [1, 0, 0] + [0, 0.5, 0]
    one = scene.reshape(-1, 1)
    with_all = {0.05: np.concatenate([one, one[[6, 7, 8, 3, 4, 5, 0, 1, 2]]], axis=1)}
    assert pixels(fig9.orderings({0.05: one}, "")).shape == pixels(fig9.orderings(with_all, "")).shape
    assert (pixels(fig9.orderings({0.05: one}, "")) != pixels(fig9.orderings(with_all, ""))).any()


def test_the_mug_goes_round_the_plate():
    from scenegen.api.spec import parse

    share, rows = way(11)
    phi = dict(zip(("close", "right", "left"), phi_of(parse(TEXT), rows), strict=True))
    assert np.allclose(phi["right"], rows[0] - PLATE[0]) and np.allclose(phi["left"], PLATE[0] - rows[0])
    assert np.allclose(phi["close"], 0.25 - np.hypot(rows[0] - PLATE[0], rows[1] - PLATE[1]))
    assert (np.diff(rows[0]) > 0).all() and phi["close"].argmax() == 5 and share[5] == 0.5
    assert phi["close"][0] < 0 < phi["close"][5]


def test_steering_asks_for_what_can_be_had():
    """A distance d between the centres allows every phi of the task from -d to d / sqrt(2)."""
    for label, steps in STEPS.items():
        held = {pair[1 if label == "task" else 0] for pair in steps}
        assert len(held) == 1 and min(held) >= 0.0
        assert all(-(safe + 0.25) <= task <= (safe + 0.25) / np.sqrt(2.0) for task, safe in steps)


@pytest.mark.long
def test_panels_of_points():
    spec = PROBLEMS["exp2"].load()
    rng = np.random.default_rng(0)
    scenes = rng.random((12, 40))
    full, empty = (pixels(overlay(spec, {"a": scenes[:, :n]}, 700)) for n in (40, 0))
    assert full.shape == empty.shape and (full != empty).sum() > 100
    assert (pixels(overlay(spec, {"a": scenes}, 20)) == pixels(overlay(spec, {"a": scenes[:, :20]}, 20))).all()
    phi = rng.normal(0.19, 0.01, 40)
    query = Query("here", 0.19, {"truth": (scenes[:6], phi), "none": (scenes[:6, :0], phi[:0])}, "truth")
    assert pixels(isomap([query], 30, 6)).std() > 0.0


def test_pictures_side_by_side():
    red, blue = (Image.new("RGB", (40, 30), color) for color in ("#ff0000", "#0000ff"))
    found = pixels(strips([("a row", [(red, ["left"]), (blue, ["right", "below"])]), ("", [(blue, ["x"])])]))
    assert (found == (255, 0, 0)).all(axis=2).sum() == 40 * 30 and (found == (0, 0, 255)).all(
        axis=2
    ).sum() == 2 * 40 * 30


def test_small_pictures_keep_their_colours():
    gradient = Image.linear_gradient("L").convert("RGB")
    assert abs(pixels(small_png(gradient)).astype(int) - np.asarray(gradient)).max() <= 2


DOCS = Path(__file__).resolve().parents[2] / "docs" / "experiments"
FIGURES = {
    "semantics": ["semantics_fig3.png"],
    "exp1": ["exp1_fig6.png", "exp1_fig7.png"],
    "exp2": ["exp2_fig1.png", "exp2_fig8.png"],
    "exp3": ["exp3_fig9_3.png", "exp3_fig9_5.png", "exp3_fig9_7.png"],
    "rejection": [],
    "space": [],
    "curriculum": ["curriculum.png"],
    "curriculum-deep": ["curriculum-deep.png"],
}


@pytest.fixture
def carry_out(tmp_path):
    def call(name):
        out = tmp_path / "reports"
        run(name, out, seeds=1, workers=1, quick=True)
        return out

    return call


def check(out, name):
    report = json.loads((out / f"{name}.json").read_text())
    assert report["experiment"] == name and report["quick"] is True and report["figures"] == FIGURES[name]
    text = (out / f"{name}.md").read_text()
    assert "The numbers mean nothing" in text and "nan" not in text.split()
    kept = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    assert set(names(text)) == set(names(kept)), "the page in docs has a place for every table, and for no other"
    for figure in FIGURES[name]:
        assert f"({figure})" in text and f"({figure})" in kept
        with Image.open(out / figure) as picture:
            assert picture.format == "PNG" and min(picture.size) >= 36
    return report


FEW = (VARIANTS[0], next(one for one in VARIANTS if one.recipe == "default"))


@pytest.mark.long
def test_experiment_1(carry_out, monkeypatch):
    """With two of the models; the slow tests train them all."""
    monkeypatch.setattr(compare, "VARIANTS", FEW)
    monkeypatch.setattr(trainings, "VARIANTS", FEW)
    out = carry_out("exp1")
    report = check(out, "exp1")
    [comparison] = report["comparison"]
    rows = {row["name"]: row["runs"][0] for row in comparison["rows"]}
    for variant in FEW:
        one = rows[variant.name]
        assert {"error:task", "error:safe", "coverage", "near", "speed", "bytes", "cpu"} <= set(one)
        assert one["handed"] == 0.0 or one["handed_in_range"] == 1.0
    exact = rows["exact sampler (the spec alone)"]
    assert exact["handed_in_range"] == 1.0 and exact["handed_coverage"] > 0.8 and exact["within"] == 1.0
    assert rows["published weights, GAN"]["coverage"] == 0.09
    assert len(report["fig6"]) == 20


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in FIGURES if name != "exp1"])
def test_the_others(carry_out, name):
    check(carry_out(name), name)


@pytest.mark.slow
def test_all_again_trains_nothing(tmp_path):
    told: list[str] = []
    run("all", tmp_path / "reports", seeds=1, workers=2, quick=True, tell=told.append)
    for name in FIGURES:
        check(tmp_path / "reports", name)
    assert any("trained in" in line for line in told) and any("learnt in" in line for line in told)
    told.clear()
    run("all", tmp_path / "reports", seeds=1, workers=2, quick=True, tell=told.append)
    assert not any("trained in" in line or "learnt in" in line for line in told)


@pytest.fixture
def refused(capsys, tmp_path, monkeypatch):
    """Runs a command that must fail: status 1, one diagnostic with help, nothing written."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        assert main(words) == 1
        said = capsys.readouterr()
        assert said.out == "" and said.err.startswith("error[") and said.err.count("= help:") == 1
        assert not list(tmp_path.iterdir())
        return said.err

    return call


def test_a_misspelt_name(refused):
    assert "did you mean `exp1`?" in refused("ex1", "--out", "reports")


def test_numbers_out_of_range(refused):
    assert "`seeds` is 0" in refused("exp1", "--out", "reports", "--seeds", "0")
    assert "`workers` is 0" in refused("exp1", "--out", "reports", "--workers", "0")


def test_a_folder_that_cannot_be_made(refused):
    assert "nowhere" in refused("exp1", "--out", "nowhere/reports")


def test_a_missing_library_is_named_before_any_work(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn", None)
    said = refused("exp1", "--out", "reports", "--quick")
    assert "scikit-learn" in said and 'pip install "scenegen-dsl[experiments]"' in said


def test_a_quick_run_does_not_replace_real_numbers(tmp_path, capsys):
    report = tmp_path / "semantics.json"
    report.write_text('{"quick": false}')
    assert main(["semantics", "--out", str(tmp_path), "--quick"]) == 1
    assert "another folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["semantics.json"]


@pytest.mark.parametrize("words", [["exp1"], ["--out", "reports"], ["exp1", "--out", "reports", "--fast"]])
def test_wrong_usage(words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 2 and "usage: python -m experiments" in capsys.readouterr().err


def test_an_interrupt_says_how_to_go_on(tmp_path, monkeypatch, capsys):
    def interrupted(plan):
        raise KeyboardInterrupt("stopped after 3 of 50 epochs; go on with --resume")

    monkeypatch.setattr(semantics, "run", interrupted)
    assert main(["semantics", "--out", str(tmp_path / "reports")]) == 130
    said = capsys.readouterr().err
    assert "the same command goes on" in said and "--resume" not in said


def test_the_help_lists_each_with_its_time():
    lines = [" ".join(line.split()) for line in parser().format_help().splitlines()]
    for name, entry in EXPERIMENTS.items():
        assert f"{name} {entry.time} {entry.about}" in lines
