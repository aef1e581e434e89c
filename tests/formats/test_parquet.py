"""Parquet as other programs see it, and Parquet files that are not ours."""

import errno
import gc
import io
import json
import math

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenegen.api.reading import read_scenes
from scenegen.errors import DataError
from scenegen.scenes.blocks import BLOCK, Block
from scenegen.scenes.formats import parquet
from scenegen.scenes.formats.registry import write_scenes


@pytest.fixture
def path(scenes, tmp_path):
    return scenes.save(tmp_path / "x.parquet")


def test_golden_schema(scenes, tmp_path, golden):
    header = scenes.header.model_copy(update={"sampler": {"method": "by hand"}})
    write_scenes(tmp_path / "x.parquet", header, ("task", "safe"), [])
    parquet = pq.ParquetFile(tmp_path / "x.parquet")
    lines = [f"{field.name}: {field.type}{'' if field.nullable else ' not null'}" for field in parquet.schema_arrow]
    header = json.loads(parquet.metadata.metadata[b"scenegen"])
    golden("formats/parquet.txt", "\n".join([*lines, json.dumps(header, indent=1)]) + "\n")


def test_pyarrow_alone_reads_it(path, scenes):
    table = pq.read_table(path)
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


def test_of_another_program(path, tmp_path):
    table = pq.read_table(path)
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
        assert list(read_scenes(tmp_path / "other.parquet")) == list(read_scenes(path))
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
