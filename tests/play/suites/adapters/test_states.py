"""Files of init states, without LIBERO."""

import zipfile
from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.errors import DataError
from scenegen.libero import set_scene
from scenegen.play.libero.states import SettledStates
from scenegen.play.suites.adapters.libero import read_states

STATES = np.random.default_rng(0).random((3, 5))


def test_states_are_read_as_they_were_written(tmp_path):
    pytest.importorskip("torch")
    spec = SimpleNamespace(live=SimpleNamespace(fixed={"stove": np.arange(7.0)}, task="task"))
    path = SettledStates(STATES, {}, {}, np.zeros(3), spec, 3, 3, 3, {}).save(tmp_path / "task.pruned_init")
    assert np.array_equal(read_states(path), STATES)
    with np.load(f"{path}.npz") as packed:
        assert packed.files == ["states", "task", "fixture stove"] and packed["task"] == "task"
        assert packed["fixture stove"].tolist() == [0, 1, 2, 3, 4, 5, 6]
    tmp_path.joinpath("task.pruned_init.npz").unlink()
    assert np.array_equal(read_states(path), STATES)
    np.savez(f"{path}.npz", any_name=STATES[:2])
    assert np.array_equal(read_states(path), STATES[:2])


def other_names(path, found, written):
    """The same file, as another version of numpy writes it."""
    with zipfile.ZipFile(path) as new, zipfile.ZipFile(f"{path}.other", "w") as other:
        for name in new.namelist():
            other.writestr(name, new.read(name).replace(found, written))
    return path.with_name(f"{path.name}.other")  # read before the next is written


@pytest.mark.parametrize("kind", ["f8", "f4", ">f8", "i8", "i4", "?"])
@pytest.mark.parametrize("zipped", [True, False])
def test_states_of_every_kind_of_number_are_read_by_numpys_old_names_and_new(tmp_path, kind, zipped):
    torch = pytest.importorskip("torch")
    path, wanted = tmp_path / "task.pruned_init", (10 * STATES).astype(kind)
    lists = [list(map(wanted.dtype.type, row)) for row in wanted]  # numpy's own numbers
    for states in (wanted, np.asfortranarray(wanted), [*wanted], lists):
        torch.save(states, path, _use_new_zipfile_serialization=zipped)
        files = [path]
        if zipped:
            files += [
                other_names(path, b"numpy._core.", b"numpy.core."),
                other_names(path, b"numpy.core.", b"numpy._core."),
            ]
        for file in files:
            assert np.array_equal(read_states(file), wanted) and read_states(file).dtype == np.float64
    torch.save(torch.tensor(wanted.astype(wanted.dtype.newbyteorder("="))), path)
    assert np.array_equal(read_states(path), wanted)


@pytest.mark.parametrize(
    "what", [print, np.array([print]), {"states": STATES}, STATES[0], STATES + 1j, [[1], [1, 2]], "x"]
)
def test_a_file_of_anything_else_runs_no_code_and_is_refused(tmp_path, what):
    torch = pytest.importorskip("torch")
    path = tmp_path / "task.pruned_init"
    torch.save(what, path)
    with pytest.raises(DataError) as caught:
        read_states(path)
    assert [one.code for one in caught.value.diagnostics] == ["cannot-read"]
    np.savez(f"{path}.npz", states=np.asarray(what, dtype=object))
    with pytest.raises(DataError, match="no rows of numbers"):
        read_states(path)


@pytest.mark.parametrize("data", [None, b"", b"PK\3\4 garbage", b"states", b"\x93NUMPY"])
def test_files_that_are_missing_or_damaged_are_refused(tmp_path, data):
    pytest.importorskip("torch")
    for name in ("task.pruned_init", "task.pruned_init.npz"):
        path = tmp_path / name
        if data is not None:
            path.write_bytes(data)
        with pytest.raises(DataError) as caught:
            read_states(path) if path.suffix != ".npz" else set_scene(None, path, 0)
        assert [one.code for one in caught.value.diagnostics] == ["cannot-read"]
