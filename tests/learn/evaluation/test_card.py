"""The model card: its figures against an independent look, its text, its picture."""

import io
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image
from scipy import special

import scenegen
from experiments.metrics import chi_square_tail, error_statistics, kolmogorov_tail, kuiper_tail
from scenegen.errors import DataError
from scenegen.learn.evaluation import card as measuring
from scenegen.learn.evaluation.calibration import CalibrationPanel, calibration
from scenegen.learn.evaluation.card import card_paths, card_text, measure, values, write_card
from scenegen.learn.evaluation.describe import as_json, describe, held_out
from scenegen.learn.model import load_model
from scenegen.scenes.coverage import checked_pair, features

TEXT = "# A mug stands left of a plate.\nobject mug, plate\ntask: leftOf(mug, plate)\nnear: closeTo(mug, plate, 0.3)\n"


class Exact:
    """Stands in for a trained model: proposes scenes whose phi is the wanted one, or off by a given amount."""

    def __init__(self, real, off):
        self.card, self.label_ranges, self.off, self.correction = real.card, real.label_ranges, off, None
        self.with_free_labels = lambda phi, labels: phi  # it is told all of them

    def propose(self, phi, generator):
        import torch

        gap, near = phi[0] + self.off, 0.3 - phi[1]
        up = (near.square() - gap.square()).clamp_min(0.0).sqrt()
        half = torch.full_like(gap, 0.5)
        turn = torch.rand(gap.shape, generator=generator)
        return torch.stack([half - gap / 2, half - up / 2, turn, half + gap / 2, half + up / 2, turn])


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = tmp_path_factory.mktemp("card")
    spec = scenegen.parse(TEXT, "table.spec")
    return scenegen.train(
        spec, "gan", data="uniform", out=folder / "m.safetensors", epochs=1, scenes=640, card=False
    ), folder / "m.safetensors"


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(measuring, "HALF_SCENES", 100)
    monkeypatch.setattr(measuring, "CURVE_SCENES", 120)
    monkeypatch.setattr(measuring, "PATIENCE", float("inf"))  # however slow the machine
    monkeypatch.setattr(measuring, "ALL", float("inf"))


def test_values_to_look_at():
    assert values(-2.0, 0.3) == pytest.approx([-1.5, -0.5, 0.0, 0.1, 0.2])
    assert values(0.0, 1.0) == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9])
    assert values(0.5, 0.5) == []


@pytest.mark.long
@pytest.mark.parametrize("off", [0.0, 0.02])
def test_errors_are_those_of_the_model(off, model, few, monkeypatch):
    real, _ = model
    monkeypatch.setattr(measuring, "asked_for", lambda model: [])  # a stand-in has no file to sample from
    stand_in = scenegen.Model(real.trained)
    stand_in.trained = Exact(real.trained, off)
    found = measure(stand_in)
    task = [level for level in found.levels if list(level.wanted) == ["task"]]
    assert len(task) == 5 and all(level.error == pytest.approx(off, abs=2e-6) for level in task)
    curve = found.curves[0]
    assert curve.label == "task" and curve.error == pytest.approx(off, abs=2e-6)
    low, high = real.trained.label_ranges["task"]
    assert low - 1e-6 <= curve.wanted.min() and curve.wanted.max() <= high + 1e-6
    # exact scenes cover exact scenes to 1 - 2^-5 on average; the stand-in puts all of them in the middle of the table
    assert all(level.truth.coverage > 0.85 and level.made.coverage < 0.5 for level in task)
    assert all(level.truth.sliced < 0.5 < level.made.sliced and level.made.energy > 0.3 for level in task)
    near = [level for level in found.levels if list(level.wanted) == ["near"]]
    assert len(near) + sum(name.startswith("near near") for name in found.missing) >= 5
    both = [level for level in found.levels if list(level.wanted) == ["task", "near"]]
    assert both and all(level.required == 1.0 and level.alone is None for level in both)


@pytest.mark.long
def test_the_card_is_written_beside_the_model(model, few):
    trained, path = model
    assert write_card(trained, path) == list(card_paths(path))
    text = path.with_name("m.safetensors.md").read_text()
    assert "# gan for table.spec\n\nA mug stands left of a plate.\n" in text
    assert "task: leftOf(mug, plate)" in text and "640 uniform scenes, 64 more held out" in text
    assert "![wanted phi against reached phi](m.safetensors.png)" in text
    ranges, levels = text.split("The model's raw scenes against")
    shown = [line for line in ranges.splitlines() if line.startswith(("| task ", "| near "))]
    assert len(shown) == 5 and {"| task 0:, near 0:", "| task 0:", "| near 0:"} <= {
        row[: row.index(" | ")] for row in shown
    }
    assert [one.coverage for one in load_model(path).trained.card.ranges] == [
        pytest.approx(float(row.split("|")[3].split("(")[0]), abs=1e-3) for row in shown
    ]
    rows = [line for line in levels.splitlines() if line.startswith(("| task ", "| near ")) and "(" in line]
    assert len(rows) >= 8 and all(row.count("|") == 10 for row in rows)
    assert any(row.startswith("| task ") and ", near " in row for row in rows)
    kept = load_model(path).trained.card.quality
    assert len(kept) == len(rows) and {"task"} in [set(one.wanted) for one in kept]
    assert "**Warning:** raw scenes leave out" in text  # one epoch of 640 scenes
    before = text, path.with_name("m.safetensors.png").read_bytes()
    write_card(trained, path)
    assert (path.with_name("m.safetensors.md").read_text(), path.with_name("m.safetensors.png").read_bytes()) == before
    assert Image.open(io.BytesIO(before[1])).size == (940, 500)


def test_a_card_without_truth_says_so(model):
    trained, path = model
    text = card_text(trained, path, measuring.EvaluationResult((), (), ("task near 0",)))
    assert "No exact scenes were found" in text and "![" not in text


def test_what_is_said_of_a_model(model):
    trained, path = model
    facts = dict(describe(trained, path))
    assert facts["objects"] == "`mug` and `plate`" and facts["model"].startswith("gan, width")
    errors = trained.trained.card.validation.errors
    assert held_out(trained) == {name: means[-1] for name, means in errors.items()}
    data = as_json(trained, path)
    assert data["bytes"] == path.stat().st_size and data["scenes_per_second"] > 0
    assert data["training"]["seed"] == 0 and data["labels"][0]["name"] == "task"


def test_what_takes_too_long_is_left_out(model, few, monkeypatch):
    def late(*_):
        raise scenegen.RequestError(scenegen.errors.Kind("too-late", "too late")())

    monkeypatch.setattr(measuring, "_truth", late)
    found = measure(model[0])
    assert not found.levels and not found.curves
    assert "near task 0" in found.missing and "near over its range" in found.missing
    assert "No exact scenes were found" in card_text(*model, found)


def test_train_writes_the_card_when_asked(few, tmp_path):
    spec = scenegen.parse("leftOf(mug, plate)")
    scenegen.train(spec, "gan", data="uniform", out=tmp_path / "m", epochs=1, scenes=64, card=True)
    assert {path.name for path in tmp_path.iterdir()} == {"m", "m.train", "m.md", "m.png"}
    (tmp_path / "n.md").mkdir()
    with pytest.raises(scenegen.OutputError):
        scenegen.train(spec, "gan", data="uniform", out=tmp_path / "n", epochs=1, scenes=64, card=True)
    assert not (tmp_path / "n").exists()


def test_the_picture_has_the_dots_where_they_belong():
    line = np.linspace(0.0, 1.0, 200)
    on, off = (
        np.asarray(
            Image.open(io.BytesIO(calibration([CalibrationPanel("task", line, line + shift)]))).convert("RGB")
        ).astype(int)
        for shift in (0.0, 0.25)
    )

    def blue(picture):
        y, x = np.nonzero((picture[..., 2] - picture[..., 0] > 60) & (picture[..., 2] > 120))
        return x, y

    x, y = blue(on)
    assert np.abs((x - 70) - (380 + 64 - y)).max() < 5  # on the diagonal of a square of 380 pixels at (70, 64)
    x, y = blue(off)
    inside = y > 64 + 20
    assert np.median((380 + 64 - y[inside]) - (x[inside] - 70)) == pytest.approx(0.25 * 380 / 1.06, abs=5)
    with pytest.raises(ValueError, match="no panels"):
        calibration([])


def test_hand_computed_figures():
    phi = [[0.20, 0.18, 0.30, 0.16], [0.08, 0.10, 0.08, -0.02]]
    stats = error_statistics(phi, [0.19, 0.08], ["task", "safe"])
    task, safe = stats.labels
    assert (task.label, task.wanted, stats.scenes, stats.tolerance) == ("task", 0.19, 4, 0.025)
    assert task.mean == pytest.approx((0.01 - 0.01 + 0.11 - 0.03) / 4)
    assert task.mean_abs == pytest.approx(0.04)
    assert task.std == pytest.approx(np.std([0.01, -0.01, 0.11, -0.03]))
    assert task.within == 0.5  # 0.01 and -0.01
    assert safe.within == 0.75
    assert stats.within == 0.5  # the first two scenes alone are within on both labels


def test_within_needs_all_labels():
    stats = error_statistics([[0.0, 1.0], [1.0, 0.0]], [0.0, 0.0], ["a", "b"])
    assert [label.within for label in stats.labels] == [0.5, 0.5]
    assert stats.within == 0.0


@pytest.mark.parametrize(
    ("phi", "wanted"),
    [([[0.0]], [0.0, 1.0]), ([0.0], [0.0]), ([[]], [0.0]), ([[np.nan]], [0.0]), ([[0.0]], [np.inf])],
)
def test_bad_input_is_a_diagnostic(phi, wanted):
    with pytest.raises(ValueError, match="phi"):
        error_statistics(phi, wanted, ["task"])


TURN = 1.0 / (2.0 * np.pi)


def test_features_of_one_scene():
    rows = np.array([[0.1], [0.2], [0.0], [0.3], [0.4], [np.pi / 2]])
    assert features(rows)[0] == pytest.approx([0.1, 0.3, 0.2, 0.4, TURN, 0.0, 0.0, TURN], abs=1e-15)


def test_too_few_scenes_are_named():
    with pytest.raises(DataError, match="3 generated scenes are too few"):
        checked_pair(np.zeros((3, 9)), np.zeros((3, 3)), (4, 4))
    with pytest.raises(DataError, match="2 objects per scene, the generated scenes 1"):
        checked_pair(np.zeros((6, 9)), np.zeros((3, 9)), (1, 1))


@pytest.mark.parametrize("x", [0.0, 0.03, 0.2, 0.5, 0.8275735, 0.999999, 1.0, 1.000001, 1.36, 2.0, 5.0, 18.0])
def test_kolmogorov(x):
    assert kolmogorov_tail(x) == pytest.approx(special.kolmogorov(x), rel=1e-10)


# Upper quantiles that Stephens 1974 (EDF statistics for goodness of fit, table 1A) prints for Kuiper's V.
@pytest.mark.parametrize(
    ("level", "quantile"), [(0.15, 1.537), (0.10, 1.620), (0.05, 1.747), (0.025, 1.862), (0.01, 2.001)]
)
def test_kuiper_quantiles(level, quantile):
    assert kuiper_tail(quantile + 0.0006) < level < kuiper_tail(quantile - 0.0006)


def test_kuiper_falls_from_one_to_nothing():
    tails = [kuiper_tail(x) for x in np.linspace(0.0, 6.0, 601)]
    assert tails[0] == 1.0
    assert all(0.0 <= after <= before for before, after in pairwise(tails))
    assert kuiper_tail(0.4) == pytest.approx(1.0, abs=1e-6)
    assert 0.0 < tails[-1] < 1e-25


@pytest.mark.parametrize("degrees", [1, 2, 3, 7, 31, 255, 4095, 100_000])
def test_chi_square(degrees):
    deviation = np.sqrt(2.0 * degrees)
    points = [degrees + t * deviation for t in (-5, -2, -0.5, 0.0, 0.3, 1.41, 1.43, 3, 8, 20)]
    for x in [0.0, 1e-12, *points]:
        x = max(x, 0.0)
        assert chi_square_tail(x, degrees) == pytest.approx(special.gammaincc(degrees / 2, x / 2), rel=1e-9, abs=1e-290)


def test_chi_square_far_out_is_zero_not_an_error():
    assert chi_square_tail(1e6, 3) == 0.0
