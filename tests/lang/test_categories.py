"""`object mug of category("mug")`: members have one asset each, and scenes, files and formulas agree on which."""

import json

import numpy as np
import pytest

import scenegen
from scenegen.errors import DataError, ScenegenError
from scenegen.lang.spec import combinations, members_of, written

A, B, C = (
    'asset("red", box(0.1, 0.06, 0.2))',
    'asset("blue", cylinder(0.04, 0.1))',
    'asset("set/green", box(0.3, 0.3, 0.1))',
)
TWO, THREE = f'category("mug", [{A}, {B}])', f'category("set/mug", [{A}, {B}, {C}])'
TASK = "task: leftOf(mug, plate)"


def parsed(kind=TWO, more="", task=TASK):
    return scenegen.parse(f"object mug of {kind}{more}, plate\n{task}")


def test_each_member_has_one_asset_and_the_spec_has_all():
    spec = parsed(THREE)
    checked = spec.declared
    assert spec.objects == ("mug:red", "plate", "mug:blue", "mug:green")
    assert spec.assets == {"mug": ("red", "blue", "green")} and spec.counts == {"mug": (1, 3)}
    assert [one.objects for one in checked.members] == [(f"mug:{name}", "plate") for name in ("red", "blue", "green")]
    assert [one.shapes[0].height for one in checked.members] == [0.2, 0.1, 0.1]
    assert list(map(written, combinations(checked.counts))) == ["mug:red", "mug:blue", "mug:green"]
    again = scenegen.parse(spec.source)
    assert again.source == spec.source and again.declared.shapes == checked.shapes


def test_elements_of_an_array_are_drawn_by_themselves_and_beside_numbers():
    text = f"object cup[2] of {TWO}, block[1..3], plate\ntask: forall c in cup: leftOf(c, block[1])"
    checked = scenegen.parse(text).declared
    assert len(checked.members) == 12 and checked.members[0].objects[:2] == ("cup[1]:red", "cup[2]:red")
    some = members_of(checked)
    for number, (member, rows) in enumerate(zip(some.specs, some.rows, strict=True)):
        scene = np.full((3 * len(checked.objects), 1), np.nan)
        scene[rows] = 0.5
        ((found, which),) = some.of(scene)
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
    alone = parsed(f'category("mug", [{A}])')
    assert not alone.counts and alone.checked.objects == ("mug:red", "plate")
    for counts, code in (
        ({"cup[1]": "green"}, "unknown-pick"),
        ({"cup[1]": 3}, "count-out-of-range"),
        ({"cup": 1}, "unknown-count"),
    ):
        with pytest.raises(ScenegenError) as caught:
            spec.with_counts(counts)
        assert caught.value.diagnostics[0].code == code


def test_scenes_are_drawn_in_equal_shares_and_files_say_which(tmp_path):
    spec = parsed(THREE)
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
    assert caught.value.diagnostics[0].code == "held-may-be-missing"
    picked = parsed().with_counts({"mug": "blue"})
    assert np.allclose(scenegen.sample(picked, {}, n=1, fix={"mug": (0.3, 0.2)}).poses[0, 0, :2], (0.3, 0.2))


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (f"object mug[1..2] of {TWO}, plate\ntask: leftOf(mug[1], plate)", "not-of-category"),
        (f"time 5 steps\nobject mug of {TWO}, plate\ntask: eventually leftOf(mug, plate)", "not-of-category"),
        (f"object mug of {TWO} on any of [tray, workspace], tray\ntask: leftOf(mug, tray)", "not-of-category"),
        (f"object mug of {TWO}, apple on mug.top\ntask: leftOf(mug, apple)", "depends-on-number"),
        (f"object mug[4] of {THREE}, plate\ntask: leftOf(mug[1], plate)", "too-many-counts"),
        (f"object mug of {TWO}, cup[3] of {THREE}, b[1..2]\ntask: leftOf(mug, b[1])", "too-many-counts"),
        ('object mug of category("mug")\ntask: x(mug) <= 0.5', "spec-without-file"),
        ("object mug of category(mug)\ntask: x(mug) <= 0.5", "file-without-quotes"),
        ("object mug of category()\ntask: x(mug) <= 0.5", "wrong-number-of-arguments"),
        ('object mug of category("mug", most = 0)\ntask: x(mug) <= 0.5', "not-a-category"),
        ('object mug of category("mug", seed = 1.5)\ntask: x(mug) <= 0.5', "not-a-category"),
        ('object mug of category("mug", [])\ntask: x(mug) <= 0.5', "not-a-category"),
        ('object mug of category("mug", [box(1, 1, 1)])\ntask: x(mug) <= 0.5', "not-a-category"),
        (f'object mug of category("mug", [{A}, {A}])\ntask: x(mug) <= 0.5', "not-a-category"),
        (f'object mug of category("mug", [{A}], [2])\ntask: x(mug) <= 0.5', "not-a-category"),
        (f'object mug of category("mug", [{A}], [0, 1])\ntask: x(mug) <= 0.5', "not-a-category"),
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
