"""The file of a run, packed while scenes are drawn, with the same bytes."""

import errno
import os

import pytest

from scenegen.errors import OutputError
from scenegen.scenes.shards import folder_of

SMALL = {"checkpoint": 0.0, "size": 300}


@pytest.mark.parametrize("workers", [1, 2])
def test_a_file_that_is_packed_ahead_goes_on(workers, tmp_path, unbroken):
    """With two workers the file is written while scenes are drawn: again from the first one in a run that goes on."""
    from made import Made, stream

    path = tmp_path / "x.parquet"
    asked = iter([False, False, True])
    stream(path, Made(2000), workers=2, spent=lambda: next(asked), **SMALL)
    folder = folder_of(path)
    assert not path.exists() and not list(folder.glob(".*")) and not (folder / "joined").exists()
    (folder / ".joined.abc.part").write_bytes(b"of a run that died")
    asked = iter([False, True])
    stream(path, Made(2000), workers=workers, spent=lambda: next(asked), resume=True, **SMALL)
    assert not list(folder.glob(".*"))
    stream(path, Made(2000), workers=workers, resume=True, **SMALL)
    assert path.read_bytes() == unbroken[".parquet"] and [one.name for one in tmp_path.iterdir()] == [path.name]


def test_a_part_of_a_file_that_was_packed_ahead(tmp_path):
    from made import Made, stream

    for workers in (1, 2):
        asked = iter([False, False, True])
        path = tmp_path / f"{workers}.parquet"
        stream(path, Made(2000), workers=workers, spent=lambda: next(asked), keep_partial=True, **SMALL)  # noqa: B023
    assert (tmp_path / "1.parquet").read_bytes() == (tmp_path / "2.parquet").read_bytes()


def test_a_file_that_cannot_be_packed_ends_the_run(tmp_path, unbroken):
    """It is said, and what was drawn until then is kept."""
    from made import Made, stream

    path, seen = tmp_path / "x.parquet", []

    def full(block):
        seen.append(block.count)
        if len(seen) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OutputError, match=r"no space left(.|\n)*keeps") as caught:
        stream(path, Made(2000), workers=2, joining=full, **SMALL)
    assert "`resume`" in caught.value.diagnostics[0].help and not path.exists()
    stream(path, Made(2000), workers=2, resume=True, **SMALL)
    assert path.read_bytes() == unbroken[".parquet"]
