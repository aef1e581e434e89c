"""`base`, `load` and what the prelude says with them, where supports are choices: in each scene they are those of the
spec with the surfaces that the scene has."""

from itertools import product

import numpy as np
import pytest

from scenegen.errors import SpecError
from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import gated
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import chosen
from scenegen.pose import X, row_of

HEAD = """region shelf[2] = rect(0.1, 0.6, 0.9, 0.95) at 30 cm, 60 cm
region mat = rect(0.1, 0.1, 0.4, 0.4)
object tray{tray}, board, can{can}, jar{jar}, dice = box(2 cm, 2 cm, 2 cm){dice}
task: {task}
"""
OPTIONS = {
    "tray": ("shelf[1]", "workspace"),
    "can": ("tray", "board", "shelf[2]", "mat"),
    "jar": ("tray", "can", "workspace"),
    "dice": ("jar", "tray"),
}
TASKS = [
    "supported(can, 1 cm) & leftOf(can, tray)",
    "stable()",
    "stable([tray, can], 2 cm)",
    "z(base(can)) + x(base(jar)) <= 50 cm & dist(base(dice), can) <= 30 cm",
    "gap(base(can), jar) >= 1 cm",
    "restsOn(dice, base(jar)) | inside(dice, base(can))",
    "x(load(tray)) <= 0.5 & y(load(can)) <= 0.5",
    "forall p in objects: x(load(p)) <= 0.5",
    "atLevel(dice, base(jar)) & top(base(can)) <= 40 cm & leftOf(can, tray)",
]


@pytest.mark.parametrize("task", TASKS)
def test_in_each_scene_they_are_those_of_its_surfaces(task):
    among = {name: f" on any of [{', '.join(all_of)}]" for name, all_of in OPTIONS.items()}
    spec = check_text(HEAD.format(**among, task=task))
    rng = np.random.default_rng(5)
    rows = rng.uniform(size=(3 * len(spec.core.objects), 400))
    taken = {spec.objects[which]: chosen(choice, rows) for which, choice in spec.choices.items()}
    values = np.broadcast_to(phi(gated(spec.core), rows, NUMPY)["task"], 400)
    compared = 0
    for case in product(*(range(len(all_of)) for all_of in OPTIONS.values())):
        here = np.logical_and.reduce([taken[name] == one for name, one in zip(OPTIONS, case, strict=True)])
        on = {name: f" on {OPTIONS[name][one]}" for name, one in zip(OPTIONS, case, strict=True)}
        if not here.any():
            continue
        alone = check_text(HEAD.format(**on, task=task))
        wanted = np.broadcast_to(phi(gated(alone.core), rows[: 3 * len(spec.objects), here], NUMPY)["task"], here.sum())
        np.testing.assert_allclose(values[here], wanted, rtol=0.0, atol=1e-12)
        compared += int(here.sum())
    assert compared == 400
    assert len({row_of(one.switch, X) for one in spec.choices.values()}) == 4


def test_a_load_takes_surfaces_of_one_carrier_together():
    text = "object shelfunit, can[8] on any of [shelfunit.shelf[1], shelfunit.shelf[2], workspace]\nrequire stable()\n"
    spec = check_text(f"{text}task: leftOf(can[1], shelfunit)")  # 3 ** 8 choices, 2 ** 8 cases
    assert len(spec.choices) == 8


@pytest.mark.parametrize("task", ["theta(base(can)) <= 1", "apart(tray, base(can)) >= 0", "base(can) <= 1"])
def test_what_makes_no_sense_of_surfaces_makes_none_of_those(task):
    with pytest.raises(SpecError, match="surface that differs from scene to scene"):
        check_text(f"object tray, can on any of [tray, workspace]\ntask: {task}")


@pytest.mark.parametrize("lower", ["plate", "bowl", "pot", "tray"])
def test_what_was_declared_to_stand_somewhere_rests_there(lower):
    spec = check_text(f"object {lower}, apple on {lower}\ntask: restsOn(apple, {lower}) & insideOf(apple, {lower})")
    rows = np.full((6, 1), 0.5)
    assert phi(spec.core, rows, NUMPY)["task"][0] >= 0.0


def test_a_bowl_rests_on_the_plate_that_it_stands_in():
    spec = check_text("object plate, bowl on plate\ntask: restsOn(bowl, plate)")
    assert phi(spec.core, np.full((6, 1), 0.5), NUMPY)["task"][0] == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("object bowl, plate\ntask: restsOn(bowl, plate) | leftOf(bowl, plate)", True),
        ("object tray, mug on tray, plate\ntask: stackedOn(mug, plate) | leftOf(mug, plate)", True),
        ("object shelfunit, can\ntask: restsOn(can, shelfunit.shelf[2]) | leftOf(can, shelfunit)", True),
        ("object bowl on any of [workspace, plate], plate\ntask: restsOn(bowl, plate)", False),
        ("object bowl on plate, plate, apple on bowl\ntask: insideOf(apple, plate) | leftOf(apple, plate)", False),
        ("object block[3], plate\ntask: exists b in block: restsOn(b, plate) | leftOf(b, plate)", False),
        ("region mat = rect(0, 0, 0.5, 0.5)\nobject can, jar\ntask: restsOn(can, mat) & leftOf(can, jar)", False),
        ("def restsOn(a, b) = leftOf(a, b)\nobject can, jar\ntask: restsOn(can, jar)", False),
    ],
)
def test_what_can_never_rest_there_is_noticed(text, told):
    codes = [one.code for one in check_text(text).warnings]
    assert codes.count("stands-elsewhere") == int(told)
