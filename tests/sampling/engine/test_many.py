"""Many independent jobs: what fails is named, the rest is done, and the number of workers changes nothing."""

import pytest

from scenegen.errors import RequestError
from scenegen.sampling.engine.engines import run_each, run_here

pytestmark = pytest.mark.usefixtures("interruptible")

ITEMS = [(f"n{number}", number) for number in range(7)]


def squares(ended):
    return [(one.name, one.value) for one in ended]


@pytest.mark.parametrize("workers", [1, 3])
def test_a_job_that_fails_does_not_stop_the_others(workers):
    import jobs

    found = list(run_each(jobs.Picky(bad=2), ITEMS, workers=workers))
    assert squares(found) == [(name, None if number == 2 else number * number) for name, number in ITEMS]
    assert [one.name for one in found if one.errors] == ["n2"] and found[2].errors[0].title
    assert squares(run_here(jobs.Picky(bad=2), ITEMS)) == squares(found)


@pytest.mark.long
@pytest.mark.parametrize("deadly", [0, 3, 6])
def test_a_job_that_ends_its_process_does_not_either(deadly):
    import jobs

    found = list(run_each(jobs.Picky(deadly=deadly, bad=4), ITEMS, workers=2))
    assert squares(found) == [(name, None if number in (deadly, 4) else number * number) for name, number in ITEMS]
    assert [one.errors[0].code for one in found if one.name == f"n{deadly}"] == ["process-died"]


def test_what_is_wrong_with_the_engine_is_raised():
    import jobs

    assert list(run_each(jobs.Picky(), [], workers=2)) == []
    for options, code in (({"workers": 0}, "out-of-range"), ({"engine": "rai"}, "unknown-engine")):
        with pytest.raises(RequestError) as caught:
            list(run_each(jobs.Picky(), ITEMS, **options))
        assert caught.value.diagnostics[0].code == code
