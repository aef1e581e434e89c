"""Places that cannot be written to: refused before the work where that can be known, and never half a file. Where the
system lets no more processes, threads or files begin: one plain error.
"""

import errno
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scenegen.cli import app
from scenegen.cli.app import WRITTEN
from scenegen.pictures.render import scenes as pictures
from scenegen.scenes import files
from scenegen.worlds import exporting as simulators
from tests.cli.conftest import _built

COMMANDS = {
    "sample": ["sample", "good.spec", "-n", "4", "--out"],
    "train": ["train", "good.spec", "--model", "gan", "--data", "uniform", "--epochs", "1", "--scenes", "64", "--out"],
    "render": ["render", "s.json", "--size", "32x32", "--workers", "1", "--out"],
    "export": ["export", "s.json", "--to", "mjcf", "--out"],
}
DIFFERENT = {
    "sample": ["--seed", "5"],
    "train": ["--seed", "5"],
    "render": ["--size", "40x40"],
    "export": ["--to", "sdf"],
}
ENDING = {"sample": ".json", "train": ".safetensors", "render": "", "export": ""}


@pytest.fixture
def scenes(here):
    import scenegen

    scenegen.sample(scenegen.load("good.spec"), n=3).save("s.json")


@pytest.fixture
def no_work(monkeypatch):
    """Fails the test where work begins although its result has nowhere to go."""

    def started(*_, **__):
        raise AssertionError("work was begun")

    monkeypatch.setattr("scenegen.sampling.choice.choose", started)
    monkeypatch.setattr("scenegen.learn.training.loop._run", started)
    monkeypatch.setattr(pictures, "draw", started)
    monkeypatch.setattr(simulators, "worlds_of", started)


@pytest.mark.parametrize("command", COMMANDS)
def test_folder_that_does_not_exist(command, refusal, scenes, no_work):
    refusal("files", f"output_{command}_no_folder")


@pytest.mark.parametrize("command", COMMANDS)
def test_below_a_file(command, refusal, scenes, no_work):
    refusal("files", f"output_{command}_below_a_file")


def test_a_folder_in_the_file_s_place(refused, here, no_work):
    (here / "x.json").mkdir()
    assert "is a directory" in refused(*COMMANDS["sample"], "x.json")
    assert "is a directory" in refused(*COMMANDS["train"], "x.json")


def test_pictures_over_a_file(refused, here, scenes, no_work):
    (here / "out").write_text("mine")
    refused(*COMMANDS["render"], "out")
    refused("sample", "good.spec", "--out", "o.json", "--render", "out")


@pytest.mark.parametrize("command", COMMANDS)
def test_a_kernel_that_refuses(command, refused, scenes, no_work):
    """Permission bits do not stop root; the kernel's own file system does."""
    said = refused(*COMMANDS[command], f"/sys/scenegen{ENDING[command]}")
    assert said.startswith(f"error[cannot-write]: cannot write /sys/scenegen{ENDING[command]}: ")


@pytest.mark.parametrize("code", [errno.EROFS, errno.EACCES], ids=errno.errorcode.get)
@pytest.mark.parametrize("command", COMMANDS)
def test_read_only(command, code, refusal, here, scenes, no_work, monkeypatch):
    (here / "shelf").mkdir()
    really = os.open

    def refuse(path, flags, *rest, **named):
        if flags & (os.O_WRONLY | os.O_RDWR) and "shelf" in os.fspath(path):
            raise OSError(code, os.strerror(code), path)
        return really(path, flags, *rest, **named)

    monkeypatch.setattr(os, "open", refuse)
    refusal("files", f"output_{command}_{errno.errorcode[code].lower()}")


class _Full:
    """A file on a disk that takes so many bytes and no more, all files together."""

    left = 0

    def __init__(self, file):
        self._file = file

    def write(self, data):
        if len(data) > _Full.left:
            self._file.write(data[: _Full.left])
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        _Full.left -= len(data)
        return self._file.write(data)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._file.close()

    def __getattr__(self, name):
        return getattr(self._file, name)


@pytest.mark.long
@pytest.mark.parametrize("there", [False, True], ids=["new", "there"])
@pytest.mark.parametrize("command", COMMANDS)
def test_disk_full_half_way(
    command, there, snapshot, assert_one_diagnostic, scenegen, here, scenes, monkeypatch, message
):
    target = f"x{ENDING[command]}"
    *words, last = COMMANDS[command]
    if there:
        assert scenegen(*words, last, target).status == 0
        words += DIFFERENT[command]
    wrap = os.fdopen
    monkeypatch.setattr(files.os, "fdopen", lambda *words, **named: _Full(wrap(*words, **named)))
    monkeypatch.setattr(_Full, "left", 300)
    before = snapshot(here)
    outcome = scenegen(*words, last, target)
    assert (outcome.status, outcome.out, snapshot(here)) == (1, "", before)
    said = "".join(line for line in outcome.err.splitlines(True) if not line.startswith("gan: epoch"))
    assert_one_diagnostic(said)
    message("cli/errors/files", f"output_{command}_full", said)


AS_ANOTHER = ["setpriv", "--reuid=12345", "--regid=12345", "--clear-groups"]
CAPS = "dac_override,+dac_read_search"  # reads and writes what root may; no more processes than others
AS_ANOTHER += [f"--{kind}=-all,+{CAPS}" for kind in ("inh-caps", "ambient-caps", "bounding-set")]
WORDS = ["sample", "good.spec", "--phi", "0:0.2", "-n", "70000", "--workers", "6", "--out", "set/"]


@pytest.mark.parametrize(
    "error", [RuntimeError("can't start new thread"), OSError(11, os.strerror(11)), OSError(24, os.strerror(24))]
)
def test_a_thread_that_cannot_start(error, scenegen, here, monkeypatch, assert_one_diagnostic):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(app, "build", lambda words: fails)
    said = scenegen("check", "good.spec").err
    assert "error[cannot-start-process]: cannot start a process or thread: " in said
    assert_one_diagnostic(said)


def test_libraries_that_find_no_memory(scenegen, here, monkeypatch, assert_one_diagnostic):
    def fails(*_, **__):
        raise ImportError("libtorch_cpu.so: failed to map segment from shared object")

    monkeypatch.setattr(app, "build", lambda words: fails)
    said = scenegen("check", "good.spec").err
    assert "error[out-of-memory]" in said
    assert_one_diagnostic(said)


@pytest.mark.long
@pytest.mark.skipif(shutil.which("setpriv") is None or os.geteuid() != 0, reason="needs another user")
@pytest.mark.parametrize("limit", ["-u 2", "-u 5", "-u 8", "-n 14"])
def test_few_processes_or_files(limit, here, assert_one_diagnostic):
    here.chmod(0o777)
    program = [str(Path(sys.executable).with_name("scenegen")), *WORDS]
    words = [*AS_ANOTHER, "bash", "-c", f'ulimit {limit}; exec "$@"', "x", *program]
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(words, cwd=here, env=environment, capture_output=True, text=True, timeout=120)
    lines = [line for line in done.stderr.splitlines() if not line.startswith(("<jemalloc>", "rejection: "))]
    assert done.returncode == 1 and "error[cannot-start-process]" in lines[0]
    assert_one_diagnostic("\n".join(lines))


# ---- One rule for all commands: what is written is none of what is read, and lies in no suite and no set.

NAMES_PLACES = re.compile("FILE|DIR|URL|SPEC|SCENES|MODEL|SET|PLACE|LOOKS|TASK|TOML|PROBLEM|DOMAIN|OUTCOMES|FIT")
READ = {  # of all commands; what a command writes is in `WRITTEN`
    *("spec", "specs", "scenes", "sources", "fix_from", "under", "model", "what", "looks", "meshes", "root", "data"),
    *("against", "problem", "domain", "table", "name", "outcomes", "suite", "places", "world", "policy", "sets"),
    "urdf",
    *("photo", "corners", "poses", "camera", "order"),
}


def parameters():
    """Every command and each of its parameters that names a file or a folder."""
    for name, command in _built().commands.items():
        for one in command.params:
            metavar = one.metavar or ""
            if one.type.name == "path" or (one.type.name == "str" and NAMES_PLACES.search(metavar)):
                yield name, one


def words(command, /, **given):
    """A command with these values, and with others for what it must be given."""
    options, arguments = [], []
    for one in _built().commands[command].params:
        usual = {"action": "run", "out": "new/"}.get(one.name, "f")
        value = given.get(one.name, usual if one.required else None)
        if value is not None and one.opts[0].startswith("-"):
            options += [one.opts[0], value]
        elif value is not None:
            arguments.append(value)
    return [command, *options, "--", *arguments]


PAIRS = sorted(
    (name, out.name, read.name)
    for name, out in parameters()
    for other, read in parameters()
    if name == other and out.name in WRITTEN and not out.multiple and read.name not in WRITTEN
)


def test_every_parameter_that_names_a_file_is_an_input_or_an_output():
    unknown = {(name, one.name) for name, one in parameters() if one.name not in READ | {*WRITTEN}}
    assert not unknown, "a new parameter that names files goes into READ here, or into WRITTEN of cli/app.py"
    assert len(PAIRS) > 50 and not READ & {*WRITTEN}
    with_outputs = {name for name, one in parameters() if one.name in WRITTEN}
    others = {"check", "fmt", "info", "lsp"}  # read files, and write none but the one that `fmt` rewrites
    assert with_outputs | others == {name for name, _ in parameters()}


@pytest.mark.parametrize("name, out, read", PAIRS)
def test_no_output_is_an_input(name, out, read, refused, here):
    (here / "f").write_text("of the user")
    given = "f:act" if read in ("world", "policy") else "f"
    os.link(here / "f", here / "hard")
    (here / "link").symlink_to("f")
    (here / "below").mkdir()
    for same in ("f", "below/../f", "link", "hard"):
        assert "it would overwrite what it is made from" in refused(*words(name, **{read: given, out: same})), same


@pytest.mark.parametrize("name, out", sorted({pair[:2] for pair in PAIRS} | {("assets", "out"), ("new", "out")}))
def test_no_output_lies_in_a_suite_or_a_set(name, out, refused, here):
    (here / "f").write_text("of the user")
    for folder, file, kind in (("m", "suite.json", "suite"), ("set", "manifest.json", "set")):
        (here / folder / "below").mkdir(parents=True)
        (here / folder / file).write_text(f'{{\n "format": "scenegen/{kind}",\n "version": 1}}')
        (here / f"link_{folder}").symlink_to(folder)
        for place in (f"{folder}/x", f"{folder}/below/x", f"{folder}/{file}", f"link_{folder}/x"):
            said = refused(*words(name, **{out: place}))
            assert f"{here / folder} is a suite or a set of scenes" in said, place
    assert "it stands for standard input" in refused(*words(name, **{out: "-"}))


def test_a_manifest_of_another_program_freezes_nothing(scenegen, here):
    (here / "manifest.json").write_text('{"name": "an extension of a browser"}')
    assert scenegen("sample", "good.spec", "-n", "2", "--out", "s.json").status == 0


def test_what_a_spec_is_made_of_is_an_input_too(refused, scenegen, here):
    """Imports and meshes are found out while a spec is read, textures of looks while pictures are made."""
    (here / "lib.spec").write_text("def near(a, b) = closeTo(a, b, 20 cm)\n")
    (here / "main.spec").write_text('import "lib.spec"\nobject mug, plate\ntask: near(mug, plate)\n')
    (here / "box.png").symlink_to("lib.spec")
    for command in (["range", "main.spec", "--png", "box.png"], ["grammar", "main.spec", "--out", "lib.spec"]):
        assert "it would overwrite what it is made from" in refused(*command)
    (here / "meshes").mkdir()
    corners = [f"v {x} {y} {z}" for x in (0, 0.1) for y in (0, 0.1) for z in (0, 0.1)]
    faces = ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
    (here / "meshes" / "mesh_1.obj").write_text("\n".join([*corners, *faces]))  # as `export` calls what it makes of it
    (here / "own.spec").write_text('object box = mesh("meshes/mesh_1.obj")\nright: x(box) >= 50 cm\n')
    assert scenegen("sample", "own.spec", "-n", "1", "--out", "s.json").status == 0
    said = refused("export", "s.json", "--to", "mjcf", "--meshes", ".", "--out", ".")
    assert "meshes/mesh_1.obj: it would overwrite what it is made from" in said


def test_a_suite_is_not_made_over_another_nor_over_other_files(refused, scenegen, here):
    assert scenegen("suite", "new", "good.spec", "--bands", "1", "-n", "1", "--out", "m").status == 0
    said = refused("suite", "new", "forks.spec", "--bands", "1", "-n", "1", "--out", "m")
    assert f"{here / 'm'} is a suite or a set of scenes" in said
    (here / "mine").mkdir()
    (here / "mine" / "good.json").write_text("of the user")
    assert "mine/good.json: it is there already" in refused("suite", "new", "good.spec", "--out", "mine")


@pytest.mark.parametrize(
    "words, better",
    [
        (["fit", "f", "--suite", "m", "--out", "x.spec"], "x.fit"),
        (["import", "f", "--out", "x.json"], "x.spec"),
        (["suite", "run", "tabletop", "--world", "w:w", "--policy", "p:p", "--out", "x.json"], "x.jsonl"),
        (["range", "good.spec", "--png", "x.json"], "x.png"),
        (["view", "good.spec", "--export", "x.py"], "x.html"),
    ],
)
def test_an_ending_says_what_a_file_is(words, better, refused, here):
    (here / "f").write_text("")
    said = refused(*words)
    assert "error[wrong-ending]" in said and f"name it {better}\n" in said
