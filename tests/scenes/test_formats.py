"""What holds for every format of scene files: whatever is written comes back, and damage is told. Scenes as JSON: what
is written comes back bit for bit, and the files of yesterday still read. JSON Lines: what stands in which line, and
which line is damaged. Parquet as other programs see it, and Parquet files that are not ours.
"""

import errno
import gc
import io
import itertools
import json
import math
import random
import struct
import sys
import time

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenegen.api.reading import read_scenes
from scenegen.api.sample import sample
from scenegen.api.scenes import evaluate, from_file
from scenegen.api.spec import parse
from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.scenes.blocks import BLOCK, Block, join_blocks, regroup
from scenegen.scenes.data import Pose, SceneData
from scenegen.scenes.formats import parquet
from scenegen.scenes.formats.registry import FORMATS, format_of, write_scenes
from scenegen.scenes.formats.registry import read_scenes as read_blocks
from scenegen.scenes.formats.scenes_json import dump, load

from ..laws import examples

FLOATS = st.floats(allow_nan=False, allow_infinity=False)


def header_with(scenes, names):
    objects = [scenes.header.objects[0].model_copy(update={"name": name}) for name in names]
    return scenes.header.model_copy(update={"objects": objects})


@pytest.mark.parametrize("ending", FORMATS)
def test_sets_of_scenes_come_back(ending, scenes, tmp_path):
    path = scenes.save(tmp_path / f"x{ending.upper()}")
    again = read_scenes(path)
    assert again.header == scenes.header and list(again) == list(scenes)
    assert again.poses.tobytes() == scenes.poses.tobytes() and again.phi["task"].dtype == np.float64
    assert scenes.save(tmp_path / f"y{ending}").read_bytes() == path.read_bytes()


@pytest.mark.parametrize("ending", FORMATS)
@settings(max_examples=examples(25), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.tuples(*[FLOATS] * 8), max_size=4),
    st.lists(st.text(st.characters(exclude_categories=["Cs"]), min_size=1), min_size=2, max_size=2, unique=True),
)
def test_any_number_and_any_name_comes_back_bit_for_bit(ending, scenes, tmp_path, values, names):
    table = np.array(values, dtype=np.float64).reshape(-1, 8).T
    block, header = Block(table[:6], table[6:]), header_with(scenes, names)
    path = tmp_path / f"x{ending}"
    write_scenes(path, header, ("a%s b", '"'), [block])
    again = read_blocks(path)
    assert again.header == header
    found = again.whole()
    assert found.rows.tobytes() == block.rows.tobytes() and found.phi.tobytes() == block.phi.tobytes()
    assert again.labels == ("a%s b", '"')


@pytest.mark.long
@pytest.mark.parametrize("ending", FORMATS)
def test_many_blocks_are_one_file(ending, scenes, tmp_path):
    """The bytes do not depend on how the scenes were cut into blocks; nor does a reader hold all of them."""
    source = np.random.default_rng(1)
    count = BLOCK + 100 if ending != ".json" else 300
    whole = Block(source.random((6, count)), source.random((1, count)))
    cuts = [0, 5, 5, 77, count // 2, count]
    write_scenes(tmp_path / f"one{ending}", scenes.header, ("task",), [whole])
    parts = (whole.part(start, stop) for start, stop in itertools.pairwise(cuts))
    write_scenes(tmp_path / f"many{ending}", scenes.header, ("task",), parts)
    assert (tmp_path / f"one{ending}").read_bytes() == (tmp_path / f"many{ending}").read_bytes()
    blocks = list(read_blocks(tmp_path / f"many{ending}").blocks)
    assert [block.count for block in blocks] == ([BLOCK, 100] if ending != ".json" else [count])
    assert np.array_equal(join_blocks(blocks, 6, 1).rows, whole.rows)


@given(st.lists(st.integers(0, 30), max_size=12), st.integers(1, 20))
def test_regrouping(counts, size):
    numbers = iter(range(10**6))
    blocks = [Block(np.array([[float(next(numbers)) for _ in range(n)]]), np.zeros((0, n))) for n in counts]
    out = list(regroup(blocks, size))
    assert all(block.count == size for block in out[:-1]) and all(0 < block.count <= size for block in out)
    assert np.array_equal(join_blocks(out, 1, 0).rows, join_blocks(blocks, 1, 0).rows)


@pytest.mark.parametrize("ending", FORMATS)
def test_a_failing_source_leaves_no_file(ending, scenes, tmp_path):
    def blocks():
        yield Block(np.zeros((6, 2)), np.zeros((1, 2)))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_scenes(tmp_path / f"x{ending}", scenes.header, ("task",), blocks())
    with pytest.raises(ValueError, match="not finite"):
        write_scenes(
            tmp_path / f"x{ending}", scenes.header, ("task",), [Block(np.full((6, 1), np.nan), np.zeros((1, 1)))]
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", [".jsonl", ".parquet"])
def test_nothing_but_a_diagnostic(ending, scenes, tmp_path):
    """Hundreds of damaged files: each is read, or answered with one diagnostic, and nothing else happens."""
    path = scenes.save(tmp_path / f"x{ending}")
    data = path.read_bytes()
    source = random.Random(11)
    refused = 0
    for _ in range(200):
        bad = bytearray(data)
        for _ in range(source.randint(1, 3)):
            place = source.randrange(len(bad))
            match source.randrange(4):
                case 0:
                    bad[place] ^= 1 << source.randrange(8)
                case 1:
                    del bad[place : place + source.randint(1, 40)]
                case 2:
                    bad[place:place] = bad[place : place + source.randint(1, 200)]
                case 3:
                    bad[place : place + 4] = source.choice([b"", b"null", b"1e999", b"\xff\xff\xff\x7f", b"\n"])
        path.write_bytes(bad or b"x")
        try:
            read_scenes(path)
        except ScenegenError as error:
            assert len(error.diagnostics) == 1 and error.diagnostics[0].help, bytes(bad)
            refused += 1
    assert refused > 125


@pytest.mark.parametrize("ending", [".jsonl", ".parquet"])
@pytest.mark.parametrize("keep", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_cut_short(ending, keep, scenes, tmp_path):
    path = scenes.save(tmp_path / f"x{ending}")
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * keep)])
    with pytest.raises(DataError) as caught:
        read_scenes(path)
    assert caught.value.diagnostics[0].help


def test_without_the_library(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.delitem(sys.modules, "scenegen.scenes.formats.parquet", raising=False)
    with pytest.raises(RequestError, match=r"pyarrow is needed for .parquet files, and is not installed") as caught:
        format_of(tmp_path / "x.parquet")
    assert caught.value.diagnostics[0].help == 'pip install "scenegen-dsl[parquet]"'


def test_columns_that_would_share_a_name(scenes, tmp_path):
    header = header_with(scenes, ["phi", "mug"])
    with pytest.raises(OutputError, match=r"`phi\.x`"):
        write_scenes(tmp_path / "x.parquet", header, ("x",), [])
    write_scenes(tmp_path / "x.parquet", header, ("task",), [])
    assert read_blocks(tmp_path / "x.parquet").labels == ("task",)


@given(st.lists(st.tuples(*[FLOATS] * 7), max_size=4))
def test_floats_come_back_bit_for_bit(scenes, values):
    data = [
        SceneData(
            poses={"mug": Pose(x=a, y=b, theta=c), "plate": Pose(x=d, y=e, theta=f)},
            phi={"task": g},
        )
        for a, b, c, d, e, f, g in values
    ]
    file = scenes.header.model_copy(update={"scenes": data})
    again = load(dump(file), "x.json")
    assert again == file
    for one, other in zip(data, again.scenes, strict=True):
        assert bits(one) == bits(other)
    assert dump(again) == dump(file)


def bits(scene):
    numbers = [value for pose in scene.poses.values() for value in (pose.x, pose.y, pose.theta)]
    return struct.pack(f"{len(numbers) + 1}d", *numbers, scene.phi["task"])


def test_arrays_come_back_bit_for_bit(scenes, tmp_path):
    again = read_scenes(scenes.save(tmp_path / "x.json"))
    assert np.array_equal(again.poses, scenes.poses) and np.array_equal(again.phi["task"], scenes.phi["task"])
    assert again.header == scenes.header


def test_layout(written, scenes):
    """The header for people, then one scene a line, for grep and diff."""
    text = written.decode()
    assert json.loads(text)["format"] == "scenegen/scenes"
    assert sum(line.startswith('  {"poses": ') for line in text.splitlines()) == len(scenes)
    assert text.endswith("\n ]\n}\n")


def test_yesterdays_file_still_reads_and_scores_the_same(root):
    """tests/golden/scenes/scenes.json is version 1 for good and never rewritten: people have such files."""
    old = read_scenes(root / "tests" / "golden" / "scenes" / "scenes.json")
    spec = parse(old.header.spec.source)
    assert spec.checked.sha256 == old.header.spec.sha256
    phi = evaluate(spec.checked, old)["task"]
    np.testing.assert_allclose(phi, old.phi["task"], rtol=0, atol=1e-12)
    (mx, my, _), (px, py, _) = old.poses[0]
    assert abs(min(px - mx, math.dist((mx, my), (px, py)) - 0.25) - old.phi["task"][0]) < 1e-12


def test_a_byte_order_mark_does_no_harm(written):
    assert load(b"\xef\xbb\xbf" + written, "x.json") == load(written, "x.json")


def test_an_empty_set_is_a_file_too(scenes):
    empty = load(dump(scenes.header), "x.json")
    assert empty.scenes == [] and len(from_file(empty)) == 0 and from_file(empty).poses.shape == (0, 2, 3)


@pytest.mark.parametrize("ending", [".json", ".jsonl", ".parquet"])
def test_an_empty_set_keeps_its_labels(ending, tmp_path):
    made = sample(parse("object a, b\nz: leftOf(a, b)\nm: aboveOf(a, b)"), n=2)
    again = read_scenes(made[:0].save(tmp_path / f"x{ending}"))
    assert (len(again), tuple(again.phi), again.header) == (0, ("z", "m"), made.header)
    assert tuple(from_file(made[:0].file()).phi) == ("z", "m")
    other = again.save(tmp_path / "y.json")
    assert list(read_scenes(other).phi) == ["z", "m"] and json.loads(other.read_bytes())["labels"] == ["z", "m"]
    full = made.save(tmp_path / f"full{ending}").read_bytes()  # its scenes name them
    assert b'"labels"' not in full


def test_labels_beside_scenes_are_those_of_the_scenes(written, tmp_path):
    data = json.loads(written)
    for labels, good in ((["task"], True), (["task", "safe"], False), ([], False)):
        text = json.dumps({**data, "labels": labels}).encode()
        lines = [json.dumps({**data, "scenes": [], "labels": labels}).replace(', "scenes": []', "")]
        (tmp_path / "x.jsonl").write_text("\n".join([*lines, *map(json.dumps, data["scenes"])]))
        for read in (lambda: load(text, "x.json"), lambda: read_scenes(tmp_path / "x.jsonl")):  # noqa: B023
            if good:
                read()
                continue
            with pytest.raises(DataError, match="other labels"):
                read()


def test_a_key_that_stands_twice_is_found_in_no_time():
    keys = ", ".join(f'"k{number}": 0' for number in range(200_000))
    began = time.process_time()
    with pytest.raises(DataError, match="`k199999` stands twice"):
        load(f'{{{keys}, "k199999": 0}}'.encode(), "x.json")
    assert time.process_time() - began < 20.0  # 0.2 s; hours where every key is counted


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "not valid JSON"),
        ("[]", 'its "format" is not'),
        ("null", 'its "format" is not'),
        ('{"format": "scenegen/scenes", "version": 3}', "version 3"),
        ('{"format": "scenegen/scenes", "version": "1"}', "version '1'"),
        ('{"format": "scenegen/scenes", "version": 1}', "damaged at `spec`"),
        ('{"format": 1, "format": "scenegen/scenes"}', "`format` stands twice"),
        ("[" * 200_000, "nested too deeply"),
        ("1" * 5000, "thousands of digits"),
    ],
)
def test_damage(text, said):
    with pytest.raises(DataError) as caught:
        load(text.encode(), "x.json")
    (problem,) = caught.value.diagnostics
    assert said in problem.title and problem.help


@pytest.fixture
def path(scenes, tmp_path):
    return scenes.save(tmp_path / "x.jsonl")


def test_golden(scenes, tmp_path, golden):
    """Made by hand, so that the file does not follow the samplers' progress."""
    header = scenes.header.model_copy(update={"sampler": {"method": "by hand"}})
    rows = np.array([[0.25, 0.5], [1.0, 1e-05], [0.0, 6.25], [0.75, 0.125], [0.1, 0.2], [3.0, -0.0]])
    write_scenes(tmp_path / "x.jsonl", header, ("task",), [Block(rows, rows[3:4] - rows[:1])])
    golden("scenes/scenes.jsonl", (tmp_path / "x.jsonl").read_text())


def test_lines(path, scenes):
    """Any JSON reader gets along with it; the first line is the JSON file without its scenes."""
    header, *lines = map(json.loads, path.read_text().splitlines())
    assert len(lines) == len(scenes)
    assert {**header, "scenes": lines} == scenes.file().model_dump(mode="json")


def test_lines_in_another_layout(path, scenes):
    """As other programs write them: other spaces, other order of keys, whole numbers as integers, other line breaks."""
    header, *lines = map(json.loads, path.read_text().splitlines())
    lines[1] = {"phi": lines[1]["phi"], "poses": dict(reversed(lines[1]["poses"].items()))}
    lines[2]["poses"]["mug"]["theta"] = 3
    path.write_text("\r\n".join(json.dumps(line, separators=(",", ":")) for line in [header, *lines]))
    again = read_scenes(path)
    assert np.array_equal(np.delete(again.poses, 2, 0), np.delete(scenes.poses, 2, 0))
    assert again.poses[2, again.objects.index("mug"), 2] == 3.0


@pytest.mark.parametrize(
    "number, change, said",
    [
        (1, lambda line: b"", "x.jsonl is not a scenes file: its first line is empty"),
        (1, lambda line: line.replace(b'"version": 1', b'"version": 3'), "line 1 of .* has version 3"),
        (1, lambda line: line.replace(b'"spec"', b'"scenes"'), "its header holds scenes"),
        (1, lambda line: line.replace(b"leftOf", b"rightOf"), "line 1 of .* is damaged at `spec`"),
        (1, lambda line: b"[]", 'line 1 of .* its "format" is not'),
        (2, lambda line: line[:-9], "line 2 of .* is not valid JSON"),
        (4, lambda line: line[:-9], "line 4 of .* is not valid JSON"),
        (4, lambda line: b"", "line 4 of .* is empty"),
        (4, lambda line: b"\xff" + line, "line 4 of .* byte 0 is not UTF-8"),
        (4, lambda line: line.replace(b'"mug"', b'"cup"'), "line 4 of .* does not place the file's objects: `cup`"),
        (4, lambda line: line.replace(b'"task"', b'"tusk"'), "line 4 of .* has other labels"),
        (4, lambda line: line.replace(b'"phi"', b'"psi"'), "line 4 of .* is damaged at `phi`"),
        (4, lambda line: line.replace(b'"x": ', b'"x": 1e999, "z": '), "line 4 of .* is damaged"),
        (4, lambda line: line.replace(b'"x": ', b'"x": 1.0, "x": '), "`x` stands twice"),
        (4, lambda line: line + b" " + line, "line 4 of .* is not valid JSON"),
        (5, lambda line: b'"x"', "line 5 of .* is damaged: "),
    ],
)
def test_damage_jsonl(number, change, said, path):
    lines = path.read_bytes().splitlines()
    lines[number - 1] = change(lines[number - 1])
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(DataError, match=said) as caught:
        read_scenes(path)
    assert caught.value.diagnostics[0].help


@pytest.fixture
def path_parquet(scenes, tmp_path):
    return scenes.save(tmp_path / "x.parquet")


def test_golden_schema(scenes, tmp_path, golden):
    header = scenes.header.model_copy(update={"sampler": {"method": "by hand"}})
    write_scenes(tmp_path / "x.parquet", header, ("task", "safe"), [])
    parquet = pq.ParquetFile(tmp_path / "x.parquet")
    lines = [f"{field.name}: {field.type}{'' if field.nullable else ' not null'}" for field in parquet.schema_arrow]
    header = json.loads(parquet.metadata.metadata[b"scenegen"])
    golden("scenes/parquet.txt", "\n".join([*lines, json.dumps(header, indent=1)]) + "\n")


def test_pyarrow_alone_reads_it(path_parquet, scenes):
    table = pq.read_table(path_parquet)
    assert table.num_rows == len(scenes)
    for index, name in enumerate(scenes.objects):
        for axis, column in enumerate("x y theta".split()):
            np.testing.assert_array_equal(table[f"{name}.{column}"].to_numpy(), scenes.poses[:, index, axis])
    np.testing.assert_array_equal(table["phi.task"].to_numpy(), scenes.phi["task"])
    header = json.loads(table.schema.metadata[b"scenegen"])
    assert {**header, "scenes": []} == scenes.header.model_dump(mode="json")


def test_row_groups_and_the_range_of_phi_in_each(scenes, tmp_path):
    """Readers skip row groups by the statistics: who looks for hard scenes need not read all."""
    count = 2 * BLOCK + 10
    phi = np.linspace(0, 1, count)[None]
    write_scenes(tmp_path / "x.parquet", scenes.header, ("task",), [Block(np.zeros((6, count)), phi)])
    metadata = pq.ParquetFile(tmp_path / "x.parquet").metadata
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    assert [group.num_rows for group in groups] == [BLOCK, BLOCK, 10]
    assert groups[1].column(6).statistics.min == phi[0, BLOCK]


def test_a_flipped_bit_in_the_numbers_is_found(scenes, tmp_path):
    """Every value would still be a number; only the checksums of the pages tell."""
    source = np.random.default_rng(0)
    path = tmp_path / "x.parquet"
    write_scenes(path, scenes.header, ("task",), [Block(source.random((6, 20_000)), source.random((1, 20_000)))])
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(DataError, match="is damaged, or no Parquet file"):
        read_scenes(path)


def test_of_another_program(path_parquet, tmp_path):
    table = pq.read_table(path_parquet)
    names = table.column_names
    floats = pa.field(names[0], pa.float32())
    holes = pa.array([None, 1.0, 2.0, 3.0])
    for other, said in (
        (table.replace_schema_metadata({}), "no header under `scenegen`"),
        (table.replace_schema_metadata({"scenegen": "{}"}), 'the header of .* its "format" is not'),
        (table.select(names[1:]), f"has no column `{names[0]}`"),
        (table.append_column(names[0], table[0]), f"has two columns `{names[0]}`"),
        (table.set_column(0, floats, table[0].cast(pa.float32())), f"column `{names[0]}` of .* holds float, not"),
        (table.set_column(0, names[0], holes), f"no number stands in column `{names[0]}` of scene 1"),
        (table.set_column(2, names[2], pa.array([0, 1, np.inf, 0.0])), f"in column `{names[2]}` of scene 3"),
    ):
        pq.write_table(other, tmp_path / "other.parquet")
        with pytest.raises(DataError, match=said) as caught:
            read_scenes(tmp_path / "other.parquet")
        assert caught.value.diagnostics[0].help
    mixed = table.select([names[-1], *names[3:-1], names[1], names[0], names[2]])
    for same in (table, mixed, table.append_column("note", pa.array(["a"] * 4)), mixed.add_column(0, "z", table[0])):
        pq.write_table(same, tmp_path / "other.parquet", compression="gzip", row_group_size=2)
        assert list(read_scenes(tmp_path / "other.parquet")) == list(read_scenes(path_parquet))
        assert next(parquet.read_groups(tmp_path / "other.parquet", [1])).count == 2


class Room(io.BytesIO):
    """A file with room for so many bytes; counts its writes."""

    def __init__(self, room=math.inf):
        super().__init__()
        self.room, self.writes = room, 0

    def write(self, data):
        self.writes += 1
        if self.tell() + len(data) > self.room:
            raise OSError(errno.ENOSPC, "full")
        return super().write(data)


def test_a_file_is_written_in_large_parts(scenes):
    """Other threads may hold Python's lock each time."""
    sink, count = Room(), 4 * BLOCK
    noise = np.random.default_rng(0).random((7, count))
    parquet.write(sink, scenes.header, ("task",), [Block(noise[:6], noise[6:])])
    assert sink.tell() > 2 * parquet.BUFFER and sink.writes <= sink.tell() / parquet.BUFFER + 3
    assert pq.read_table(pa.BufferReader(sink.getvalue())).num_rows == count
    assert not sink.closed


@pytest.mark.parametrize("room", [0, 5_000_000])
def test_a_full_disk_is_told_once(room, scenes, capfd):
    """Arrow, which would try again when it lets go, prints nothing."""
    count = 4 * BLOCK
    noise = np.random.default_rng(0).random((7, count))
    with pytest.raises(OSError, match="full"):
        parquet.write(Room(room), scenes.header, ("task",), [Block(noise[:6], noise[6:])])
    gc.collect()
    assert capfd.readouterr() == ("", "")
