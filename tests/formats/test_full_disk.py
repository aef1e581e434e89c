"""A disk that is full in the midst of a large file: the message says so, and what is kept; then the run goes on.

The system's limit on the size of a file stands for the full disk: writes come back short in the same way.
"""

import contextlib
import resource

import numpy as np
import pytest

from scenegen.errors import OutputError
from scenegen.scenes import shards
from scenegen.scenes.blocks import Block
from scenegen.scenes.formats import registry as table


@contextlib.contextmanager
def room_for(size):
    """No file of this process may grow beyond so many bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def block(count):
    random = np.random.default_rng(1)
    return Block(random.random((6, count)), random.random((1, count)))


def steps(scenes, path, *, resume=False, limits=(1 << 40,) * 4):
    """Two blocks with a checkpoint each, then the file; each step under a limit of its own."""
    with shards.open_shards(path, {"n": 1}, 6, resume=resume) as run:
        for number in range(int(run.state.get("used", 0)), 2):
            with room_for(limits[number]):
                run.append(block(2000))
                run.checkpoint({"used": number + 1}, np.zeros((7, 3)))
        with room_for(limits[2]):
            run.join(lambda sink: table.format_of(path).write(sink, scenes.header, ("task",), run.blocks()))
            run.finish()


@pytest.mark.parametrize("ending", [".parquet", ".jsonl"])
@pytest.mark.parametrize("when", ["first shard", "second shard", "joining"])
def test_said_and_kept(when, ending, scenes, tmp_path):
    path = tmp_path / f"x{ending}"
    place = ("first shard", "second shard", "joining").index(when)
    with pytest.raises(OutputError) as caught:
        steps(scenes, path, limits=[*[1 << 40] * place, 50_000, 1 << 40, 1 << 40])
    (problem,) = caught.value.diagnostics
    assert problem.title == f"cannot write {path}: file too large"
    assert "requested and" not in str(caught.value)
    folder = shards.folder_of(path)
    if place == 0:
        assert "nothing was left behind" in problem.help and not list(tmp_path.iterdir())
        return
    assert problem.help.startswith(f"the disk is full; {folder} keeps {2000 * place:,} scenes: ")
    assert folder.is_dir() and not path.exists()
    steps(scenes, path, resume=True)
    steps(scenes, tmp_path / f"y{ending}")
    assert path.read_bytes() == (tmp_path / f"y{ending}").read_bytes() and not folder.exists()


def test_a_file_written_at_once(scenes, tmp_path):
    for ending in (".json", ".jsonl", ".parquet"):
        with room_for(100), pytest.raises(OutputError, match=r"file too large(.|\n)*nothing was left behind"):
            scenes.save(tmp_path / f"x{ending}")
    assert not list(tmp_path.iterdir())
