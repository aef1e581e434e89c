"""New suites: bands by number, by phi and by rarity, bytes that do not depend on processes."""

import pytest

from scenegen.api.rarity import SpecRarity
from scenegen.errors import RequestError
from scenegen.errors.requests import CUT_SHORT, NO_TIME_TO_CHECK, OUT_OF_RANGE
from scenegen.sampling.request import Range
from scenegen.worlds.suites import new as module
from scenegen.worlds.suites.new import new_suite
from scenegen.worlds.suites.suite import MANIFEST

pytestmark = pytest.mark.long

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


def test_the_bytes_follow_from_the_specs(spec_file, golden, tmp_path):
    """Those of two processes here are those of one, of another day, that the other tests read."""
    made = new_suite([("beside", spec_file)], tmp_path / "small", bands=2, n=3, workers=2)
    for name in (MANIFEST, *(task.scenes for task in made.tasks + made.reversed)):
        golden(f"worlds/suites/small/{name}", (tmp_path / "small" / name).read_text())


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
    monkeypatch.setattr(module, "FEW", module.COUNTED)  # every band counts as rare
    with pytest.raises(RequestError) as caught:
        new_suite([("beside", spec_file)], tmp_path / "slow", bands=2, n=1, workers=1, timeout=50.0)
    assert caught.value.diagnostics[0].kind is NO_TIME_TO_CHECK and not (tmp_path / "slow").exists()
    assert 0.0 < asked[0]["timeout"] < 50.0, "what counting has left of it"


def test_bands_where_no_start_is_are_refused(spec_file, tmp_path):
    spec_file.write_text(SPEC.replace("# reverse", "# "))
    with pytest.raises(RequestError) as caught:
        new_suite([("beside", spec_file)], tmp_path / "beyond", bands={"far": Range(-0.9, -0.8)}, n=1, workers=1)
    assert caught.value.diagnostics[0].kind == OUT_OF_RANGE and not (tmp_path / "beyond").exists()
