"""Where things usually are: what `usually` statements become, for which things, and how files carry recorded poses.
Their mistakes stand in golden/lang/errors/priors.txt."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.api.spec import load
from scenegen.errors import SpecError
from scenegen.geometry import NUMPY, Box
from scenegen.lang.check.priors import prior_text
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom, Const, Coord
from scenegen.lang.formula.interpret import Numbers, fold
from scenegen.lang.prior import Normal, Prior, Recorded, UniformHeading, UniformPlace

from ..laws import examples

LOGS = """mug.x, mug.y, mug.theta, saucer.x, saucer.y, saucer.theta, weather
0.1, 0.2, 0.5, 0.30000000000000004, 0.4, -1.0, fine
0.15, 0.25, 3.0, 0.35, 0.45, 1e-17, wet
"""


def priors(text):
    return check_text(text).priors


def one(text, things="mug, saucer"):
    (prior,) = priors(f"object {things}\n{text}\ntask: leftOf(mug, saucer)")
    return prior


def spec_with(folder, text, logs=LOGS, name="logs.csv"):
    (folder / name).write_text(logs)
    (folder / "my.spec").write_text(text)
    return load(folder / "my.spec").definition


def middles(prior, rows):
    values = fold(prior.nodes, Numbers(NUMPY, list(rows)))
    return [[values[node] for node in option.middle] for option in prior.options if isinstance(option, Normal)]


def test_a_normal_place():
    prior = one("usually mug ~ normal((40 cm, 0.3), 5 cm)")
    assert prior == Prior((0,), "place", (Normal((0, 1), 0.05),), (1.0,), (Const(0.4), Const(0.3)))


def test_a_place_relative_to_another_thing_and_to_numbers():
    assert one("usually mug ~ normal(saucer, 3 cm)").nodes == (Coord(1, 0), Coord(1, 1))
    rows = np.random.default_rng(0).uniform(size=(6, 5))
    prior = one("usually mug ~ normal((x(saucer) + 10 cm, 2 * y(saucer) - cos(theta(saucer)) * 1 m), 3 cm)")
    ((x, y),) = middles(prior, rows)
    assert x == pytest.approx(rows[3] + 0.1) and y == pytest.approx(2 * rows[4] - np.cos(rows[5]))


@pytest.mark.parametrize("middle", ["x(saucer) + {}", "1 - x(saucer) + {}", "min(x(saucer), 0.5) + {}"])
def test_a_relative_middle_lies_within_eight_deviations_of_the_workspace_somewhere(middle):
    def at(offset):
        return one(f"usually mug ~ normal(({middle.format(offset)}, y(saucer)), 10 cm)")

    assert at(1.79) and at(-1.29)
    for offset in (1.81, -2.31):
        with pytest.raises(SpecError, match="deviations or more away from where `mug` can be"):
            at(offset)


def test_a_middle_can_be_a_region_a_constant_or_a_definition():
    text = "region mat = rect(0, 0, 0.5, 0.2)\nconst P = (0.25, 0.1)\ndef spot(a) = (x(a), 10 cm)\nobject mug, saucer\n"
    task = "\ntask: leftOf(mug, saucer)"
    for middle, expected in (("mat", (0.25, 0.1)), ("mat.right", (0.5, 0.1)), ("P", (0.25, 0.1))):
        assert middles(priors(f"{text}usually mug ~ normal({middle}, 3 cm){task}")[0], []) == [list(expected)]
    (prior,) = priors(f"{text}usually mug ~ normal(spot(saucer), 3 cm){task}")
    assert prior.nodes == (Coord(1, 0), Const(0.1))


def test_a_thing_that_is_held_is_a_constant_of_those_relative_to_it():
    (prior,) = priors("object mug, tray at (0.5, 0.7)\nusually mug ~ normal(tray, 3 cm)\ntask: leftOf(mug, tray)")
    assert middles(prior, []) == [[0.5, 0.7]]


def test_headings():
    prior = one("usually theta(mug) ~ normal(NORTH, 10 deg)")
    assert prior.part == "heading" and prior.nodes == (Const(math.pi / 2),)
    assert prior.options[0].deviation == pytest.approx(math.radians(10))
    assert one("usually theta(mug) ~ normal(theta(saucer) + 90 deg, 0.1)").nodes[0] == Coord(1, 2)
    (turned,) = one("usually theta(mug) ~ uniform(350 deg, 370 deg)").options
    assert isinstance(turned, UniformHeading) and turned.low < math.tau < turned.high
    assert (turned.low, turned.high) == pytest.approx((math.radians(350), math.radians(370)))
    (whole,) = one("usually theta(mug) ~ uniform(0 deg, 360 deg)").options
    assert whole.high - whole.low <= math.tau


def test_a_region_also_at_a_height_and_the_workspace():
    text = "region {}\nobject mug, saucer\nusually mug ~ uniform({})\ntask: leftOf(mug, saucer)"
    (prior,) = priors(text.format("left = rect(0, 0, 0.5, 1) at 30 cm", "left"))
    assert prior.options == (UniformPlace("left", Box(0.5, 1.0), (0.25, 0.5, 0.0)),)
    (prior,) = priors(text.format("left = rect(0, 0, 0.5, 1)", "workspace"))
    assert prior.options[0].pose == (0.5, 0.5, 0.0)
    (prior,) = priors(text.format("rack[2] = circle((0.5, 0.5), 20 cm) at 10 cm, 40 cm", "rack[2]"))
    assert prior.options[0].region == "rack[2]" and prior.options[0].footprint.radius == pytest.approx(0.2)


def test_a_mixture_has_the_weights_that_were_written():
    prior = one("usually mug ~ [uniform(workspace): 0.7, normal(saucer, 2 cm): 0.2, normal((0.1, 0.1), 1 cm): 1]")
    assert prior.weights == (0.7, 0.2, 1.0)
    assert [type(option) for option in prior.options] == [UniformPlace, Normal, Normal]
    rows = np.full((6, 1), 0.25)
    assert middles(prior, rows) == [[0.25, 0.25], [0.1, 0.1]]


def test_each_of_several_things_and_each_element_has_a_draw_of_its_own():
    assert one("usually mug, saucer ~ normal((0.4, 0.3), 5 cm)").things == (0, 1)
    things = "saucer, block[3], mug"
    assert one("usually block ~ normal(mug, 5 cm)", things).things == (1, 2, 3)
    assert one("usually theta(block) ~ normal(NORTH, 5 deg)", things).things == (1, 2, 3)
    assert one("usually block[2] ~ normal(mug, 5 cm)", things).things == (2,)
    arm = "robot arm = panda\nobject mug, saucer\nusually arm ~ normal((0.5, 0.1), 5 cm)\ntask: leftOf(mug, saucer)"
    assert priors(arm)[0].things == (0,)


def test_members_leave_out_the_elements_that_they_lack():
    spec = check_text(
        "object block[1..3], mug\nusually block ~ normal(mug, 5 cm)\nusually theta(block[1]), theta(block[3]) ~ "
        "normal(NORTH, 5 deg)\ntask: forall b in block: leftOf(b, mug)"
    )
    assert [[prior.things for prior in member.priors] for member in spec.members] == [
        [(0,), (0,)],
        [(0, 1), (0,)],
        [(0, 1, 2), (0, 2)],
    ]
    assert spec.priors == spec.members[-1].priors
    for member in spec.members:
        assert check_text(member.source).priors == member.priors
    lonely = check_text("object block[1..2], mug\nusually block[2] ~ normal(mug, 5 cm)\ntask: leftOf(block[1], mug)")
    assert [len(member.priors) for member in lonely.members] == [0, 1]
    assert "usually" not in lonely.members[0].source


def test_an_object_of_a_category_is_named_as_it_is_declared():
    text = (
        'object saucer, mug of category("mug", [asset("red", box(0.1, 0.1, 0.1)), asset("blue", box(0.1, 0.1, 0.2))])\n'
        "usually mug ~ poses([(0.1, 0.2, 0.3)], 1 cm, 5 deg)\nusually saucer ~ normal(mug, 5 cm)\n"
        "task: leftOf(mug, saucer)"
    )
    spec = check_text(text)
    assert spec.objects == ("saucer", "mug:red", "mug:blue")
    assert spec.priors[0].things == (1, 2) and spec.priors[0].options[0].rows == (((0.1, 0.2, 0.3),) * 2,)
    for member in spec.members:
        assert [prior.things for prior in member.priors] == [(1,), (0,)]
        assert member.priors[1].nodes == (Coord(1, 0), Coord(1, 1))
        assert check_text(member.source).priors == member.priors


def test_recorded_poses_of_a_file_stand_in_the_canonical_text_to_the_last_bit(tmp_path):
    text = 'object mug, saucer\nusually mug, saucer ~ poses("logs.csv", 1 cm, 5 deg)\ntask: leftOf(mug, saucer)\n'
    spec = spec_with(tmp_path, text)
    (prior,) = spec.priors
    assert prior.part == "pose" and prior.things == (0, 1)
    (recorded,) = prior.options
    first, second = recorded.rows
    assert first == ((0.1, 0.2, 0.5), (0.30000000000000004, 0.4, math.tau - 1.0)) and second[1][2] == 1e-17
    assert recorded.reach == 0.01 and recorded.turn == pytest.approx(math.radians(5.0))
    again = check_text(spec.source)
    assert again.priors == spec.priors and again.source == spec.source and "logs.csv" not in spec.source


def test_one_thing_takes_its_columns_alone_and_other_columns_are_not_looked_at(tmp_path):
    spec = spec_with(
        tmp_path, 'object mug, plate\nusually mug ~ poses("logs.csv", 1 cm, 5 deg)\ntask: leftOf(mug, plate)'
    )
    assert [len(row) for row in spec.priors[0].options[0].rows] == [1, 1]
    assert "poses([(0.1, 0.2, 0.5), (0.15, 0.25, 3.0)], 1 cm, 5 deg)" in spec.source


def test_rows_of_arrays_have_a_pose_for_each_element_that_there_can_be(tmp_path):
    head = ",".join(f"block[{k}].{axis}" for k in (1, 2) for axis in ("x", "y", "theta"))
    logs = f"{head}\n0.1,0.2,0.3,0.4,0.5,0.6\n"
    text = 'object block[1..2], mug\nusually block ~ poses("logs.csv", 1 cm, 5 deg)\ntask: leftOf(block[1], mug)'
    spec = spec_with(tmp_path, text, logs)
    rows = [member.priors[0].options[0].rows for member in spec.members]
    assert rows == [(((0.1, 0.2, 0.3),),), (((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)),)]
    assert [one.priors for one in check_text(spec.source).members] == [one.priors for one in spec.members]
    assert [check_text(member.source).priors for member in spec.members] == [one.priors for one in spec.members]


def test_a_table_of_poses_is_found_from_the_file_that_names_it(tmp_path):
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "logs.csv").write_text(LOGS)
    (tmp_path / "room" / "usual.spec").write_text('usually mug ~ poses("logs.csv", 1 cm, 5 deg)\n')
    (tmp_path / "my.spec").write_text('import "room/usual.spec"\nobject mug, plate\ntask: leftOf(mug, plate)\n')
    assert load(tmp_path / "my.spec").definition.priors[0].options[0].rows[0] == ((0.1, 0.2, 0.5),)


BAD_TABLES = {
    "mug.x,mug.y\n0.1,0.2\n": ("table-column", "mug.theta"),
    "cup.x,cup.y,cup.theta\n0.1,0.2,0\n": ("table-column", "mug.x"),
    "mug.x,mug.y,mug.theta\n0.1,0.2,north\n": ("table-cell", "`north`, not a finite number"),
    "mug.x,mug.y,mug.theta\n0.1,0.2,\n": ("table-cell", "not a finite number"),
    "mug.x,mug.y,mug.theta\n0.1,0.2\n": ("table-row", "row 1 has 2 values"),
    "mug.x,mug.y,mug.theta\n": ("wrong-poses", "it has no rows"),
    "": ("wrong-poses", "it has no rows"),
    "mug.x,mug.y,mug.theta\n" + "0.1,0.2,0\n" * 10_001: ("wrong-poses", "10,001 rows of poses are more than 10,000"),
    "mug.x,mug.y,mug.theta\n300,200,0\n": ("prior-outside", "none of the 1 recorded rows"),
}


@pytest.mark.parametrize("logs", BAD_TABLES, ids=range(len(BAD_TABLES)))
def test_a_table_that_is_none_of_these_things(tmp_path, logs):
    code, part = BAD_TABLES[logs]
    with pytest.raises(SpecError) as refused:
        spec_with(
            tmp_path, 'object mug, plate\nusually mug ~ poses("logs.csv", 1 cm, 5 deg)\ntask: leftOf(mug, plate)', logs
        )
    (problem,) = refused.value.diagnostics
    assert problem.code == code and part in problem.title
    assert problem.span is not None and problem.span.text == '"logs.csv"'


def test_a_file_that_is_not_there_names_those_beside_it(tmp_path):
    with pytest.raises(SpecError) as refused:
        spec_with(tmp_path, 'object a, b\nusually a ~ poses("log.csv", 1 cm, 5 deg)\ntask: leftOf(a, b)')
    (problem,) = refused.value.diagnostics
    assert problem.code == "cannot-read-import" and "logs.csv" in problem.help


def test_a_table_that_is_not_text(tmp_path):
    (tmp_path / "logs.csv").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "my.spec").write_text('object a, b\nusually a ~ poses("logs.csv", 1 cm, 5 deg)\ntask: leftOf(a, b)')
    with pytest.raises(SpecError, match="not a text in UTF-8"):
        load(tmp_path / "my.spec")


@pytest.mark.parametrize(("cell", "column"), [("90", "theta"), ("15", "x")])
def test_units_that_can_hardly_be_meant_are_noticed(tmp_path, cell, column):
    row = {"x": "0.3", "y": "0.2", "theta": "0", column: cell}
    logs = f"mug.x,mug.y,mug.theta\n0.1,0.2,0\n{row['x']},{row['y']},{row['theta']}\n"
    spec = spec_with(
        tmp_path, 'object mug, plate\nusually mug ~ poses("logs.csv", 1 cm, 5 deg)\ntask: leftOf(mug, plate)', logs
    )
    (warning,) = spec.warnings
    assert warning.code == "doubtful-pose" and warning.facts["row"] == 2 and f"mug.{column}" in warning.title


def test_usually_is_a_name_elsewhere():
    text = "object usually, mug\nusually usually ~ normal(mug, 3 cm) usually theta(usually) ~ normal(NORTH, 1 deg)\n"
    spec = check_text(text + "normal: leftOf(usually, mug)\nuniform: closeTo(usually, mug)")
    assert spec.objects == ("usually", "mug") and [prior.things for prior in spec.priors] == [(0,), (0,)]
    assert check_text("object poses, normal\ndef uniform(a) = x(a)\ntask: uniform(poses) <= x(normal)").priors == ()


def test_what_only_usually_names_is_used():
    text = "region left = rect(0, 0, 0.5, 1)\nconst NEAR = 3 cm\ndef spot(a) = (x(a), 10 cm)\nobject mug, plate\n"
    text += "usually mug ~ [uniform(left): 1, normal(spot(plate), NEAR): 1]\ntask: leftOf(mug, plate)"
    assert check_text(text).warnings == ()


def test_the_formula_of_a_spec_does_not_depend_on_what_is_usual():
    text = "object mug, plate, cup\n{}task: leftOf(mug, plate) & closeTo(cup, (x(plate) + 10 cm, 0.2))"
    usual = "usually mug ~ normal((x(plate) + 10 cm, y(cup)), 3 cm)\n"
    plain, other = (check_text(text.format(said)).core for said in ("", usual))
    assert plain.labels == other.labels
    for one, same in zip(plain.nodes, other.nodes, strict=True):
        assert one == (replace(same, spans=one.spans) if isinstance(one, Atom) else same)


TEXTS = [
    ("mug ~ normal((0.4, 0.3), 5 cm)", "mug ~ normal((0.4, 0.3), 5 cm)"),
    ("mug ~ normal(saucer, 3 cm)", "mug ~ normal((x(saucer), y(saucer)), 3 cm)"),
    ("theta(mug), theta(saucer) ~ normal(NORTH, 10 deg)", "theta(mug), theta(saucer) ~ normal(90 deg, 10 deg)"),
    ("theta(mug) ~ normal(theta(saucer), 10 deg)", "theta(mug) ~ normal(theta(saucer), 10 deg)"),
    (
        "theta(mug) ~ [uniform(80 deg, 100 deg): 7, normal(SOUTH, 10 deg): 3]",
        "theta(mug) ~ [uniform(80 deg, 100 deg): 7, normal(270 deg, 10 deg): 3]",
    ),
    ("mug ~ [uniform(workspace): 1, normal((0.1, 0.1), 1 cm): 2]",) * 2,
    ("mug ~ poses([(0.1, 0.2, 0)], 1 cm, 5 deg)", "mug ~ poses(1 row, 1 cm, 5 deg)"),
]


@pytest.mark.parametrize(("written", "told"), TEXTS, ids=range(len(TEXTS)))
def test_what_check_prints_of_it(written, told):
    prior = one(f"usually {written}")
    objects = ("mug", "saucer")
    assert prior_text(prior, [objects[which] for which in prior.things], objects) == told


poses = st.tuples(*[st.floats(0.0, 1.0)] * 2, st.floats(0.0, math.tau, exclude_max=True))
options = st.one_of(
    st.builds("normal(({}, {}), {} cm)".format, *[st.floats(0.0, 1.0).map("{:.6f}".format)] * 2, st.integers(1, 50)),
    st.builds("normal((x(plate) - {} cm, {} cm), {} cm)".format, *[st.integers(1, 50)] * 3),
    st.builds("normal(plate, {} cm)".format, st.integers(1, 50)),
    st.just("uniform(workspace)"),
    st.just("uniform(left)"),
)


@settings(max_examples=examples(40), deadline=None, derandomize=True)
@given(st.lists(st.tuples(options, st.integers(1, 9)), min_size=1, max_size=4), st.lists(poses, min_size=1, max_size=4))
def test_canonical_text_means_the_same(mixture, rows):
    of = ", ".join(f"{option}: {weight}" for option, weight in mixture)
    recorded = ", ".join(f"({x!r}, {y!r}, {theta!r})" for x, y, theta in rows)
    spec = check_text(
        f"region left = rect(0, 0, 0.5, 1)\nobject mug, plate\nusually mug ~ [{of}]\n"
        f"usually plate ~ poses([{recorded}], 1 cm, 5 deg)\ntask: leftOf(mug, plate)"
    )
    again = check_text(spec.source)
    assert again.priors == spec.priors and again.source == spec.source
    (kept,) = spec.priors[1].options
    assert isinstance(kept, Recorded) and kept.rows == tuple(((x, y, theta),) for x, y, theta in rows)
    assert spec.priors[0].weights == tuple(float(weight) for _, weight in mixture)
