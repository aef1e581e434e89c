"""Requests: every form of a range, and what cannot be asked for."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import BAND, Range, SampleRequest, parse_phi, within_reach

NUMBERS = st.floats(-1e6, 1e6).map(lambda value: value + 0.0)


@pytest.mark.parametrize(
    "text, low, high",
    [
        ("0.05:0.2", 0.05, 0.2),
        ("task=0.05:0.2", 0.05, 0.2),
        ("0:", 0.0, None),
        ("task=:-.5", None, -0.5),
        (" task = +1. : 2e-0 ", 1.0, 2.0),
        ("-1E-2:1e-2", -0.01, 0.01),
        ("3:3", 3.0, 3.0),
    ],
)
def test_forms(text, low, high):
    assert parse_phi([text], ["task"]) == {"task": Range(low, high)}


def test_several_labels():
    ranges = parse_phi(["safe=0:", "task=0.1:0.2"], ["task", "safe", "free"])
    assert ranges == {"safe": Range(0.0), "task": Range(0.1, 0.2)}
    assert parse_phi([], ["task"]) == {}


@given(st.one_of(st.none(), NUMBERS), st.one_of(st.none(), NUMBERS), st.sampled_from(["", "task=", "safe="]))
def test_what_is_written_is_read(low, high, prefix):
    assume((low, high) != (None, None))
    text = ":".join("" if end is None else repr(end) for end in (low, high))
    labels = ["task", "safe"] if prefix else ["task"]
    name = prefix[:-1] or "task"
    if low is not None and high is not None and low > high:
        with pytest.raises(RequestError, match="reversed"):
            parse_phi([prefix + text], labels)
    else:
        assert parse_phi([prefix + text], labels) == {name: Range(low, high)}


@given(st.text(alphabet="0123456789.:=+-eEtasknif _", max_size=14))
def test_whatever_is_typed_is_read_or_refused(text):
    try:
        (wanted,) = parse_phi([text], ["task"]).values()
    except RequestError as error:
        (problem,) = error.diagnostics
        assert problem.help and problem.span is not None and problem.span.source.name == "phi"
        assert 0 <= problem.span.start <= len(text)
    else:
        ends = [end for end in (wanted.low, wanted.high) if end is not None]
        assert ends and all(map(math.isfinite, ends)) and ends == sorted(ends)


@pytest.mark.parametrize("text", ["inf:1", "0:nan", "1_000:2_000", "0x1:2", "١:٢", "1,5:2", "0..1:2", "1e:2", "--1:2"])
def test_what_python_takes_for_a_number_but_people_do_not(text):
    with pytest.raises(RequestError, match="is not a number"):
        parse_phi([text], ["task"])


def test_a_single_value_is_refused_with_a_band(exp1):
    with pytest.raises(RequestError, match=r"with probability 0[\s\S]*phi=\{\"task\": \(0\.0875, 0\.1125\)\}"):
        make_problem(exp1, SampleRequest({"task": Range(0.1, 0.1)}, n=1))
    with pytest.raises(RequestError, match=r"phi=\{\"safe\": \(-0\.25\d*, -0\.2375\)\}"):
        within_reach(SampleRequest({"safe": Range(-0.25, -0.25)}), {"safe": (-0.2500001, 1.0)})


def test_a_bound_that_is_only_touched_gets_a_warning_and_a_band():
    spec = check_text("closeTo(mug, plate, 0)")
    for wanted in (Range(0.0, 0.0), Range(0.0), Range(0.0, 0.5)):
        problem = make_problem(spec, SampleRequest({"task": wanted}, n=1))
        (warning,) = problem.warnings
        assert problem.request.phi == {"task": Range(-2 * BAND, 0.0)}
        assert warning.severity == "warning" and "sampling -0.025:0 instead" in warning.title
    lowest = make_problem(check_text("farFrom(mug, plate, 0)"), SampleRequest({"task": Range(None, 0.0)}, n=1)).request
    assert lowest.phi == {"task": Range(0.0, 2 * BAND)}


@pytest.mark.parametrize("wanted", [Range(1.0001, 2.0), Range(1.5), Range(None, -1.0001), Range(-3.0, -2.0)])
def test_ranges_beyond_the_bounds(exp1, wanted):
    with pytest.raises(RequestError, match=r"no scene can have phi of `task`[\s\S]*lies between -1 and 1"):
        make_problem(exp1, SampleRequest({"task": wanted}, n=1))


@pytest.mark.parametrize(
    "changes, said",
    [
        ({"n": 0}, "`n` is 0"),
        ({"n": -1}, "`n` is -1"),
        ({"seed": -1}, "`seed` is "),
        ({"seed": 2**63}, "`seed` is "),
        ({"spread": "base "}, "did you mean `base`"),
        ({"phi": {"tsak": Range(0.0)}}, "did you mean `task`"),
        ({"phi": {"task": Range(math.nan, 1.0)}}, "cannot end a range"),
        ({"phi": {"task": Range(0.0, math.inf)}}, "cannot end a range"),
        ({"phi": {"task": Range(0.2, 0.1)}}, "reversed"),
    ],
)
def test_requests_that_cannot_be(exp1, changes, said):
    with pytest.raises(RequestError, match=said):
        make_problem(exp1, SampleRequest(**changes))
