"""Scenes from elsewhere: arrays, tables and files of poses alone, settled files, mirrored copies, given scenes."""

import json
import math
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen.api.reading import part_of_scenes
from scenegen.errors import DataError, RequestError
from scenegen.sampling.request import parse_fix

SPEC = "object mug, plate, can\nleft: leftOf(mug, plate)\nnear: closeTo(mug, plate, 20 cm)\n"
POSES = np.array(
    [[[0.2, 0.5, 0.0], [0.6, 0.5, 1.0], [0.5, 0.2, 2.0]], [[0.7, 0.5, 0.0], [0.6, 0.5, 1.0], [0.5, 0.2, 2.0]]]
)
COLUMNS = [f"{name}.{axis}" for name in ("mug", "plate", "can") for axis in ("x", "y", "theta")]


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(SPEC)


def same(scenes):
    np.testing.assert_allclose(scenes.poses, POSES)
    np.testing.assert_allclose(scenes.phi["left"], [0.4, -0.1])
    np.testing.assert_allclose(scenes.phi["near"], [-0.2, 0.1])


def test_poses_in_every_form(spec):
    torch, pandas, polars = map(pytest.importorskip, ("torch", "pandas", "polars"))
    table = dict(zip(COLUMNS, POSES.reshape(2, 9).T, strict=True))
    frame = pandas.DataFrame(table)
    by_name = {name: POSES[:, k] for k, name in enumerate(spec.objects)}
    each = [{name: list(pose) for name, pose in zip(spec.objects, scene, strict=True)} for scene in POSES.tolist()]
    for given in (
        POSES, POSES.tolist(), torch.tensor(POSES), by_name, {k: torch.tensor(v) for k, v in by_name.items()},
        table, frame, frame[COLUMNS[::-1]], polars.DataFrame(frame.to_dict("list")), each,
        spec.scenes(POSES).to_pandas(),
    ):  # fmt: skip
        same(spec.scenes(given))
    one = spec.scenes(POSES[0])
    assert len(one) == 1 and len(spec.scenes(one[0].poses)) == 1
    assert (
        spec.scenes({"mug": (0.2, 0.5, 0), "plate": (0.6, 0.5, 1), "can": (0.5, 0.2, 2)}).phi["left"][0]
        == one.phi["left"][0]
    )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (POSES[..., :2], r"of the shape \(2, 3, 2\)"),
        (POSES[:, :2], r"of the shape \(2, 2, 3\)"),
        ("scenes.json", "`poses` is 'scenes.json'"),
        (None, "`poses` is None"),
        ([], r"`poses` is \[\]"),
        (POSES[:0], "there are no scenes"),
        (POSES * math.nan, "no number stands in column `mug.x` of scene 1"),
        (np.where(POSES == 0.2, math.inf, POSES), "no number stands in column `mug.x` of scene 1"),
        ({"mug": POSES[:, 0], "plate": POSES[:, 1]}, "has no column `can.x`"),
        ({"cup": (1, 2, 3)}, "the spec does not know `cup`"),
        ({"mug": POSES[:, 0], "plate": POSES[:1, 1], "can": POSES[:, 2]}, "`poses` is"),
        ([{"mug": [1, 2]}], "no x, y and theta of `mug`"),
        ([{"mug": [1, 2, "x"]}], "no number stands in column `mug.theta` of scene 1"),
    ],
)
def test_what_is_no_scene_of_the_spec(given, said, spec):
    with pytest.raises((RequestError, DataError), match=said) as caught:
        spec.scenes(given)
    assert len(caught.value.diagnostics) == 1


def test_what_the_spec_holds_is_compared():
    spec = scenegen.parse("object mug, plate at (0.5, 0.5)\ntask: closeTo(mug, plate, 15 cm)\n")
    assert spec.scenes({"mug": (0.5, 0.4, 0)}).phi["task"][0] == pytest.approx(0.05)
    with pytest.raises(
        DataError, match=r"`plate` is held at \(0.5, 0.5, 0\) by the spec, but stands elsewhere in scene 1"
    ):
        spec.scenes({"mug": (0.5, 0.5, 0), "plate": (0.9, 0.5, 0)})


def test_numbers_of_things_and_surfaces():
    spec = scenegen.parse("object block[1..3], mug\ntask: forall b in block: leftOf(b, mug)\n")
    poses = np.full((2, 4, 3), 0.2)
    poses[:, 3, 0] = 0.6
    poses[1, 1:3] = math.nan
    scenes = spec.scenes(poses)
    assert scenes.counts["block"].tolist() == [3, 1] and scenes.phi["task"] == pytest.approx([0.4, 0.4])
    poses[1, 2] = 0.2
    with pytest.raises(DataError, match="does not say the same of how many things there are"):
        spec.scenes(poses)
    spec = scenegen.parse(
        "object board = box(30 cm, 20 cm, 2 cm), mug on any of [board, workspace]\ntask: on(mug, board)\n"
    )
    places = {"board": (0.5, 0.5, 0), "mug": (0.5, 0.5, 0)}
    with pytest.raises(DataError, match="do not say on which surface of the spec `mug` stands"):
        spec.scenes(places)
    drawn = scenegen.sample(spec, n=4)
    again = spec.scenes(drawn.poses, on=drawn.on)
    np.testing.assert_array_equal(again.phi["task"], drawn.phi["task"])
    np.testing.assert_array_equal(spec.scenes(drawn.to_pandas()).phi["task"], drawn.phi["task"])


def test_a_set_cannot_say_another_phi(spec):
    scenes = spec.scenes(POSES)
    same(scenegen.SceneSet(POSES, dict(scenes.phi), scenes.header))
    with pytest.raises(DataError, match=r"stores phi of `left` as 9; it is 0\.4"):
        scenegen.SceneSet(POSES[:1], {"left": np.array([9.0]), "near": np.array([-0.2])}, scenes.header)
    with pytest.raises(DataError, match="stores no phi of `near`"):
        scenegen.SceneSet(POSES[:1], {"left": np.array([0.4])}, scenes.header)
    with pytest.raises(DataError, match="a label that its spec does not have"):
        scenegen.SceneSet(POSES[:1], {"lefd": np.array([0.4])}, scenes.header)
    with pytest.raises(RequestError, match=r"`poses` is of the shape \(2, 3, 3\)"):
        scenegen.SceneSet(POSES, {"left": np.array([0.4])}, scenes.header)
    for array in (scenes.poses, scenes[1:].poses, scenes.phi["left"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 9


def test_masks_of_other_libraries(spec):
    torch, pandas = map(pytest.importorskip, ("torch", "pandas"))
    scenes = spec.scenes(POSES)
    for mask in (
        scenes.to_pandas()["phi.left"] > 0,
        torch.tensor([True, False]),
        torch.tensor([0]),
        pandas.Series([0]),
    ):
        assert len(scenes[mask]) == 1 and scenes[mask].phi["left"][0] == scenes.phi["left"][0]
    for odd in (torch.tensor([True]), pandas.Series([0.5]), torch.tensor([[0]])):
        with pytest.raises(RequestError, match=r"cannot pick|not-an-index"):
            scenes[odd]


HIDDEN = np.ma.masked_array(POSES, mask=np.zeros(POSES.shape, bool))
HIDDEN[0, 0] = np.ma.masked


@pytest.mark.parametrize(
    "given",
    [
        HIDDEN,
        list(HIDDEN),
        [list(scene) for scene in HIDDEN],
        {"mug": HIDDEN[:, 0], "plate": POSES[:, 1], "can": POSES[:, 2]},
        {"mug": [(np.ma.masked, 0.5, 0)] * 2, "plate": POSES[:, 1], "can": POSES[:, 2]},
        {name: HIDDEN.reshape(2, 9)[:, k] for k, name in enumerate(COLUMNS)},
    ],
)
def test_what_is_masked_is_missing(given, spec):
    with pytest.raises(DataError, match=r"no number stands in column `mug\.[xy]` of scene 1"):
        spec.scenes(given)


def test_masks_that_hide_nothing_and_numbers_that_are_none(spec):
    torch, pandas = map(pytest.importorskip, ("torch", "pandas"))
    same(spec.scenes(np.ma.masked_array(POSES)))
    frame = pandas.DataFrame(POSES.reshape(2, 9), columns=COLUMNS)
    same(spec.scenes(frame.convert_dtypes()))
    half = torch.tensor(POSES * 5, dtype=torch.bfloat16)
    np.testing.assert_array_equal(spec.scenes(half / 8).poses, (half / 8).double().numpy())
    with pytest.raises(DataError, match=r"no number stands in column `mug.x` of scene 1"):
        spec.scenes(frame.astype("Float64").mask(frame == 0.2))
    arrow = pytest.importorskip("pyarrow").Table.from_pandas(frame)
    with pytest.raises(RequestError, match=r"`poses` is of the shape \(2, 9\)"):
        spec.scenes(arrow)
    for odd in (POSES + 0j, torch.tensor(POSES + 1j), POSES > 0.5):
        with pytest.raises(RequestError, match=r"`poses` is of the shape \(2, 3, 3\), (complex|bool|torch)"):
            spec.scenes(odd)
    with pytest.raises(DataError, match="it is nan"):
        scenegen.SceneSet(HIDDEN, dict(spec.scenes(POSES).phi), spec.scenes(POSES).header)


def files(spec, folder: Path):
    pytest.importorskip("pandas")
    polars = pytest.importorskip("polars")
    scenes = spec.scenes(POSES)
    frame = scenes.to_pandas()
    scenes.save(folder / "s.parquet")
    frame.to_csv(folder / "a.csv", index=False)
    frame.to_csv(folder / "with index.CSV")
    frame.to_parquet(folder / "pandas.parquet")
    polars.read_parquet(folder / "s.parquet").write_parquet(folder / "polars.parquet")
    frame[COLUMNS].to_json(folder / "rows.jsonl", orient="records", lines=True)
    axes = ("x", "y", "theta")
    plain = [
        {name: dict(zip(axes, pose, strict=True)) for name, pose in zip(spec.objects, scene, strict=True)}
        for scene in POSES.tolist()
    ]
    (folder / "list.json").write_text(json.dumps(plain))
    (folder / "poses.json").write_text(json.dumps({"scenes": [{"poses": one, "phi": {"left": 3}} for one in plain]}))
    (folder / "poses.jsonl").write_text("".join(json.dumps({"poses": one}) + "\n" for one in plain))
    (folder / "named.jsonl").write_text("".join(json.dumps(one) + "\n" for one in plain))
    return sorted(path for path in folder.iterdir() if path.name != "s.parquet")


def test_files_of_poses_alone(spec, tmp_path):
    given = files(spec, tmp_path)
    assert len(given) == 9
    for path in given:
        same(scenegen.read_scenes(path, spec=spec))
        with pytest.raises((DataError, RequestError), match="is not a scenes file") as caught:
            scenegen.read_scenes(path)
        assert "`spec`" in caught.value.diagnostics[0].text("help"), path
    with pytest.raises(RequestError, match="says itself of what spec it is"):
        scenegen.read_scenes(tmp_path / "s.parquet", spec=spec)
    for text, said in (
        ("mug.x\n1\n", "no column `mug.y`"),
        ("", "no rows"),
        (",".join(COLUMNS) + "\n" + "x" + ",1" * 8, "is `x`"),
    ):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(DataError, match=said):
            scenegen.read_scenes(tmp_path / "bad.csv", spec=spec)


ROW = dict(zip(COLUMNS, POSES[0].ravel().tolist(), strict=True))


def table_of(between=",", more=("", ""), head="", quote=""):
    """A .csv file of one scene: `more` stands behind its heading and its row."""
    lines = (between.join(f"{quote}{one}{quote}" for one in line) for line in (ROW, map(str, ROW.values())))
    return head + "".join(f"{line}{between}{cell}\n" for line, cell in zip(lines, more, strict=True))


@pytest.mark.parametrize(
    "text",
    [
        table_of(";", ("at (x,y)", "q")),
        table_of("\t", ("a,b,c,d,e,f,g,h,i,j,k;l", "q")),
        table_of(",", ("a;b;c;d;e;f;g;h;i;j;k", "q")),
        table_of(";", ('"a,b.x,c.y"', '"1,2"')),
        table_of(",", ("picture", "A" * 140_000)),
        table_of(", ", ('"say ""hi"", twice"', '"a\nb"'), quote='"'),
        table_of(head="sep=,\n"),
        table_of(";", head='\ufeff"SEP=;"\r\n'),
        table_of("\t", head="sep=\t\n"),
        table_of(head="# made by a tracker, 2024\n#\n\n"),
        table_of(more=("#", "# 1")),
        "#," + table_of().replace("\n", "\n1,", 1),
        table_of(more=("note", "a\u2028b\x85c\x0bd")).replace("\n", "\r"),
    ],
)
def test_csv_files_hold_anything_beside_the_poses(text, spec, tmp_path):
    (tmp_path / "a.csv").write_bytes(text.encode())
    np.testing.assert_array_equal(scenegen.read_scenes(tmp_path / "a.csv", spec=spec).poses, POSES[:1])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (table_of(head="sep=|\n"), "separated by `|`"),
        (table_of(more=("n", '"a "b" c"')), "line 2, counted from its heading: ',' expected"),
        (table_of(more=("n", '"abc')), "line 2, counted from its heading: unexpected end"),
        (table_of(";").replace("0.2", "0,2"), "numbers have a decimal point: 0.2"),
        ("sep=;\n", "it has no rows"),
        ("# " + table_of(), "did you mean `# mug.x`"),
    ],
)
def test_csv_files_that_are_none_say_where(text, said, spec, tmp_path):
    (tmp_path / "a.csv").write_bytes(text.encode())
    with pytest.raises(DataError) as caught:
        scenegen.read_scenes(tmp_path / "a.csv", spec=spec)
    assert said in str(caught.value) and len(caught.value.diagnostics) == 1


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_of_json_end_where_json_says(end, spec, tmp_path):
    row = json.dumps({**ROW, "note": "a\u2028b\u2029c\x85d"}, ensure_ascii=False)
    (tmp_path / "a.jsonl").write_bytes(f"\ufeff{row}{end}{row}{end}{end}".encode())
    assert len(scenegen.read_scenes(tmp_path / "a.jsonl", spec=spec)) == 2


@pytest.mark.parametrize("cell", [[0.1], {"x": 0.1}, True, "left"])
def test_a_cell_that_is_no_number_is_named(cell, spec, tmp_path):
    (tmp_path / "a.jsonl").write_text(json.dumps({**ROW, "mug.x": cell}) + "\n")
    with pytest.raises(DataError, match=r"`mug\.x` in row 1 is"):
        scenegen.read_scenes(tmp_path / "a.jsonl", spec=spec)


def test_parquet_files_have_numbers_of_every_kind(spec, tmp_path):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")
    exact = [Decimal(str(value)) for value in ROW.values()]
    beside = {"a": pa.array([True]), "b": pa.array([2**63], pa.uint64()), "c": pa.array([1], pa.timestamp("ns"))}
    for kind, values in (
        (pa.decimal128(9, 3), exact),
        (pa.decimal256(50, 7), exact),
        (pa.string_view(), map(str, exact)),
        (pa.large_string(), map(str, exact)),
        (pa.dictionary(pa.int8(), pa.string()), map(str, exact)),
    ):
        columns = {name: pa.array([value]).cast(kind) for name, value in zip(ROW, values, strict=True)}
        pq.write_table(pa.table(columns | beside), tmp_path / "a.parquet")
        np.testing.assert_array_equal(scenegen.read_scenes(tmp_path / "a.parquet", spec=spec).poses, POSES[:1])
    for odd, said in ((pa.nulls(1), "no number stands in column `mug.x` of scene 1"), (beside["a"], "is `bool`")):
        pq.write_table(pa.table({**columns, "mug.x": odd}), tmp_path / "a.parquet")
        with pytest.raises(DataError, match=said):
            scenegen.read_scenes(tmp_path / "a.parquet", spec=spec)


def test_mirrored_copies(spec):
    scenes = spec.scenes(POSES)
    mirrored = scenes.mirrored()
    np.testing.assert_allclose(mirrored.poses[..., 0], 1.0 - POSES[..., 0])
    np.testing.assert_allclose(mirrored.poses[..., 2], np.mod(math.pi - POSES[..., 2], 2 * math.pi))
    np.testing.assert_allclose(mirrored.phi["left"], -scenes.phi["left"])
    np.testing.assert_allclose(mirrored.phi["near"], scenes.phi["near"])
    np.testing.assert_allclose(mirrored.mirrored().poses, POSES)
    held = scenegen.parse("object mug, plate at (0.3, 0.5)\ntask: leftOf(mug, plate)\n")
    with pytest.raises(DataError, match="`plate` is held at"):
        held.scenes({"mug": (0.2, 0.5, 0)}).mirrored()


GIVEN = "object mug, plate, can, apple\nrequire noOverlap() & insideWorkspace()\ntask: closeTo(mug, plate, 20 cm)\n"


def test_given_scenes_are_completed_one_each():
    spec = scenegen.parse(GIVEN)
    first = scenegen.sample(spec, (-0.4, -0.2), n=64, seed=1)
    held = {name: first.poses[:, k] for k, name in enumerate(spec.objects) if name in ("can", "apple")}
    made = scenegen.sample(spec, (-0.2, -0.1), fix=held, seed=2)
    np.testing.assert_array_equal(made.poses[:, 2:], first.poses[:, 2:])
    assert len(made) == 64 and made.phi["task"].min() >= -0.2 and made.phi["task"].max() <= -0.1
    assert scenegen.SceneSet(made.poses, made.phi, made.header).header.sampler["held"] == ["can", "apple"]
    array = first.poses.copy()
    array[:, :2] = math.nan
    np.testing.assert_array_equal(scenegen.sample(spec, (-0.2, -0.1), fix=array, seed=2).poses, made.poses)
    other = scenegen.parse("object can, apple\ntask: leftOf(can, apple)\n").scenes(
        {"can": held["can"], "apple": held["apple"]}
    )
    np.testing.assert_array_equal(scenegen.sample(spec, (-0.2, -0.1), fix=other, seed=2).poses, made.poses)
    spread = np.histogram(made.phi["task"], bins=4, range=(-0.2, -0.1))[0]
    assert spread.tolist() == [16] * 4, "phi is spread evenly over the range, as in other requests"


def test_one_of_many_given_is_distributed_as_one_alone():
    """phi of the completed scenes and of those of single requests: a two-sample KS test at 1 %."""
    spec = scenegen.parse(GIVEN)
    given = scenegen.sample(spec, (-0.4, -0.2), n=1, seed=1).poses
    held = np.repeat(given, 800, axis=0)
    held[:, :2] = math.nan
    made = scenegen.sample(spec, (-0.3, None), fix=held, seed=3, spread="base")
    fix = {name: tuple(given[0, k]) for k, name in enumerate(spec.objects) if k >= 2}
    alone = scenegen.sample(spec, (-0.3, None), n=800, fix=fix, seed=4, spread="base")
    for one, other in ((made.phi["task"], alone.phi["task"]), (made.poses[:, 0, 0], alone.poses[:, 0, 0])):
        both = np.sort(np.concatenate([one, other]))
        apart = np.abs(np.searchsorted(np.sort(one), both, "right") - np.searchsorted(np.sort(other), both, "right"))
        assert apart.max() / 800 < 1.63 * math.sqrt(2 / 800)


def test_given_poses_may_be_masked():
    spec = scenegen.parse(GIVEN)
    held = np.ma.masked_array([[0.9, 0.9, 1.0], [0.1, 0.1, 1.0]], mask=[[0, 0, 0], [1, 1, 1]])
    for fix in ({"can": held}, {"can": [held[0], held[1]], "apple": np.full((2, 3), math.nan)}):
        made = scenegen.sample(spec, (-0.2, -0.1), fix=fix, seed=2).poses[:, 2]
        assert made[0].tolist() == [0.9, 0.9, 1.0] and made[1].tolist() != [0.1, 0.1, 1.0]
    made = scenegen.sample(spec, (-0.2, -0.1), fix={"can": np.ma.masked_array([[0.9, 0.9, 1.0]], mask=[[0, 0, 1]])})
    assert made.poses[0, 2, 2] != 1.0
    for mask, axis in (((1, 0, 0), "x"), ((0, 1, 0), "y"), ((1, 1, 0), "x")):
        with pytest.raises(DataError, match=f"no number stands in column `can.{axis}` of scene 2"):
            half = np.ma.masked_array(held.data, mask=[(0, 0, 0), mask])
            scenegen.sample(spec, (-0.2, -0.1), fix={"can": half})
    with pytest.raises(DataError, match=r"no number stands in column `can.theta` of scene 1"):
        scenegen.sample(spec, (-0.2, -0.1), fix={"can": np.array([[0.9, 0.9, math.inf]])})
    for odd in (held[1], (0.5, np.ma.masked), (0.5, 0.5, 1j), np.array([0.5, 0.5j])):
        with pytest.raises(RequestError, match="the pose of `can` is"):
            scenegen.sample(spec, (-0.2, -0.1), n=1, fix={"can": odd})


def test_degrees_are_doubted_wherever_poses_come_in(tmp_path):
    spec = scenegen.parse("object mug, plate\ntask: leftOf(mug, plate)\n")
    turned = (0.5, 0.5, 90.0)
    every = np.array([[[math.nan] * 3, turned]])
    (tmp_path / "a.csv").write_text("plate.x,plate.y,plate.theta\n.5,.5,90\n")
    part = part_of_scenes(spec.checked, tmp_path / "a.csv", [])
    many = scenegen.parse("object block[1..2], plate\ntask: forall b in block: leftOf(b, plate)\n")
    for source, fix in (
        (spec, {"plate": turned}), (spec, {"plate": np.array(turned)}), (spec, {"plate": np.array([turned])}),
        (spec, every), (spec, part), (many, {"plate": turned}),
    ):  # fmt: skip
        n = None if getattr(next(iter(fix.values())) if isinstance(fix, dict) else fix, "ndim", 1) > 1 else 3
        told = scenegen.sample(source, (0.0, None), n, fix=fix).warnings
        assert [one.code for one in told] == ["doubtful-pose"] and "`plate.theta`" in told[0].title
    assert not scenegen.sample(spec, (0.0, None), 1, fix={"plate": (0.5, 0.5, 6.2)}).warnings
    assert not scenegen.sample(spec, (0.0, None), 1, fix=parse_fix(["plate=0.5,0.5,90 rad"])).warnings


TIMED = """object mug, plate time 2 steps moves one
require speed(mug) <= 20 cm/s
task: eventually leftOf(mug, plate)"""


def test_degrees_are_doubted_in_motions():
    timed, turned = scenegen.parse(TIMED), (0.5, 0.5, 90.0)
    told = scenegen.sample_motions(timed, (0.0, None), 1, fix={"plate": turned}).warnings
    assert [one.code for one in told] == ["doubtful-pose"]

    def doubts(*poses):
        return [one.title for one in scenegen.Monitor(timed).add(np.array(poses)).warnings]

    assert doubts((0.2, 0.5, 0.0), (0.6, 0.5, 6.2)) == []
    assert doubts((0.2, 0.5, 0.0), turned) == ["`poses`: `plate.theta` is 90: more than a turn"]
    assert doubts([(0.2, 0.5, 0), (0.2, 0.5, 0)], [(500, 0.5, 0), (0.6, 0.5, 0)])[0].startswith(
        "`poses`: `mug.x` in row 2"
    )
    for odd in (np.ma.masked_array([[0.2, 0.5, 0], [0.6, 0.5, 0]], mask=[[1, 1, 1], [0, 0, 0]]), np.full((2, 3), 0.5j)):
        with pytest.raises(RequestError, match="`poses` is not"):
            scenegen.Monitor(timed).add(odd)


def test_given_scenes_that_cannot_be():
    spec = scenegen.parse(GIVEN)
    first = scenegen.sample(spec, (-0.4, -0.2), n=3, seed=1)
    for fix, said in (
        (first, "every object is held in place"),
        ({"cup": first.poses[:, 0]}, "no object `cup`"),
        ({"mug": first.poses[:, 0] + 5.0}, "`mug` cannot be held at"),
        (
            {"mug": first.poses[:, 0], "plate": first.poses[:, 1]},
            "given scene 1 cannot be completed: no scene can have phi",
        ),
        (first.poses[:0], "there are no scenes"),
        (first.poses[:, :2], "`fix` is"),
        ({"mug": first.poses[:, 0], "plate": first.poses[:2, 1]}, "`fix` is"),
    ):
        with pytest.raises(RequestError, match=said) as caught:
            scenegen.sample(spec, (0.0, None), fix=fix, timeout=20)
        assert len(caught.value.diagnostics) == 1
    near = first.poses.copy()
    near[1, 1] = near[1, 0] + (0.15, 0.0, 0.0)
    near[:, 2:] = math.nan
    with pytest.raises(RequestError, match="`n` does not go with given scenes"):
        scenegen.sample(spec, (0.0, None), n=5, fix=near)


def test_no_option_that_leaves_out_scenes_goes_with_given_ones(monkeypatch):
    spec = scenegen.parse(GIVEN)
    given = {"mug": scenegen.sample(spec, (-0.4, -0.2), n=3, seed=1).poses[:, 0]}
    with pytest.raises(RequestError, match="`settle` does not go with given scenes"):
        scenegen.sample(spec, (0.0, None), fix=given, settle=True)
    with pytest.raises(RequestError, match="`success` does not go with given scenes"):
        scenegen.sample(spec, (0.0, None), fix=given, success=(0.4, 0.6), under="mine.fit")
    monkeypatch.setattr("scenegen.api.complete.SELECTIONS", {"seed": "a new option's:select"})
    with pytest.raises(RequestError, match="`seed` does not go with given scenes"):
        scenegen.sample(spec, (0.0, None), fix=given, seed=1)


@pytest.fixture(scope="module")
def settled():
    """A can that stands half over the edge of a board falls; it lies beside it then."""
    pytest.importorskip("mujoco")
    spec = scenegen.parse("object board = box(20 cm, 20 cm, 10 cm), can on board\ntask: leftOf(board, can)\n")
    return scenegen.settle(spec.scenes({"board": (0.5, 0.5, 0), "can": (0.599, 0.5, 0)}), workers=1)


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_settled_scenes_are_read_as_they_came_to_rest(ending, settled, tmp_path):
    scenes = scenegen.read_scenes(settled.save(tmp_path / f"s.{ending}"))
    np.testing.assert_array_equal(scenes.rest, settled.poses)
    np.testing.assert_array_equal(scenes.poses7(), settled.poses)
    assert settled.moved[0, 1] and settled.turn[0, 1] > 60.0, "the can fell over"
    np.testing.assert_allclose(scenes.phi["task"], settled.phi["task"], atol=1e-9)
    np.testing.assert_array_equal(scenes[:1].rest, settled.poses)
    for refused in (
        lambda: scenes.save(tmp_path / "x.json"),
        lambda: scenes.export(tmp_path / "x.jsonl"),
        lambda: scenes.mirrored(),
        lambda: scenegen.settle(scenes),
    ):
        with pytest.raises(RequestError, match="came to rest in a simulator"):
            refused()


def test_simulators_and_pictures_get_heights_and_attitudes(settled, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    scenes = scenegen.read_scenes(settled.save(tmp_path / "s.json"))
    (path,) = scenes.export(tmp_path / "mjcf", "mjcf")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for k, name in enumerate(scenes.objects):
        np.testing.assert_allclose(data.body(name).xpos, settled.poses[0, k, :3], atol=1e-9)
        assert abs(data.body(name).xquat @ settled.poses[0, k, 3:]) == pytest.approx(1.0, abs=1e-9)
    (path,) = scenes.export(tmp_path / "sdf", "sdf")
    import xml.etree.ElementTree as ET

    roll, pitch, yaw = map(float, ET.parse(path).find(".//model[@name='can']/pose").text.split()[3:])
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, settled.poses[0, 1, 3:])
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a), math.sin(a)) for a in (roll, pitch, yaw))
    x, y, z = (np.array(m) for m in (
        [[1, 0, 0], [0, cr, -sr], [0, sr, cr]], [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]],
        [[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]],
    ))  # fmt: skip
    np.testing.assert_allclose(z @ y @ x, turn.reshape(3, 3), atol=1e-6)


def test_pybullet_gets_the_can_lying(settled, tmp_path):
    import pybullet

    scenes = scenegen.read_scenes(settled.save(tmp_path / "s.json"))
    client = pybullet.connect(pybullet.DIRECT)
    body = scenegen.load_pybullet(scenes[0], client)["can"]
    middle, turn = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
    inertial, about = pybullet.getDynamicsInfo(body, -1, physicsClientId=client)[3:5]
    back = pybullet.invertTransform(inertial, about)
    at, attitude = pybullet.multiplyTransforms(middle, turn, *back)
    pybullet.disconnect(client)
    np.testing.assert_allclose(at, settled.poses[0, 1, :3], atol=1e-5)
    assert abs(np.dot(np.roll(attitude, 1), settled.poses[0, 1, 3:])) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.long
def test_the_can_that_fell_is_drawn_lying(settled, tmp_path):
    scenes = scenegen.read_scenes(settled.save(tmp_path / "s.json"))
    drawn = scenes.render(tmp_path / "p", views=("front",), size=(320, 240), masks=True, depth=True, workers=1)
    upright = scenegen.SceneSet(scenes.poses, dict(scenes.phi), scenes.header).render(
        tmp_path / "q", views=("front",), size=(320, 240), masks=True, depth=True, workers=1
    )
    tall = []
    for one in (drawn, upright):
        with np.load(next(path for path in one.beside if path.suffix == ".npz")) as held:
            known = json.loads(one.cameras.read_text())
            number = (
                next(int(k) for k, v in known["masks"].items() if v == "can")
                if "masks" in known
                else held["mask"].max()
            )
            rows, columns = np.nonzero(held["mask"] == number)
            tall.append(np.ptp(rows) / np.ptp(columns))
    assert tall[0] < 1.0 < tall[1], "lying, it is wider than high"


def test_surfaces_go_through_settled_files(tmp_path):
    pytest.importorskip("mujoco")
    board = "board = box(30 cm, 20 cm, 2 cm)"
    spec = scenegen.parse(f"object {board}, mug on any of [board, workspace]\ntask: on(mug, board)\n")
    scenes = scenegen.sample(spec, n=6, seed=2, workers=1)
    settled = scenegen.settle(scenes, workers=1)
    np.testing.assert_array_equal(settled.on, scenes.on)
    for ending in ("json", "jsonl", "parquet"):
        again = scenegen.read_scenes(settled.save(tmp_path / f"s.{ending}"))
        np.testing.assert_array_equal(again.on, scenes.on)
        np.testing.assert_allclose(again.phi["task"], settled.phi["task"], atol=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["scenes"][0]["objects"]["can"].update(x=None), "a pose is missing or null"),
        (lambda d: d["scenes"][0]["objects"].update(cup={}), "a pose is missing or null"),
        (lambda d: d.update(objects=["can", "board"]), "the objects of the file are not those of its spec"),
        (lambda d: d.update(objects=3), "damaged at `objects`"),
        (lambda d: d.update(scenes=[]), "there are no scenes"),
    ],
)
def test_damaged_settled_files(change, said, settled, tmp_path):
    path = settled.save(tmp_path / "s.json")
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    with pytest.raises((DataError, RequestError), match=said) as caught:
        scenegen.read_scenes(path)
    assert len(caught.value.diagnostics) == 1


def test_held_objects_can_be_left_out_scene_by_scene(tmp_path):
    spec = scenegen.parse("object mug, plate at (0.5, 0.5)\ntask: closeTo(mug, plate, 15 cm)")
    mug = [0.4, 0.4, 0.1]
    scenes = spec.scenes([{"mug": mug}, {"mug": mug, "plate": [0.5, 0.5, 0]}])
    assert scenes.poses[:, 1].tolist() == [[0.5, 0.5, 0.0]] * 2


def test_an_objects_name_alone_is_its_surface():
    spec = scenegen.parse("object tray, can on any of [tray, workspace]\ntask: leftOf(can, tray)")
    table = {"can.x": [0.5], "can.y": [0.5], "can.theta": [0.0], "tray.x": [0.5], "tray.y": [0.5], "tray.theta": [0.0]}
    on = [spec.scenes({**table, "can.on": [name]}).on.tolist() for name in ("tray", "tray.inside", "workspace")]
    assert on == [[[1.0]], [[1.0]], [[2.0]]]


def test_a_round_thing_that_is_held_in_the_middle_is_its_own_mirror_image():
    spec = scenegen.parse("object mug, plate at (0.5, 0.5)\ntask: closeTo(mug, plate, 15 cm)")
    scenes = scenegen.sample(spec, n=4)
    mirrored = scenes.mirrored()
    assert (mirrored.poses[:, 1] == scenes.poses[:, 1]).all()
    assert np.allclose(mirrored.phi["task"], scenes.phi["task"])
    with pytest.raises(DataError, match="take the `at` of `plate` out"):
        scenegen.sample(scenegen.parse("object mug, plate at (0.4, 0.5)\ntask: closeTo(mug, plate)"), n=2).mirrored()
