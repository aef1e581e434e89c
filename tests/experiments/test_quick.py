"""Every experiment, with tiny settings: the files are there, and hold what they should."""

import json
from pathlib import Path

import pytest
from PIL import Image

from experiments import compare, trainings
from experiments.page import names
from experiments.run import run
from experiments.variants import VARIANTS

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
