"""`scenegen suite envhub`: the folder, and what is refused."""

import importlib.util

import pytest

from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.errors.worlds import WORLD_FAILS
from scenegen.play.suites.harnesses.envhub import write_envhub
from scenegen.play.suites.harnesses.groups import group_name
from scenegen.play.suites.suite import Suite

from . import worlds

WORLD = f"{worlds.__name__}:Forgetful"


def test_a_folder_has_the_suite_and_one_file(small, tmp_path):
    out = tmp_path / "hub"
    names = write_envhub(small, out, world=WORLD, steps=7)
    assert sorted(one.name for one in out.iterdir()) == sorted(names)
    assert set(names) == {"env.py", *(one.name for one in small.iterdir())}
    for one in small.iterdir():
        assert (out / one.name).read_bytes() == one.read_bytes()
    again = tmp_path / "again"
    write_envhub(small, again, world=WORLD, steps=7)
    assert (again / "env.py").read_bytes() == (out / "env.py").read_bytes()


@pytest.mark.parametrize("reverse", [False, True])
def test_env_py_makes_the_environments(small, tmp_path, reverse):
    """As LeRobot imports it: from a file, under any name."""
    write_envhub(small, tmp_path / "hub", world=WORLD, steps=7, reverse=reverse)
    spec = importlib.util.spec_from_file_location("hub_env_me_graded", tmp_path / "hub" / "env.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    suite = Suite.load(small, reverse=reverse)
    envs = module.make_env(n_envs=2, use_async_envs=False)[group_name(suite)][0]
    assert envs.call("_max_episode_steps") == (7, 7)
    seen = envs.reset()[0]["environment_state"]
    assert [row.tobytes() for row in seen] == [suite[k].poses.tobytes() for k in range(2)]


def test_the_name_of_a_suite_is_no_code(small, tmp_path):
    """It may have quotes and braces."""
    odd = tmp_path / '"""; import nothing {x} \''
    odd.mkdir()
    text = (small / "suite.json").read_text()
    for one in small.iterdir():
        (odd / one.name).write_bytes(one.read_bytes())
    (odd / "suite.json").write_text(text)
    write_envhub(odd, tmp_path / "hub", world=WORLD)
    compile((tmp_path / "hub" / "env.py").read_text(), "env.py", "exec")


@pytest.mark.parametrize(
    "suite, world, error, said",
    [
        ("small", "nothing:at_all", ScenegenError, "cannot be made"),
        ("small", f"{worlds.__name__}:broken", ScenegenError, "no display"),
        ("small", "here.py:World", RequestError, "no file but the suite's own"),
        ("small", "nobody", RequestError, "nobody"),
        ("small", "hand:", RequestError, "needs no person"),
        ("none", WORLD, DataError, "none"),
    ],
)
def test_what_is_refused(small, tmp_path, monkeypatch, suite, world, error, said):
    """With one diagnostic, and nothing written."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small").symlink_to(small)
    with pytest.raises(error, match=said) as caught:
        write_envhub(suite, "hub", world=world)
    assert len(caught.value.diagnostics) == 1 and not (tmp_path / "hub").exists()
    if error is ScenegenError:
        assert caught.value.diagnostics[0].kind is WORLD_FAILS


def test_a_folder_that_exists_stays_as_it_is(small, tmp_path):
    (tmp_path / "hub").mkdir()
    with pytest.raises(OutputError, match="there already"):
        write_envhub(small, tmp_path / "hub", world=WORLD)
    assert not list((tmp_path / "hub").iterdir())
