"""Reports: figures for people, every digit in JSON, and tables held by a golden file."""

import dataclasses
import json

import numpy as np
import pytest

from experiments.bench import Row
from experiments.compare import Comparison
from experiments.page import block, picture, table
from experiments.plan import Plan
from experiments.problems import ORDERINGS, PROBLEMS
from experiments.report import Report, short, spread, write
from experiments.samplers import EXACT
from experiments.tables import best, data, tables


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
