"""Nothing proves that a planted scene cannot be."""

import pytest

import scenegen
from scenegen.errors import RequestError

from .planted import PROOFS, planted, wrong_proofs

QUICK, MANY, SAMPLED = range(1, 5), range(100, 400), range(1000, 1060)


@pytest.mark.long
@pytest.mark.parametrize("seed", QUICK)
def test_no_proof_against_a_planted_scene(seed):
    assert wrong_proofs(planted(seed), 1e5) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", MANY)
def test_no_proof_against_many_planted_scenes(seed):
    assert wrong_proofs(planted(seed)) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", SAMPLED)
def test_planted_scenes_are_found_or_not_found(seed):
    """Whole runs of `sample`: scenes, or that none were found, in time; never that there are none."""
    made = planted(seed)
    spec = scenegen.parse(made.text)
    asked = {name: (0.0, None) for name in spec.labels if made.phi[name] >= 0.0}
    try:
        scenegen.sample(spec, asked, n=10, timeout=3.0)
    except RequestError as error:
        assert not made.numbers or error.diagnostics[0].code != "no-number-possible"
        assert error.diagnostics[0].kind not in PROOFS


def test_discs_that_may_overlap_are_not_counted_as_area():
    """Each of ten plates keeps clear of a coin; among each other only their centres are apart."""
    spec = scenegen.parse(
        "object plate[10] = cylinder(0.45, 0.05)\nobject coin = cylinder(0.02, 0.05)\n"
        "require forall p in plate: gap(p, coin) >= 0\ntask: forall p, q in plate: farFrom(p, q, 1 cm)\n"
    )
    scenes = scenegen.sample(spec, (0.0, None), n=5, method="growth")
    assert len(scenes.poses) == 5
