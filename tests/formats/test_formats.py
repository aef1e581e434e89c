"""What holds for every format of scene files: whatever is written comes back, and damage is told."""

import itertools
import random
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenegen.api.reading import read_scenes
from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.scenes.blocks import BLOCK, Block, joined, regrouped
from scenegen.scenes.formats.registry import FORMATS, format_of, write_scenes
from scenegen.scenes.formats.registry import read_scenes as read_blocks

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
    assert np.array_equal(joined(blocks, 6, 1).rows, whole.rows)


@given(st.lists(st.integers(0, 30), max_size=12), st.integers(1, 20))
def test_regrouping(counts, size):
    numbers = iter(range(10**6))
    blocks = [Block(np.array([[float(next(numbers)) for _ in range(n)]]), np.zeros((0, n))) for n in counts]
    out = list(regrouped(blocks, size))
    assert all(block.count == size for block in out[:-1]) and all(0 < block.count <= size for block in out)
    assert np.array_equal(joined(out, 1, 0).rows, joined(blocks, 1, 0).rows)


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
    assert caught.value.diagnostics[0].help == 'pip install "scenegen[parquet]"'


def test_columns_that_would_share_a_name(scenes, tmp_path):
    header = header_with(scenes, ["phi", "mug"])
    with pytest.raises(OutputError, match=r"`phi\.x`"):
        write_scenes(tmp_path / "x.parquet", header, ("x",), [])
    write_scenes(tmp_path / "x.parquet", header, ("task",), [])
    assert read_blocks(tmp_path / "x.parquet").labels == ("task",)
