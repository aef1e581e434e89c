"""`scenegen suite envhub`: a suite as a folder that LeRobot loads from the hub, `env.py` and the suite's files."""

from __future__ import annotations

from pathlib import Path

from scenegen.errors import RequestError
from scenegen.errors.requests import WRONG_VALUE
from scenegen.play.suites.episodes import check_steps, make_world
from scenegen.play.suites.loading import HAND, check_name
from scenegen.play.suites.suite import SUITE_JSON, Suite, find_suite, read_manifest
from scenegen.resources import __version__
from scenegen.scenes.files import read_bytes, refuse_existing, whole_files
from scenegen.validation import as_path

ENV_PY = "env.py"
SOURCE = """# The suite {name}, for LeRobot: make_env("OWNER/NAME", trust_remote_code=True).
# Written by scenegen {version}, which it needs: pip install scenegen-dsl. The suite's digest is {digest}.

from pathlib import Path

from scenegen.play.suites.harnesses.lerobot import make_suite_envs


def make_env(n_envs=1, use_async_envs=False, cfg=None):
    folder = Path(__file__).absolute().parent
    return make_suite_envs(folder, {world!r}, n_envs, use_async_envs, cfg, steps={steps}, reverse={reverse})
"""


def write_envhub(
    suite: str | Path, out: str | Path, *, world: str, steps: int = 1000, reverse: bool = False
) -> list[str]:
    """Write a suite as a new folder for LeRobot's EnvHub; returns the names of its files. The world is made once, for
    its first task, before anything is written. Raises DataError, RequestError, OutputError, and ScenegenError for a
    world that cannot be made."""
    out, steps = as_path("out", out), check_steps(steps)
    check_name("world", world)
    if world.rpartition(":")[0].endswith(".py"):
        wanted = "a name, or MODULE:NAME of a package: no file but the suite's own goes to the hub"
        raise RequestError(WRONG_VALUE(argument="world", value=f"`{world}`", wanted=wanted))
    if world.startswith(HAND):
        wanted = "a simulator, which needs no person"
        raise RequestError(WRONG_VALUE(argument="world", value=f"`{world}`", wanted=wanted))
    refuse_existing(out)
    loaded, folder = Suite.load(suite, reverse=reverse), find_suite(suite)
    make_world(world, loaded.tasks[0]).close()
    manifest = read_manifest(folder)
    text = SOURCE.format(
        name=loaded.name, world=world, version=__version__, digest=loaded.digest, steps=steps, reverse=reverse
    )
    names = [SUITE_JSON, *(task.scenes for task in (*manifest.tasks, *manifest.reversed))]
    with whole_files(out) as put:
        for name in names:
            put(name, read_bytes(folder / name, "a file of the suite"))
        put(ENV_PY, text.encode())
    return [*names, ENV_PY]
