"""Two thousand damaged scenes files: each is read, or answered with one diagnostic, and nothing else happens. A disk
that is full in the midst of a large file: the message says so, and what is kept; then the run goes on. Files that
are small on disk and large in memory: refused with their numbers, or read part by part.
"""

import contextlib
import random
import resource
import subprocess
import sys

import numpy as np
import pytest

from scenegen.api.reading import read_scenes
from scenegen.api.scenes import from_file
from scenegen.api.spec import parse
from scenegen.api.stream import sample_to
from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.scenes import blocks
from scenegen.scenes.formats import jsonl, parquet, scenes_json
from scenegen.scenes.formats.header import dump_header
from scenegen.scenes.formats.registry import read_scenes as opened
from scenegen.scenes.formats.scenes_json import load
from scenegen.worlds.export import xml
from scenegen.worlds.exporting import convert

MUTATIONS = 2000
JUNK = [
    b"",
    b"null",
    b"-1",
    b"1e999",
    b"NaN",
    b'"x"',
    b"[]",
    b"{}",
    b"\xff",
    b"\\u0000",
    b'"\\ud800"',
    b"1" * 5000,
    b",",
]


def mutated(data, source):
    data = bytearray(data)
    for _ in range(source.randint(1, 3)):
        place = source.randrange(len(data))
        match source.randrange(5):
            case 0:
                data[place] ^= 1 << source.randrange(8)
            case 1:
                del data[place : place + source.randint(1, 40)]
            case 2:
                data[place : place + source.randint(0, 6)] = source.choice(JUNK)
            case 3:
                end = min(len(data), place + source.randint(1, 200))
                data[place:place] = data[place:end]
            case 4:
                _swap_values(data, source)
    return bytes(data) or b"x"


def _swap_values(data, source):
    """A value where another kind of value belongs: what byte noise seldom gets right."""
    starts = [index + 2 for index in range(len(data) - 3) if data[index : index + 2] == b": "]
    if starts:
        start = source.choice(starts)
        end = start
        while end < len(data) and data[end] not in b",}\n":
            end += 1
        data[start:end] = source.choice(JUNK)


def test_nothing_but_a_diagnostic(written):
    source = random.Random(2026)
    read = refused = 0
    for _ in range(MUTATIONS):
        data = mutated(written, source)
        try:
            from_file(load(data, "x.json"))
        except ScenegenError as error:
            assert len(error.diagnostics) == 1 and error.diagnostics[0].help, data
            refused += 1
        else:
            read += 1
    assert refused > MUTATIONS // 2 and read > 20


@pytest.mark.parametrize("keep", [0.1, 0.5, 0.9, 0.999])
def test_truncated(written, keep):
    with pytest.raises(ScenegenError, match="not valid JSON"):
        load(written[: int(len(written) * keep)], "x.json")


@contextlib.contextmanager
def room_for(size):
    """No file of this process may grow beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_file_written_at_once(scenes, tmp_path):
    for ending in (".json", ".jsonl", ".parquet"):
        with room_for(100), pytest.raises(OutputError, match=r"file too large(.|\n)*nothing was left behind"):
            scenes.save(tmp_path / f"x{ending}")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def bomb(scenes, tmp_path):
    """bomb(rows, row_group_size=...): a Parquet file of so many equal scenes, a few hundred bytes for each million."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def make(rows, **options):
        names = [f"{one}.{axis}" for one in scenes.objects for axis in ("x", "y", "theta")] + ["phi.task"]
        metadata = {parquet.METADATA_KEY: dump_header(scenes.header).encode()}
        schema = pa.schema([pa.field(name, pa.float64(), nullable=False) for name in names], metadata=metadata)
        column = pa.array(np.full(rows, 0.5))
        path = tmp_path / f"bomb{rows}.parquet"
        pq.write_table(pa.table([column] * len(names), schema=schema), path, row_group_size=rows, **options)
        return path

    return make


@pytest.mark.long
def test_more_scenes_than_go_into_memory(bomb, scenes, tmp_path, monkeypatch):
    path = bomb(20_000)
    assert path.stat().st_size < 10_000
    monkeypatch.setattr(blocks, "MAX_NUMBERS", 7 * 12_000)
    said = r"holds 20,000 scenes of 2 objects: too many for memory(.|\n)*at most 12,000 of them"
    with pytest.raises(DataError, match=said):
        read_scenes(path)
    with pytest.raises(DataError, match=said):
        convert(path, tmp_path / "worlds", "mjcf")
    assert not (tmp_path / "worlds").exists()
    assert convert(path, tmp_path / "x.jsonl")[0] == 20_000  # block by block
    with pytest.raises(DataError, match="holds more than 12,000 scenes"):
        read_scenes(tmp_path / "x.jsonl")
    assert len(read_scenes(path, stop=12_000)) == 12_000 and len(read_scenes(tmp_path / "x.jsonl", stop=5)) == 5
    assert len(read_scenes(path, start=18_000)) == 2_000


@pytest.mark.parametrize("ending", [".json", ".jsonl", ".parquet"])
def test_parts_are_those_of_the_whole(ending, scenes, tmp_path):
    path = scenes.save(tmp_path / f"x{ending}")
    for start, stop in ((0, None), (1, 3), (3, 9), (4, None), (2, 2), (3, 1)):
        assert (read_scenes(path, start=start, stop=stop).poses == scenes.poses[start:stop]).all()
    with pytest.raises(RequestError, match="`start` is -1"):
        read_scenes(path, start=-1)
    with pytest.raises(RequestError, match=r"`stop` is 1.5"):
        read_scenes(path, stop=1.5)


def test_row_groups_that_are_too_large(bomb, monkeypatch):
    path = bomb(20_000, use_dictionary=False, compression="zstd")
    monkeypatch.setattr(parquet, "MAX_NUMBERS", 7 * 12_000)
    with pytest.raises(
        DataError, match=r"row group of .* holds 20,000 scenes; the limit is 12,000(.|\n)*scenegen export"
    ):
        parquet.group_sizes(path)
    monkeypatch.setattr(parquet, "MAX_GROUP_BYTES", 1_000_000)
    with pytest.raises(DataError, match=r"bytes; the limit is 1,000,000(.|\n)*row groups of 65,536 scenes"):
        opened(path)


@pytest.mark.long
def test_a_bomb_is_read_in_little_memory(bomb, tmp_path):
    """Four million scenes are 224 MB as numbers; reading them block by block takes a process some of that."""
    path = bomb(4_000_000)
    program = (
        "import resource, sys; from pathlib import Path; import scenegen.scenes.formats.parquet as p;"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss;"
        "count = sum(block.count for block in p.read(Path(sys.argv[1])).blocks);"
        "print(count, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)"
    )
    done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=120)
    count, megabytes = map(int, done.stdout.split())
    assert count == 4_000_000 and megabytes < 120


def test_a_json_file_that_is_too_long(scenes, tmp_path, monkeypatch):
    path = scenes.save(tmp_path / "x.json")
    monkeypatch.setattr(scenes_json, "MAX_JSON_BYTES", path.stat().st_size - 1)
    with pytest.raises(DataError, match=r"bytes are too many(.|\n)*read part by part"):
        read_scenes(path)
    monkeypatch.setattr(scenes_json, "MAX_JSON_BYTES", path.stat().st_size - 200)
    with pytest.raises(OutputError, match=r"do not fit into a .json file"):
        scenes.save(tmp_path / "y.json")
    assert [one.name for one in tmp_path.iterdir()] == ["x.json"]


def test_what_sample_writes_can_be_read(tmp_path):
    many = parse("object b[200] = box(1 cm, 1 cm, 1 cm)\ntask: leftOf(b[1], b[2])")
    with pytest.raises(RequestError, match=r"cannot hold 20,000 scenes(.|\n)*at most 13,957"):
        sample_to(tmp_path / "x.json", many, n=20_000)


def test_a_line_without_end(scenes, tmp_path, monkeypatch):
    path = scenes.save(tmp_path / "x.jsonl")
    longest = max(map(len, path.read_bytes().splitlines()))
    monkeypatch.setattr(jsonl, "MAX_LINE_BYTES", longest + 1)
    assert len(read_scenes(path)) == len(scenes)
    path.write_bytes(path.read_bytes() + b" " * (longest + 2))
    with pytest.raises(DataError, match=f"line {len(scenes) + 2} of .* is longer than {longest + 1:,} bytes"):
        read_scenes(path)


@pytest.mark.long
@pytest.mark.parametrize(
    ("ending", "to", "most"), [(".xml", "mjcf", 5_000), (".sdf", "sdf", 30_000), (".usda", "usd", 15_000)]
)
def test_one_file_with_too_many_scenes(ending, to, most, scenes, tmp_path, monkeypatch):
    monkeypatch.setattr(xml, "MAX_DOCUMENT_BYTES", most)
    with pytest.raises(RequestError, match=r"the first \d do(.|\n)*name a folder"):
        scenes.export(tmp_path / f"x{ending}")
    assert not list(tmp_path.iterdir())
    assert len(scenes.export(tmp_path / "worlds", to)) == 4


@pytest.fixture
def motions(tmp_path):
    """A small file of motions."""
    import scenegen

    timed = parse("object mug\ntime 1 steps\nrequire speed(mug) <= 20 cm/s\ntask: eventually leftOf(mug, (0.5, 0.5))")
    return scenegen.sample_motions(timed, n=2).save(tmp_path / "m.parquet")


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (b"{", "the header of .* is not valid JSON"),
        (b"\xff", "is not UTF-8 text"),
        (b"[1]", 'its "format" is not "scenegen/motions"'),
        (None, "no header under `scenegen`"),
        ("columns", "columns.phi"),
    ],
)
def test_headers_of_motions_that_are_none(header, said, motions):
    import json

    import pyarrow.parquet as pq

    from scenegen.scenes.formats.registry import read_motions

    table = pq.read_table(motions)
    if header == "columns":
        header = json.dumps({**json.loads(table.schema.metadata[b"scenegen"]), "columns": {"phi": [3]}}).encode()
    pq.write_table(table.replace_schema_metadata(None if header is None else {b"scenegen": header}), motions)
    with pytest.raises(DataError, match=said) as caught:
        read_motions(motions)
    assert len(caught.value.diagnostics) == 1


def test_motions_that_fill_the_memory_are_refused(motions, monkeypatch):
    """A column of one value is a few bytes on disk, however long it is."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from scenegen.errors.files import NOT_A_TRAJECTORY
    from scenegen.scenes.formats.registry import read_motions
    from scenegen.scenes.formats.tables import read_table

    table = pq.read_table(motions)
    columns = {name: pa.array(np.full(2_000_000, 1.0)) for name in table.column_names}
    pq.write_table(pa.table(columns).replace_schema_metadata(table.schema.metadata), motions)
    assert motions.stat().st_size < 100_000
    monkeypatch.setattr(parquet, "MAX_NUMBERS", 1_000_000)
    with pytest.raises(DataError, match=r"cannot read .*: [\d,]+ bytes are too many"):
        read_motions(motions)
    with pytest.raises(DataError, match=r"cannot read .*: 16,000,000 bytes are too many"):
        read_table(motions, "a trajectory", NOT_A_TRAJECTORY)
    monkeypatch.setattr(parquet, "MAX_GROUP_BYTES", 1_000)
    with pytest.raises(DataError, match=r"a row group of .* holds"):
        read_motions(motions)


def test_texts_of_tables_are_in_memory_once(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    from scenegen.errors.files import NOT_A_TRAJECTORY
    from scenegen.scenes.formats.tables import read_table

    table = pa.table({"t": ["1", "2.5", None, "x" * 100_000] * 2000, "u": [[0.5]] * 8000})
    pq.write_table(table, tmp_path / "t.parquet")
    assert (tmp_path / "t.parquet").stat().st_size < 2_000_000
    cells = read_table(tmp_path / "t.parquet", "a trajectory", NOT_A_TRAJECTORY).cells("t")
    assert len(cells) == 8000 and len({id(cell) for cell in cells}) < 20
    for name, said in (("t", r"`t` in row 3 is `null`"), ("u", r"`u` in row 1 is `list<.*double>`")):
        with pytest.raises(DataError, match=said):
            read_table(tmp_path / "t.parquet", "a trajectory", NOT_A_TRAJECTORY).column(name)
    numbers = pa.table({"t": ["1", "2.5"]})
    pq.write_table(numbers, tmp_path / "t.parquet")
    found = read_table(tmp_path / "t.parquet", "a trajectory", NOT_A_TRAJECTORY).column("t")
    assert found.tolist() == [1.0, 2.5]


def test_columns_of_motions_that_hold_no_numbers(motions):
    import pyarrow as pa
    import pyarrow.parquet as pq

    from scenegen.scenes.formats.registry import read_motions

    table = pq.read_table(motions)
    pq.write_table(table.append_column("note", pa.array(["a"] * 4)), motions)
    assert len(read_motions(motions)) == 2
    place = table.column_names.index("mug.y")
    pq.write_table(table.set_column(place, "mug.y", pa.array(["a"] * 4)), motions)
    with pytest.raises(DataError, match=r"is damaged at `mug.y`: its values are no numbers"):
        read_motions(motions)
