"""New suites: bands by number, by phi and by rarity, bytes that do not depend on processes."""

import numpy as np
import pytest

from scenegen.api.rarity import SpecRarity
from scenegen.errors import RequestError
from scenegen.errors.requests import CUT_SHORT, NO_TIME_TO_CHECK, OUT_OF_PLACE, OUT_OF_RANGE, WRONG_VALUE
from scenegen.play.suites import new as module
from scenegen.play.suites.new import new_suite
from scenegen.play.suites.suite import SUITE_JSON, check_suite
from scenegen.sampling.request import Range

SPEC = """# Put a beside b.
# reverse: Take a away from b.
object a = cylinder(2 cm, 4 cm), b = cylinder(2 cm, 4 cm) at (0, 0)
workspace [-15 cm, 15 cm] x [-15 cm, 15 cm]
require noOverlap(objects)
goal: closeTo(a, b, 6 cm)
start: farFrom(a, b, 10 cm)
"""


@pytest.fixture
def spec_file(tmp_path):
    path = tmp_path / "beside.spec"
    path.write_text(SPEC)
    return path


@pytest.mark.long
def test_the_bytes_follow_from_the_specs(spec_file, golden, tmp_path):
    """Those of two processes here are those of one, of another day, that the other tests read."""
    made = new_suite([("beside", spec_file)], tmp_path / "small", bands=2, n=3, workers=2)
    for name in (SUITE_JSON, *(task.scenes for task in made.tasks + made.reversed)):
        golden(f"play/suites/small/{name}", (tmp_path / "small" / name).read_text())


@pytest.mark.long
def test_bands_by_rarity(spec_file, tmp_path):
    ranges = {"rest": Range(-1.0, None), "hardest": Range(None, -1.0)}
    made = new_suite([("beside", spec_file)], tmp_path / "tenth", bands=ranges, log10p=True, n=2, workers=1)
    rest, hardest = made.tasks[0].bands
    assert (rest.name, hardest.name, rest.phi[0], rest.phi[1]) == ("rest", "hardest", hardest.phi[1], 0.0)
    assert (rest.probability, hardest.probability) == (pytest.approx(0.9, abs=1e-3), pytest.approx(0.1, abs=1e-3))
    assert max(hardest.log10p) <= -1.0 <= min(rest.log10p)


def test_time_that_is_up_while_a_rare_band_is_measured(spec_file, tmp_path, monkeypatch):
    """Bands would depend on the clock: nothing is written."""
    cut = SpecRarity((), None, 0, 1, (CUT_SHORT(),))
    asked = []
    monkeypatch.setattr(module, "rarity", lambda spec, label, **given: asked.append(given) or cut)
    monkeypatch.setattr(module, "MIN_IN_BAND", module.COUNTED_DRAWS)  # every band counts as rare
    with pytest.raises(RequestError) as caught:
        new_suite([("beside", spec_file)], tmp_path / "slow", bands=2, n=1, workers=1, timeout=50.0)
    assert caught.value.diagnostics[0].kind is NO_TIME_TO_CHECK and not (tmp_path / "slow").exists()
    assert 0.0 < asked[0]["timeout"] < 50.0, "what counting has left of it"


@pytest.mark.long
def test_bands_where_no_start_is_are_refused(spec_file, tmp_path):
    spec_file.write_text(SPEC.replace("# reverse", "# "))
    with pytest.raises(RequestError) as caught:
        new_suite([("beside", spec_file)], tmp_path / "beyond", bands={"far": Range(-0.9, -0.8)}, n=1, workers=1)
    assert caught.value.diagnostics[0].kind == OUT_OF_RANGE and not (tmp_path / "beyond").exists()


@pytest.mark.parametrize(
    "bands, log10p",
    [
        ({"hard": Range(None, -0.05), "mid": Range(-0.08, -0.06)}, False),
        ({"all": Range(None, 0.0), "near": Range(-0.05, 0.0)}, False),
        ({"a": Range(-3.0, -1.0), "b": Range(-2.0, 0.0)}, True),
    ],
)
def test_bands_that_overlap_are_refused_at_once(spec_file, tmp_path, bands, log10p):
    with pytest.raises(RequestError) as caught:
        new_suite([("beside", spec_file)], tmp_path / "twice", bands=bands, log10p=log10p, n=1, workers=1)
    (wrong,) = caught.value.diagnostics
    assert wrong.kind is OUT_OF_PLACE and "count twice" in wrong.title and not (tmp_path / "twice").exists()


@pytest.mark.parametrize("name", ["a/b", "a\\b", "a\nb", "", "\udcff", "\0", "\u2028", "x" * 201])
@pytest.mark.parametrize("what", ["task", "band"])
def test_names_that_no_file_or_line_can_have(spec_file, tmp_path, name, what):
    given = {"task": "beside", "band": "near", what: name}
    with pytest.raises(RequestError) as caught:
        new_suite([(given["task"], spec_file)], tmp_path / "named", bands={given["band"]: Range(-0.05, 0.0)}, n=1)
    assert caught.value.diagnostics[0].kind is WRONG_VALUE and f"name of a {what}" in str(caught.value)


@pytest.mark.long
def test_any_other_name_is_one(spec_file, tmp_path):
    for name in ("my task", "Łódź", "_x", "!", "=", ":", "..", "-", "x" * 190, "no\u00a0break", "🍵"):
        made = new_suite(
            [(name, spec_file)], tmp_path / f"of {name}", bands={name: Range(-0.1, 0.0)}, n=np.int64(1), workers=1
        )
        assert [made.tasks[0].name, made.tasks[0].bands[0].name] == [name] * 2
        assert [one.name for one in check_suite(tmp_path / f"of {name}")] == [f"of {name}"] * 2


def test_goals_without_a_grasp_are_refused_whatever_they_are(spec_file, tmp_path):
    for goal in (Range(0.0), Range(0.01)):
        with pytest.raises(RequestError) as caught:
            new_suite([("beside", spec_file)], tmp_path / "goals", goal=goal, n=1, workers=1)
        assert [one.kind for one in caught.value.diagnostics] == [OUT_OF_PLACE]


@pytest.mark.parametrize("names", [["suite"], ["a", "a"], ["a", "a.reverse"]])
def test_no_file_of_a_suite_is_written_twice(spec_file, tmp_path, names):
    with pytest.raises(RequestError) as caught:
        new_suite([(name, spec_file) for name in names], tmp_path / "twice", n=1, workers=1)
    assert caught.value.diagnostics[0].kind is OUT_OF_PLACE and "two files" in str(caught.value)


def test_numbers_that_make_no_suite(spec_file, tmp_path):
    for change in ({"specs": []}, {"bands": np.int64(65)}, {"n": np.int64(0)}, {"seed": -1}, {"bands": {}}):
        given = {"specs": [("beside", spec_file)], "n": 1, **change}
        with pytest.raises(RequestError):
            new_suite(given.pop("specs"), tmp_path / "none", **given)
