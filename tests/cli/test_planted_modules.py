"""Every command in a folder full of planted modules, as a downloaded folder of specs may hold them. None runs."""

import importlib.metadata
import json
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = Path(sys.executable).with_name("scenegen")
GOOD = "object mug, plate\ntask: leftOf(mug, plate)\n"
GOAL = "# Bring the mug to the middle.\nworkspace [-1, 1] x [-1, 1]\nobject mug\ngoal: closeTo(mug, (0, 0), 30 cm)\n"
MOVING = (
    "object mug, plate at (0.5, 0.5)\ntime 3 steps\nrequire speed(mug) <= 30 cm/s\nt: eventually leftOf(mug, plate)\n"
)
TRAY = 'object tray = mesh("tray.stl"), mug\ntask: leftOf(mug, tray)\n'
PLANTED = "with open({mark!r}, 'a') as file: file.write({name!r} + chr(10))\n"


def names():
    """All modules of Python and of what is installed, whether it is needed or not."""
    found = {"scenegen", "sitecustomize", "usercustomize", *sys.stdlib_module_names}
    found |= importlib.metadata.packages_distributions().keys() | {"torch", "ray", "robosuite", "jax", "tqdm"}
    return sorted(name for name in found if name.isidentifier())


def tray():
    """A mesh that is not convex, as STL."""
    from scenegen.things.mesh import box, join
    from scenegen.worlds.export.meshes import stl

    return stl(join([box(0.2, 0.1, 0.01), box(0.01, 0.1, 0.05).shift(x=0.1, z=0.02)]))


def commands():
    """words of each command, in an order in which one makes what a later one reads."""
    lines = """
        new new.spec
        specs
        import task.bddl --out task.spec
        check good.spec
        fmt good.spec
        range good.spec --json
        train good.spec --out m.safetensors --scenes 640 --epochs 1 --timeout 60
        info m.safetensors
        sample m.safetensors -n 2
        sample good.spec --phi 0:0.2 -n 200 --workers 2 --out s.json
        sample good.spec --phi 0:0.2 -n 2 --render drawn --workers 2
        sample good.spec --satisfied -n 2 --settle --out four.json
        sample good.spec --satisfied -n 65536 --workers 2 --out set/
        sample moving.spec --phi 0: -n 4 --out moved.jsonl
        pairs good.spec -n 4 --workers 2 --out pairs.json
        eval good.spec s.json
        eval moving.spec moved.jsonl
        render four.json --out pictures --workers 2 --size 64x48
        render moved.jsonl --out motions --figure strip --size 64x48
        export s.json --to mjcf --out worlds
        export s.json --out s.parquet
        sample tray.spec -n 2 --out tray.json
        export tray.json --to mjcf --out trays --meshes .
        settle four.json --out settled.json --workers 2
        assets mug --out assets --size 64x48 --workers 2
        dataset good.spec --out data/ -n 100 --workers 2
        data set/ --timeout 0 --workers 2
        data filter set/ --phi 0:0.1 --out hard/
        data merge set/ hard/ --out both/
        grammar good.spec
        explain no-egl
        relations closeTo
        view good.spec --export page.html -n 4
        suite new goal.spec --bands 2 -n 30 --out mine/
        suite run mine --world toy_world.py:make --policy toy_world.py:towards --out o.jsonl --workers 2 --steps 60
        stage mat mine --paper a0 --out mat.pdf
        fit o.jsonl --suite mine --out policy.fit
        sample goal.spec --success 0.1: --under policy.fit -n 2 --workers 2
    """
    return [line.split() for line in lines.strip().splitlines()]


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """A folder with a few specs and all the modules; `run` runs a command in it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("PYTHONPATH", raising=False)
    folder = tmp_path / "specs"
    folder.mkdir()
    for name, text in (("good", GOOD), ("goal", GOAL), ("moving", MOVING), ("tray", TRAY)):
        (folder / f"{name}.spec").write_text(text)
    (folder / "tray.stl").write_bytes(tray())
    shutil.copy(ROOT / "tests" / "planning" / "tasks" / "mugs_plates.bddl", folder / "task.bddl")
    shutil.copy(ROOT / "tests" / "play" / "suites" / "toy.py", folder / "toy_world.py")
    for name in names():
        (folder / f"{name}.py").write_text(PLANTED.format(mark=str(tmp_path / "ran"), name=name))
    monkeypatch.chdir(folder)
    return tmp_path / "ran"


def ran(planted):
    return planted.read_text().split() if planted.exists() else []


def run(words):
    return subprocess.run([PROGRAM, *words], capture_output=True, text=True, timeout=300)


def test_workers(planted):
    done = run("sample good.spec --phi 0:0.2 -n 4 --workers 2".split())
    assert ran(planted) == [] and done.returncode == 0, done.stderr


@pytest.mark.long
def test_the_language_server(planted):
    def message(method, params, **more):
        body = json.dumps({"jsonrpc": "2.0", "method": method, "params": params, **more}).encode()
        return b"Content-Length: %d\r\n\r\n%b" % (len(body), body)

    document = {"uri": (Path.cwd() / "good.spec").as_uri(), "languageId": "scenegen", "version": 1, "text": "t: near"}
    place = {"textDocument": {"uri": document["uri"]}, "position": {"line": 0, "character": 1}}
    process = subprocess.Popen([PROGRAM, "lsp"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    said = message("initialize", {"processId": None, "rootUri": None, "capabilities": {}}, id=1)
    said += message("textDocument/didOpen", {"textDocument": document}) + message("textDocument/hover", place, id=2)
    process.stdin.write(said)
    process.stdin.flush()
    heard = b""
    while b"publishDiagnostics" not in heard:
        heard += process.stdout.read1()
    process.stdin.write(message("shutdown", None, id=3) + message("exit", None))
    process.communicate(timeout=30)
    assert ran(planted) == [] and process.returncode == 0


@pytest.mark.long
def test_the_page(planted, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    connect = pytest.importorskip("websockets.sync.client").connect
    process = subprocess.Popen([PROGRAM, "view", "good.spec"], stderr=subprocess.PIPE, text=True)
    link = next(filter(None, (re.search(r"http://(\S+?)/\?token=(\S+)", line) for line in process.stderr)))
    with urllib.request.urlopen(link[0]) as answer:
        assert answer.status == 200
    with connect(f"ws://{link[1]}/api/socket?token={link[2]}") as line:
        line.send(json.dumps({"id": 1, "job": "check", "text": GOOD}))
        assert "id" in json.loads(line.recv(timeout=60))
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=30)
    assert ran(planted) == []


@pytest.mark.long
def test_all_other_commands(planted):
    for words in commands():
        done = run(words)
        assert (ran(planted), done.returncode) == ([], 0), f"{words}: {done.stderr}"
    assert (run(["libero", "libero_spatial", "--out", "states"]).returncode, ran(planted)) == (1, [])  # not installed
    assert (run(["arm", "none.urdf", "--tip", "hand", "--out", "arm.toml"]).returncode, ran(planted)) == (1, [])
    called = {words[0] for words in commands()} | {"view", "lsp", "libero", "arm"}
    from scenegen.cli.app import COMMANDS

    assert called == COMMANDS.keys()
