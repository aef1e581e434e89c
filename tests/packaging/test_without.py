"""Without torch all works but training, models and gradients; without pybullet, all but pictures and settling."""

import json
import os
import subprocess
import sys

import pytest

# Python runs it at the start of every process, workers included.
REFUSE = """
import sys

class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "{package}":
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Refuse())
"""

# Commands one after the other in one process, each with its exit status and what it says.
PROGRAM = """
import contextlib, io, json, sys
from scenegen.cli.app import run
from scenegen.sampling import rarity
from scenegen.sampling.splitting import sampler

sampler.CHAINS, rarity.WORK = 1024, 50_000_000  # the machine's time is for what is missing, not for what is rare

said = []
for command in json.loads(sys.argv[1]):
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        status = run(command.split())
    said.append([status, errors.getvalue()])
try:
    __import__(sys.argv[2])
except ModuleNotFoundError:
    print(json.dumps(said))
"""

SPEC = "object plate at (0.5, 0.5), mug\ntask: leftOf(mug, plate) & closeTo(mug, plate, 0.25)\n"

CORE = [
    "check my.spec",
    "fmt --check my.spec",
    "range my.spec",
    "sample my.spec --phi 0.05: -n 3 --method rejection --out s.json",
    "sample my.spec --phi 0.05: -n 3 --method splitting --workers 2 --out s.jsonl",
    "sample my.spec --phi 0: -n 3 --resume --out s.parquet",  # block by block, as for millions
    "eval my.spec s.json --explain",
    "render s.json --out top --figure heatmap --figure topview",
    "export s.json --to mjcf --out worlds",
    "export s.json --out s.sdf",
    "assets",
]
PICTURES = [
    "sample my.spec -n 1 --settle --workers 1 --out still.json",
    "render s.json --out sweep --size 32x24 --figure sweep --figure sheet --workers 1",
]
LARGE = ["sample my.spec -n 1 --render drawn --out drawn.json", "render s.json --out pictures"]
MODELS = [
    "train my.spec --model flow --out m.safetensors",
    "sample m.safetensors -n 1",
    "info m.safetensors",
]


def child(tmp_path, package, program, *words):
    (tmp_path / "site").mkdir(exist_ok=True)
    (tmp_path / "site" / "sitecustomize.py").write_text(REFUSE.format(package=package))
    (tmp_path / "work").mkdir(exist_ok=True)
    (tmp_path / "work" / "my.spec").write_text(SPEC)
    paths = [str(tmp_path / "site"), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "NO_COLOR": "1", "COLUMNS": "200"}
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(
        command, cwd=tmp_path / "work", env=environment, capture_output=True, text=True, timeout=600, check=True
    ).stdout


def run(tmp_path, package, commands):
    """Exit status and messages of each command, in an empty folder, where a package cannot be imported: it is tried."""
    return json.loads(child(tmp_path, package, PROGRAM, json.dumps(commands), package))


@pytest.mark.long
def test_without_torch(tmp_path):
    commands = [*CORE, *PICTURES, *MODELS]
    for command, (status, said) in zip(commands, run(tmp_path, "torch", commands), strict=True):
        if command in MODELS:
            assert (status, said.startswith("error[not-installed]: torch is needed ")) == (1, True), (command, said)
            assert "pip install torch" in said
        else:
            assert status == 0, (command, said)
    work = tmp_path / "work"
    assert {path.name for path in (work / "sweep").iterdir()} == {"contact_sheet.png", "sweep.png"}
    assert not (work / "m.safetensors").exists()


@pytest.mark.long
def test_without_pybullet(tmp_path):
    pictures = [*PICTURES, *LARGE]
    commands = [*(command.replace("--workers 2", "--workers 1") for command in CORE), *pictures]
    for command, (status, said) in zip(commands, run(tmp_path, "pybullet", commands), strict=True):
        if command in pictures:
            assert (status, said.startswith("error[not-installed]: pybullet is needed ")) == (1, True), (command, said)
            assert "pip install pybullet" in said
        else:
            assert status == 0, (command, said)
    left = {path.name for path in (tmp_path / "work").iterdir()}  # what was refused left nothing
    assert left == {"my.spec", "s.json", "s.jsonl", "s.parquet", "s.sdf", "s_meshes", "top", "worlds"}


@pytest.mark.long
def test_without_usd(tmp_path):
    pytest.importorskip("pxr")
    made = "sample my.spec -n 2 --out s.json"
    commands = [
        "export s.json --to usd --out stages",
        "export s.json --out all.usda",
        "export s.json --to mjcf --out w",
    ]
    (_, *refused, other) = run(tmp_path, "pxr", [made, *commands])
    for status, said in refused:
        assert (status, said.splitlines()) == (
            1,
            [
                "error[not-installed]: pxr is needed to write USD, and is not installed",
                ' = help: pip install "scenegen-dsl[usd]"',
            ],
        )
    assert other[0] == 0
    assert {path.name for path in (tmp_path / "work").iterdir()} == {"my.spec", "s.json", "w"}


FROM_PYTHON = """
import sys
import gymnasium
import scenegen

spec = scenegen.load("my.spec")
scenes = scenegen.sample(spec, phi=(0.0, 0.1), n=4)
scenegen.rarity(spec)
table = gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec="my.spec")
assert table.reset(seed=0, options={"phi": (-0.2, 0.0)})[1]["phi"]["task"] <= 0.0
told = []
for refused in (spec.robustness, scenes.to_torch, lambda: scenegen.load_model("m.safetensors")):
    try:
        refused()
    except scenegen.RequestError as error:
        told.append(str(error))
print(len(told), all("torch is needed" in one for one in told), "torch" in sys.modules)
"""


@pytest.mark.long
def test_the_python_api_without_torch(tmp_path):
    assert child(tmp_path, "torch", FROM_PYTHON) == "3 True False\n"


@pytest.mark.long
def test_no_pictures_without_pybullet_in_notebooks_and_environments(tmp_path):
    program = """
import gymnasium
import scenegen

scenes = scenegen.sample(scenegen.load("my.spec"), n=2)
try:
    gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec="my.spec", render_mode="rgb_array")
except gymnasium.error.Error as error:
    print(error)
print("pybullet is needed" in scenes._repr_html_(), scenes[0]._repr_png_())
try:
    scenegen.load_pybullet(scenes[0])
except scenegen.RequestError as error:
    print(error.diagnostics[0].title)
"""
    assert child(tmp_path, "pybullet", program).splitlines() == [
        "pybullet is needed to draw pictures, and is not installed; pip install pybullet [not-installed]",
        "True None",
        "pybullet is needed for `load_pybullet()`, and is not installed",
    ]
