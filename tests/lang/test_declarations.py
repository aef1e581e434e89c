"""What declarations mean: arrays, lists, regions, objects held in place, requirements, labels in labels. `object mug
of category("mug")`: members have one asset each, and scenes, files and formulas agree on which. Random numbers of
things: what a spec with them means, and what is wrong with one.
"""

import json
import math

import numpy as np
import pytest

import scenegen
from scenegen.errors import DataError, RequestError, ScenegenError, Source, SpecError
from scenegen.geometry import Box, Circle, Polygon
from scenegen.lang.checker import check_module, check_text
from scenegen.lang.spec import combinations, members_of, numbers_text
from scenegen.lang.syntax.parse import parse

from .worth import alike, problems, worth

A, B, C = (0.25, 0.5, 0.0), (0.75, 0.125, 0.5), (0.5, 1.0, math.pi)
THREE = "object block[3]\n"


def test_elements_are_objects_in_storage_order():
    spec = check_text("object mug, block[3], cup[1]\ntask: leftOf(block[2], cup[1])")
    assert spec.objects == ("mug", "block[1]", "block[2]", "block[3]", "cup[1]")
    assert worth(f"{THREE}task: leftOf(block[1], block[3])", A, B, C) == 0.5 - 0.25
    assert worth(f"{THREE}task: leftOf(block[1 + 1], block.last)", A, B, C) == 0.5 - 0.75
    assert worth(f"{THREE}task: x(block.first) * block.count <= 1", A, B, C) == 1 - 0.25 * 3
    assert worth(f"object mug\n{THREE}task: leftOf(objects[1], objects.last)", A, B, B, C) == 0.5 - 0.25


def test_the_number_of_elements_is_a_constant_expression():
    spec = check_text(
        "const N = 2\nobject block[2 * N + 1] = box(N * 1 cm, 4 cm, 5 cm)\ntask: leftOf(block[5], block[1])"
    )
    assert len(spec.objects) == 5
    assert {looks.footprint for looks in spec.shapes} == {Box(0.02, 0.04)}
    assert problems("object block[n]\nconst n = block.count\ntask: leftOf(block[1], block[2])") == [
        "`block` is not a constant"
    ]


@pytest.mark.parametrize("count", ["0", "-1", "2.5", "3 cm", "x(mug)", "1e308", "1e400", "block", '"3"', "true"])
def test_what_cannot_count(count):
    assert len(problems(f"object mug, block[{count}]\ntask: leftOf(mug, block[1])")) == 1


def test_lists_hold_anything_and_nest():
    lists = "object a[2], b[2]\nconst ROWS = [a, b]\n"
    assert alike(f"{lists}task: leftOf(ROWS[1][2], ROWS.last.first)", "object a[2], b[2]\ntask: leftOf(a[2], b[1])")
    each = f"{lists}task: forall row in ROWS: forall p, q in row: leftOf(p, q)"
    assert alike(each, "object a[2], b[2]\ntask: leftOf(a[1], a[2]) & leftOf(b[1], b[2])")
    numbers = "object a, b\nconst STEPS = [10 cm, 0.2, 2 * 15 cm]\ntask: closeTo(a, b, STEPS[3]) & x(a) <= sum(STEPS)"
    assert alike(numbers, "object a, b\ntask: closeTo(a, b, 30 cm) & x(a) <= 10 cm + 0.2 + 30 cm")
    places = "object a\nconst CORNERS = [(0, 0), (1, 1)]\ntask: forall c in CORNERS: farFrom(a, c, 0.1)"
    assert alike(places, "object a\ntask: farFrom(a, (0, 0), 0.1) & farFrom(a, (1, 1), 0.1)")
    formulas = "object a, b\ndef all(items) = forall f in items: f\ntask: all([leftOf(a, b), aboveOf(a, b)])"
    assert alike(formulas, "object a, b\ntask: leftOf(a, b) & aboveOf(a, b)")


def test_folds_take_numbers_or_a_list():
    assert worth("object a, b\ntask: mean([x(a), x(b), 1]) <= max(x(a), y(a))", A, B) == 0.5 - (0.25 + 0.75 + 1) / 3
    assert worth("object a[3]\ntask: min(gaps(a)) >= -1", A, B, C) == pytest.approx(
        1 + min(check_gap(A, B), check_gap(B, C)), abs=1e-12
    )


def check_gap(one, other):
    """Of two things that the library does not know and that stand far apart: blocks of 5 cm. By brute force."""

    def outline(pose):
        corners = [(0.025, 0.025), (-0.025, 0.025), (-0.025, -0.025), (0.025, -0.025)]
        turned = [
            (x * math.cos(pose[2]) - y * math.sin(pose[2]), x * math.sin(pose[2]) + y * math.cos(pose[2]))
            for x, y in corners
        ]
        return [(pose[0] + x, pose[1] + y) for x, y in turned]

    def to_segment(p, a, b):
        along = ((p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])) / math.dist(a, b) ** 2
        along = min(max(along, 0.0), 1.0)
        return math.dist(p, (a[0] + along * (b[0] - a[0]), a[1] + along * (b[1] - a[1])))

    first, second = outline(one), outline(other)
    ways = [(p, side) for p in first for side in zip(second, second[1:] + second[:1], strict=True)]
    ways += [(p, side) for p in second for side in zip(first, first[1:] + first[:1], strict=True)]
    return min(to_segment(p, *side) for p, side in ways)


MEMBERS = [
    ("mat.left", (0.25, 0.5)),
    ("mat.right", (0.75, 0.5)),
    ("mat.top", (0.5, 0.75)),
    ("mat.bottom", (0.5, 0.25)),
    ("mat.center", (0.5, 0.5)),
    ("mat", (0.5, 0.5)),
    ("mat.topLeft", (0.25, 0.75)),
    ("mat.bottomRight", (0.75, 0.25)),
    ("mat.corners[3]", (0.75, 0.75)),
    ("mat.corners.first", (0.25, 0.25)),
    ("disc.left", (0.25, 0.25)),
    ("disc.top", (0.5, 0.5)),
    ("disc", (0.5, 0.25)),
    ("wedge.right", (1.0, 0.25)),
    ("wedge.top", (0.5, 0.5)),
    ("wedge", (1.0 / 3.0, 0.5 / 3.0)),
    ("wedge.corners[2]", (1.0, 0.0)),
    ("workspace.topRight", (2.0, 1.0)),
    ("workspace", (0.5, 0.5)),
]
PLACES = """workspace [-1, 2] x [0, 1]
region mat = rect(0.25, 0.25, 0.75, 0.75)
region disc = circle((0.5, 0.25), 25 cm)
region wedge = polygon([(0, 0), (1, 0), (0, 0.5)])
object a
"""


@pytest.mark.parametrize(("place", "where"), MEMBERS)
def test_places_of_regions(place, where):
    assert worth(f"{PLACES}task: x(a) <= x({place})", A) == where[0] - A[0]
    assert worth(f"{PLACES}task: y(a) <= y({place})", A) == where[1] - A[1]


def test_sizes_of_regions():
    assert worth(f"{PLACES}task: x(a) <= wedge.width + 2 * disc.height + workspace.width", A) == 5.0 - 0.25
    spec = check_text(f"{PLACES}task: inside(a, mat)")
    assert [(one.name, one.footprint) for one in spec.regions[:2]] == [("mat", Box(0.5, 0.5)), ("disc", Circle(0.25))]
    assert isinstance(spec.regions[2].footprint, Polygon) and spec.regions[0].pose == (0.5, 0.5, 0.0)


def test_regions_may_be_built_from_regions():
    text = "region b = rect(a.left2, 0, 1, 1)\nregion a = circle((0.5, 0.5), 0.1)\ntask: leftOf(m, b)"
    assert problems(text.replace("left2", "nowhere")) == ["`a` has no `.nowhere`"]
    built = "region b = circle(a.topLeft, a.width / 4)\nregion a = rect(0.25, 0.25, 0.75, 0.75)\ntask: inside(m, b)"
    assert alike(
        built, "region b = circle((0.25, 0.75), 0.125)\nregion a = rect(0.25, 0.25, 0.75, 0.75)\ntask: inside(m, b)"
    )


def test_objects_held_in_place_are_constants():
    text = "object tray at (0.5, 0.75, 90 deg), mug, wall at (0.125, 0.25)\n"
    spec = check_text(f"{text}task: leftOf(mug, tray) & angle(mug, theta(tray))")
    assert spec.fixed == {0: (0.5, 0.75, math.pi / 2), 2: (0.125, 0.25, 0.0)}
    free = "object tray, mug, wall\n"
    for task in (
        "leftOf(mug, tray)",
        "closeTo(tray, mug, 0.3)",
        "angle(mug, theta(tray))",
        "gap(mug, tray) >= dist(wall, tray)",
    ):
        held = worth(f"{text}task: {task}", (9.0, 9.0, 9.0), A, (9.0, 9.0, 9.0))
        assert held == worth(f"{free}task: {task}", (0.5, 0.75, math.pi / 2), A, (0.125, 0.25, 0.0)), task


def test_an_array_is_held_by_a_list_of_places():
    spec = check_text(
        "const SPOTS = [(0.25, 0.5), (0.75, 0.5)]\nobject leg[2] at SPOTS, mug\ntask: leftOf(leg[1], mug)"
    )
    assert spec.fixed == {0: (0.25, 0.5, 0.0), 1: (0.75, 0.5, 0.0)}
    spec = check_text("object leg[2] at [(0.25, 0.5, 450 deg), workspace.center], mug\ntask: leftOf(leg[1], mug)")
    assert spec.fixed[1] == (0.5, 0.5, 0.0) and spec.fixed[0][2] == pytest.approx(math.pi / 2)


def test_what_is_required_is_no_part_of_phi():
    text = "object a, b\nrequire leftOf(a, b)\nrequire aboveOf(a, b) | y(b) >= 1\ntask: closeTo(a, b, 1)"
    assert worth(text, A, B) == 1 - 0.625
    assert worth(text, A, B, label="require") == min(0.5, max(0.375, -0.875))
    assert check_text("require true\ntask: leftOf(a, b)").core.requirement is None
    assert problems(
        "object a at (0, 0), b at (1, 1), c\nrequire rightOf(a, b)\nrequire leftOf(a, c)\ntask: leftOf(c, b)"
    ) == ["this can never hold"]


def test_labels_in_labels_through_definitions():
    text = (
        "object a, b\nboth: near() & left\ndef near(e = SLACK) = closeTo(a, b, e)\nconst SLACK = 1\nleft: leftOf(a, b)"
    )
    assert worth(text, A, B, label="both") == min(1 - 0.625, 0.5)
    circle = "a1: f()\ndef f() = g(mug)\ndef g(p) = leftOf(p, plate) & a2\na2: !a1"
    assert problems(circle) == ["`f` is defined by itself"]
    assert problems("region r = circle(p(), 0.1)\ndef p() = r.center\ntask: leftOf(a, r)") == [
        "`r` is defined by itself"
    ]


def test_defaults_are_evaluated_where_the_definition_stands():
    text = "object e, a\nconst STEP = 0.5\ndef f(p, e = STEP) = x(p) <= e\ntask: f(a)\nother: f(a, e = 1)"
    assert worth(text, B, A) == 0.25 and worth(text, B, A, label="other") == 0.75
    # a parameter of the caller is not seen by the default of the called
    inner = "def g(p, STEP) = f(p)\nconst STEP = 0.5\ndef f(p, e = STEP) = x(p) <= e\ntask: g(a, 9)"
    assert worth(inner, A) == 0.25


@pytest.mark.parametrize(
    "name", "None True self __class__ leftOf sub neg add min x theta sin gap box rect import_".split()
)
def test_no_name_of_the_program_is_special_to_an_object(name):
    assert alike(
        f"object {name}, other\ntask: leftOf({name}, other)", f"object {name}, other\ntask: x({name}) <= x(other)"
    )


@pytest.mark.parametrize("name", ["add", "sub", "mul", "div", "neg"])
def test_operators_have_no_names(name):
    assert problems(f"task: {name}(x(a), x(b)) <= 1") == [f"unknown relation `{name}`"]
    assert worth(f"def {name}(a, b) = x(a) <= x(b)\ntask: {name}(a, b)", A, B) == 0.5


def test_elements_of_arrays_have_places_in_a_row() -> None:
    found: list[dict[str, int]] = []
    module = parse(Source("<spec>", "object a, b[3], c\nlabel: leftOf(a, c) & leftOf(b[1], b[3]) & leftOf(b[2], c)"))
    check_module(module, None, lambda lowering: found.append(dict(lowering.scope.objects)))
    assert found == [{"a": 0, "b[1]": 1, "b[2]": 2, "b[3]": 3, "c": 4}]


A_CATEGORIES, B_CATEGORIES, C_CATEGORIES = (
    'asset("red", box(0.1, 0.06, 0.2))',
    'asset("blue", cylinder(0.04, 0.1))',
    'asset("set/green", box(0.3, 0.3, 0.1))',
)
TWO, THREE_CATEGORIES = (
    f'category("mug", [{A_CATEGORIES}, {B_CATEGORIES}])',
    f'category("set/mug", [{A_CATEGORIES}, {B_CATEGORIES}, {C_CATEGORIES}])',
)
TASK = "task: leftOf(mug, plate)"


def parsed(kind=TWO, more="", task=TASK):
    return scenegen.parse(f"object mug of {kind}{more}, plate\n{task}")


def test_each_member_has_one_asset_and_the_spec_has_all():
    spec = parsed(THREE_CATEGORIES)
    checked = spec.definition
    assert spec.objects == ("mug:red", "plate", "mug:blue", "mug:green")
    assert spec.assets == {"mug": ("red", "blue", "green")} and spec.counts == {"mug": (1, 3)}
    assert [one.objects for one in checked.members] == [(f"mug:{name}", "plate") for name in ("red", "blue", "green")]
    assert [one.shapes[0].height for one in checked.members] == [0.2, 0.1, 0.1]
    assert list(map(numbers_text, combinations(checked.counts))) == ["mug:red", "mug:blue", "mug:green"]
    again = scenegen.parse(spec.source)
    assert again.source == spec.source and again.definition.shapes == checked.shapes


def test_elements_of_an_array_are_drawn_by_themselves_and_beside_numbers():
    text = f"object cup[2] of {TWO}, block[1..3], plate\ntask: forall c in cup: leftOf(c, block[1])"
    checked = scenegen.parse(text).definition
    assert len(checked.members) == 12 and checked.members[0].objects[:2] == ("cup[1]:red", "cup[2]:red")
    some = members_of(checked)
    for number, (member, rows) in enumerate(zip(some.specs, some.rows, strict=True)):
        scene = np.full((3 * len(checked.objects), 1), np.nan)
        scene[rows] = 0.5
        ((found, which),) = some.split(scene)
        assert found == number and list(which) == [0]
        assert [checked.objects[row // 3] for row in rows[::3]] == list(member.objects)


def test_one_asset_is_fixed_by_name_or_number_and_the_text_says_so():
    spec = scenegen.parse(f"object cup[2] of {TWO}, plate\ntask: leftOf(cup[1], plate)")
    one = spec.with_counts({"cup[2]": "blue"})
    assert one.counts == {"cup[1]": (1, 2)} and one.source.count("[0, 2]") == 1
    both = one.with_counts({"cup[1]": 1})
    assert both.objects == ("cup[1]:red", "cup[2]:blue", "plate") and not both.counts
    assert both.checked.shapes[1].height == 0.1
    assert scenegen.parse(both.source).objects == both.objects
    alone = parsed(f'category("mug", [{A_CATEGORIES}])')
    assert not alone.counts and alone.checked.objects == ("mug:red", "plate")
    for counts, code in (
        ({"cup[1]": "green"}, "wrong-count"),
        ({"cup[1]": 3}, "wrong-count"),
        ({"cup": 1}, "wrong-count"),
    ):
        with pytest.raises(ScenegenError) as caught:
            spec.with_counts(counts)
        assert caught.value.diagnostics[0].code == code


def test_scenes_are_drawn_in_equal_shares_and_files_say_which(tmp_path):
    spec = parsed(THREE_CATEGORIES)
    scenes = scenegen.sample(spec, {"task": (0.0, 0.4)}, n=12, seed=4)
    assert sorted(scenes.assets["mug"]) == ["blue"] * 4 + ["green"] * 4 + ["red"] * 4
    assert np.array_equal(np.isnan(scenes.poses).any(axis=(1, 2)), np.ones(12)) and scenes.phi["task"].min() >= 0.0
    other = scenegen.sample(spec, {"task": (0.0, 0.4)}, n=12, seed=5)
    assert other.assets != scenes.assets
    for ending in ("json", "jsonl", "parquet"):
        read = scenegen.read_scenes(scenes.save(tmp_path / f"s.{ending}"))
        assert read.assets == scenes.assets and np.array_equal(read.poses, scenes.poses, equal_nan=True)
    line = json.loads((tmp_path / "s.jsonl").read_text().splitlines()[1])
    name = scenes.assets["mug"][0]
    assert line["counts"] == {"mug": ("red", "blue", "green").index(name) + 1} and f"mug:{name}" in line["poses"]
    header = scenes.header.model_dump(mode="json")["counts"]
    assert header == [{"name": "mug", "least": 1, "most": 3, "assets": ["red", "blue", "green"]}]


def test_files_that_disagree_with_themselves_are_refused(tmp_path):
    file = tmp_path / "s.json"
    scenegen.sample(parsed(), {}, n=2, seed=1).save(file)
    whole = json.loads(file.read_text())
    scene = next(one for one in whole["scenes"] if one["counts"]["mug"] == 1)

    def refused(change):
        data = json.loads(json.dumps(whole))
        change(data, data["scenes"][whole["scenes"].index(scene)])
        file.write_text(json.dumps(data))
        with pytest.raises(DataError):
            scenegen.read_scenes(file)

    refused(lambda data, one: one["counts"].update(mug=2))
    refused(lambda data, one: one["counts"].update(mug=3))
    refused(lambda data, one: one["poses"].update({"mug:blue": one["poses"]["mug:red"]}))
    refused(lambda data, one: one["poses"].pop("mug:red"))
    refused(lambda data, one: data["counts"][0]["assets"].reverse() or data["counts"][0].update(assets=["red", "red"]))
    refused(lambda data, one: data["counts"][0].update(assets=["red", "pink"]))
    refused(lambda data, one: data["counts"][0].update(least=2))


def test_it_is_held_by_its_own_name_whichever_it_is():
    scenes = scenegen.sample(parsed(), {}, n=4, seed=1, fix={"mug": (0.3, 0.2)})
    there = scenes.poses[:, [0, 2], :2]
    assert np.allclose(there[~np.isnan(there).any(axis=2)], (0.3, 0.2))
    with pytest.raises(ScenegenError) as caught:
        scenegen.sample(parsed(), {}, n=1, fix={"mug:red": (0.3, 0.2)})
    assert caught.value.diagnostics[0].code == "cannot-be-held"
    picked = parsed().with_counts({"mug": "blue"})
    assert np.allclose(scenegen.sample(picked, {}, n=1, fix={"mug": (0.3, 0.2)}).poses[0, 0, :2], (0.3, 0.2))


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (f"object mug[1..2] of {TWO}, plate\ntask: leftOf(mug[1], plate)", "not-of-category"),
        (f"time 5 steps\nobject mug of {TWO}, plate\ntask: eventually leftOf(mug, plate)", "not-of-category"),
        (f"object mug of {TWO} on any of [tray, workspace], tray\ntask: leftOf(mug, tray)", "not-of-category"),
        (f"object mug of {TWO}, apple on mug.top\ntask: leftOf(mug, apple)", "depends-on-number"),
        (f"object mug[4] of {THREE_CATEGORIES}, plate\ntask: leftOf(mug[1], plate)", "too-many-counts"),
        (f"object mug of {TWO}, cup[3] of {THREE_CATEGORIES}, b[1..2]\ntask: leftOf(mug, b[1])", "too-many-counts"),
        ('object mug of category("mug")\ntask: x(mug) <= 0.5', "spec-without-file"),
        ("object mug of category(mug)\ntask: x(mug) <= 0.5", "file-without-quotes"),
        ("object mug of category()\ntask: x(mug) <= 0.5", "wrong-number-of-arguments"),
        ('object mug of category("mug", most = 0)\ntask: x(mug) <= 0.5', "not-a-category"),
        ('object mug of category("mug", seed = 1.5)\ntask: x(mug) <= 0.5', "not-a-category"),
        ('object mug of category("mug", [])\ntask: x(mug) <= 0.5', "not-a-category"),
        ('object mug of category("mug", [box(1, 1, 1)])\ntask: x(mug) <= 0.5', "not-a-category"),
        (f'object mug of category("mug", [{A_CATEGORIES}, {A_CATEGORIES}])\ntask: x(mug) <= 0.5', "not-a-category"),
        (f'object mug of category("mug", [{A_CATEGORIES}], [2])\ntask: x(mug) <= 0.5', "not-a-category"),
        (f'object mug of category("mug", [{A_CATEGORIES}], [0, 1])\ntask: x(mug) <= 0.5', "not-a-category"),
    ],
)
def test_what_cannot_be_says_so(text, code):
    with pytest.raises(ScenegenError) as caught:
        scenegen.parse(text)
    assert [one.code for one in caught.value.diagnostics] == [code]


def test_what_takes_the_same_objects_in_every_scene_names_the_way_out():
    with pytest.raises(ScenegenError) as caught:
        assert parsed().checked
    (one,) = caught.value.diagnostics
    assert one.code == "numbers-not-here" and "`--count mug=red`" in one.help


def test_of_is_a_name_everywhere_else():
    spec = scenegen.parse("object of, category\nconst a = 1 cm\ntask: leftOf(of, category)")
    assert spec.objects == ("of", "category")


def index(folder, names):
    (folder / "a.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n")
    entry = '[[asset]]\nname = "{}"\nfile = "a.obj"\ncategory = ["mug", "{}"]\n'
    (folder / "assets.toml").write_text("".join(entry.format(name, name[0]) for name in names))


def test_categories_come_from_the_index_and_large_ones_in_part(tmp_path):
    names = [f"m{k}" for k in range(70)] + ["k1", "k2"]
    index(tmp_path, names)

    def assets(text):
        (tmp_path / "a.spec").write_text(f"object mug of {text}, plate\n{TASK}")
        return scenegen.load(tmp_path / "a.spec").assets["mug"]

    assert assets('category("k")') == ("k1", "k2")
    some = assets('category("mug", most = 5, seed = 1)')
    assert len(some) == 5 and some != assets('category("mug", most = 5, seed = 2)')
    index(tmp_path, [*names, "z"])
    assert len({*some} - {*assets('category("mug", most = 5, seed = 1)')}) <= 1
    for text, code, words in (
        ('category("mug")', "too-many-counts", "most = 4"),
        ('category("mugs")', "unknown-asset", "did you mean `mug`?"),
        ('category("sub/mug")', "asset-index", "sub/assets.toml"),
    ):
        with pytest.raises(ScenegenError) as caught:
            assets(text)
        (one,) = caught.value.diagnostics
        assert one.code == code and words in f"{one.title} {one.help}"


FAMILY = "object block[2..4], cup[1..2], mug\nrequire noOverlap(objects)\ntask: forall b in block: leftOf(b, mug)\n"


@pytest.mark.parametrize(
    ("formulas", "code"),
    [
        ("require block.count >= 3\ntask: leftOf(block[1], mug)", "constant-label"),
        ("require block.count >= 6\ntask: leftOf(block[1], mug)", "impossible-requirement"),
        ("require block.count != 4 & 4 <= block.count <= 4\ntask: leftOf(block[1], mug)", "impossible-requirement"),
        ("task: 1 <= 2", "constant-label"),
        ("require block.count >= 4\ntask: leftOf(block[1], mug)", None),
        ("require block.count != 4\ntask: leftOf(block[1], mug)", None),
        ("many: block.count >= 4", None),
    ],
)
def test_what_is_constant_or_impossible_is_judged_over_all_numbers(formulas, code):
    text = f"object block[3..5], mug\n{formulas}"
    if code is None:
        check_text(text)
        return
    with pytest.raises(SpecError) as error:
        check_text(text)
    assert [one.code for one in error.value.diagnostics] == [code]


def test_a_family_has_an_ordinary_spec_for_each_combination():
    spec = scenegen.parse(FAMILY)
    assert spec.counts == {"block": (2, 4), "cup": (1, 2)}
    assert [tuple(numbers.values()) for numbers, _ in spec.members] == [(2, 1), (2, 2), (3, 1), (3, 2), (4, 1), (4, 2)]
    for numbers, member in spec.members:
        plain = scenegen.parse(FAMILY.replace("2..4", str(numbers["block"])).replace("1..2", str(numbers["cup"])))
        assert member.source == plain.source and member.objects == plain.objects
        mine, theirs = member.checked.core, plain.checked.core
        assert (mine.objects, mine.labels, mine.requirement) == (theirs.objects, theirs.labels, theirs.requirement)
        assert len(mine.nodes) == len(theirs.nodes)  # which say where they stand in the text
    assert spec.objects == member.objects, "all that there can be"
    assert spec.bounds() == {"task": (-1.0, 1.0)}


def test_what_is_printed_is_read_again():
    spec = scenegen.parse(
        "const N = 3 object block[N - 1..N+1] = box(4 cm, 4 cm, 4 cm), mug task: leftOf(mug, block[1])"
    )
    assert "block[N - 1..N + 1]" in spec.source
    again = scenegen.parse(spec.source)
    assert again.source == spec.source and again.counts == spec.counts == {"block": (2, 4)}


def test_a_number_is_fixed_and_the_others_are_drawn():
    spec = scenegen.parse("# Blocks\n" + FAMILY)
    some = spec.with_counts({"block": 3})
    assert some.counts == {"cup": (1, 2)} and "block[3], cup[1..2]" in some.source
    assert some.definition.title == "Blocks"
    assert not some.with_counts({"cup": 1}).counts and spec.with_counts({}) is spec
    for counts, code in (
        ({"blok": 3}, "wrong-count"), ({"block": 5}, "wrong-count"), ({"mug": 1}, "wrong-count"),
        ({"block": 2.5}, "wrong-value"), ([3], "wrong-value"),
    ):  # fmt: skip
        with pytest.raises(RequestError) as error:
            spec.with_counts(counts)
        assert error.value.diagnostics[0].code == code


def test_what_knows_nothing_of_families_refuses_them():
    with pytest.raises(RequestError, match="draws how many things there are"):
        _ = scenegen.parse(FAMILY).checked


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        ("object b[3..2], m task: leftOf(m, b[1])", "empty-range", "3..2"),
        ("object b[0..2], m task: leftOf(m, b[1])", "empty-array", "0 elements"),
        ("object b[-1..2], m task: leftOf(m, b[1])", "empty-array", "-1"),
        ("object b[1.5..3], m task: leftOf(m, b[1])", "not-a-whole-number", "1.5"),
        ("object b[2..3 cm], m task: leftOf(m, b[1])", "wrong-unit", "a length"),
        ("object b[1..m], m task: leftOf(m, b[1])", "wrong-name", "`m`"),
        ("object b[1..1000000000], m task: leftOf(m, b[1])", "too-many-objects", "20,000"),
        ("object b[1..2e300], m task: leftOf(m, b[1])", "too-many-objects", "20,000"),
        ("object b[1..65], m task: leftOf(m, b[1])", "too-many-counts", "65 combinations"),
        ("object a[1..9], b[1..9] task: leftOf(a[1], b[1])", "too-many-counts", "81 combinations"),
        ("object b[2..4], m task: leftOf(m, b[3])", "may-be-missing", "`b[3]` may be missing"),
        ("object b[2..4], m task: leftOf(m, b[5])", "index-out-of-range", "5 of 4"),
        ("object b[2..4], m task: forall i in 1..4: leftOf(b[i], m)", "may-be-missing", "`b[3]`"),
        ("object b[2..4] def f(c) = leftOf(c[1], c[3]) task: f(b)", "index-out-of-range", "with b[2]"),
        ("object b[1..3], m task: forall p, q in b: leftOf(p, q)", "too-few-elements", "with b[1]"),
        ("object b[1..2] at [(0.1, 0.1), (0.2, 0.2)], m task: leftOf(m, b[1])", "wrong-number-of-places", "b[1]"),
        ("object b[1..2] = box(b.count * 5 cm, 1 cm, 1 cm), m task: leftOf(m, b[1])", "depends-on-number", "shape"),
        ("object b[1..2], m region r = rect(0, 0, b.count * 0.1, 1) task: inside(m, r)", "depends-on-number", "region"),
        ("object b[1..2], m at (b.count * 0.1, 0) task: leftOf(m, b[1])", "depends-on-number", "place of `m`"),
        ("region r[1..2] = rect(0, 0, 1, 1) at 3 cm object a, b task: leftOf(a, b)", "level-count", "levels"),
        ("time 5 steps object b[1..2], a task: always leftOf(b[1], a)", "no-place-over-time", "over time"),
        ("object b[2..], m task: leftOf(m, b[1])", "unexpected", "`]`"),
    ],
)  # fmt: skip
def test_a_mistake_gets_a_diagnostic(text, code, said):
    with pytest.raises(SpecError) as error:
        scenegen.parse(text)
    (one,) = error.value.diagnostics
    assert one.code == code
    assert said in "\n".join([one.title, one.label, one.help, one.note])


def test_a_range_of_one_number_draws_nothing():
    spec = scenegen.parse("object b[3..3], m task: leftOf(m, b[3])")
    assert [one.code for one in spec.warnings] == ["one-number"]
    assert not spec.counts and spec.source == "object b[3], m\ntask: leftOf(m, b[3])\n"


def test_the_last_of_them_is_another_one_with_another_number():
    spec = scenegen.parse("object b[1..2], m task: leftOf(b.last, m) & x(m) >= b.count * 0.1")
    texts = [member.checked.core.objects for _, member in spec.members]
    assert texts == [("b[1]", "m"), ("b[1]", "b[2]", "m")]


def test_editors_say_how_many_there_can_be():
    from scenegen.editors.lsp.document import Document
    from scenegen.editors.lsp.hover import hover

    found = hover(Document(FAMILY), FAMILY.index("block"))
    assert found is not None and "2 to 4 of block" in found.markdown


@pytest.mark.long
def test_a_grammar_names_what_is_always_there():
    text = scenegen.grammar_of(scenegen.parse("object block[2..3], mug task: leftOf(mug, block[1])"), "gbnf")
    assert "block[2..3], mug" in text and "block[2]" in text and "block[3]" not in text
