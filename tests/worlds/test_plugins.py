"""Export formats of other packages, by entry points: that of docs/extending.md, installed into a folder, and broken."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

from scenegen import parse, sample
from scenegen.conformance import check_exporter
from scenegen.errors import RequestError
from scenegen.worlds.exporting import EXPORTS, export_format, exporter

PAGE = Path(__file__).parents[2] / "docs" / "extending.md"
SPEC = "object mug, plate\ntask: leftOf(mug, plate)\n"


def blocks():
    """The files of the reader's own in the section about packages."""
    section = PAGE.read_text().partition("## Export formats of other packages")[2].partition("\n## ")[0]
    return dict(re.findall(r"^```\w+ file=(\S+)\n(.*?)^```$", section, re.MULTILINE | re.DOTALL))


def installed(folder, project, modules):
    """A distribution as installers leave it in a folder."""
    for name, text in modules.items():
        (folder / name).write_text(text)
    info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    lines = [
        line
        for group, points in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in points.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def package(name, **points):
    return {"name": name, "version": "0.1", "entry-points": {"scenegen.exporters": points}}


@pytest.fixture
def points(tmp_path, monkeypatch):
    """The package of the page, installed, and the folder of it."""
    files = blocks()
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    installed(
        folder, tomllib.loads(files["pyproject.toml"])["project"], {"scenegen_points.py": files["scenegen_points.py"]}
    )
    monkeypatch.delitem(sys.modules, "scenegen_points", raising=False)
    return folder


def test_scenes_in_the_format_of_the_page(points, tmp_path):
    scenes = sample(parse(SPEC), n=2, seed=1)
    paths = scenes.export(tmp_path / "out", to="points")
    assert [path.name for path in paths] == ["scene_0001.points", "scene_0002.points"]
    name, mass, x, y, *_ = paths[1].read_text().split()
    assert name == "mug" and [float(x), float(y)] == scenes.poses[1, 0, :2].tolist() and float(mass) > 0.0
    assert any((tmp_path / "out" / "meshes").iterdir())
    (whole,) = scenes.export(tmp_path / "all.points", to="points")
    assert whole.read_text().split("\n\n") == [path.read_text() for path in paths]
    with pytest.raises(RequestError, match="mjcf"):
        scenes.export(tmp_path / "all.xml", to="points")


@pytest.mark.long
def test_the_command_and_the_authors_own_test(points, tmp_path):
    scenes = sample(parse(SPEC), n=2, seed=1)
    scenes.save(tmp_path / "s.json")
    words = [sys.executable, "-m", "scenegen", "export", "s.json", "--to", "points", "--out", "out"]
    subprocess.run(words, cwd=tmp_path, env=environment(points), check=True)
    assert (tmp_path / "out" / "scene_0002.points").exists()
    namespace = {}
    exec(blocks()["test_points.py"], namespace)  # noqa: S102 - the page's
    namespace["test_the_format"]()


def environment(folder):
    return {**os.environ, "PYTHONPATH": f"{folder}:{os.environ.get('PYTHONPATH', '')}"}


def test_names_of_formats_are_listed_with_those_of_packages(points, tmp_path):
    with pytest.raises(RequestError) as caught:
        export_format("pionts", tmp_path)
    assert "did you mean `points`?" in str(caught.value)


@pytest.mark.parametrize(
    ("packages", "reason"),
    [
        ([package("other", mjcf="json")], "scenegen has one of this name itself"),
        ([package("one", odd="json"), package("two", odd="math")], "has one of this name, too"),
        ([package("lost", odd="no_such_module")], "cannot be loaded: ModuleNotFoundError"),
        ([package("poor", odd="json")], "json has no `ENDING`"),
    ],
)
def test_a_format_that_cannot_be_used_is_one_diagnostic(packages, reason, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    for one in packages:
        installed(tmp_path, one, {})
    with pytest.raises(RequestError) as caught:
        exporter(export_format("odd", tmp_path / "out"))
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "bad-plugin" and reason in str(caught.value)


def test_formats_of_our_own_need_no_entry_points(monkeypatch, tmp_path):
    monkeypatch.setattr("importlib.metadata.entry_points", None)
    for name in (*EXPORTS, "pddl", "json"):
        assert export_format(name, tmp_path) == name


@pytest.mark.long
@pytest.mark.parametrize("name", EXPORTS)
def test_formats_of_our_own_conform(name):
    if name == "usd":
        pytest.importorskip("pxr")
    check_exporter(exporter(name))


def lines(world, *, mass=1.0, named=True, shift=0.0):
    return [
        "\n".join(
            f"{body.name if named else ''} {body.mass * mass} {x + shift} {y}"
            for body, (x, y, *_) in zip(world.bodies, poses, strict=True)
        ).encode()
        for poses in world.poses.tolist()
    ]


@pytest.mark.parametrize(
    ("module", "reason"),
    [
        ({"files": None}, "ENDING is None"),
        ({"ENDING": ".x", "files": lambda world, folder, together: [b"x"]}, "1 files of 3 scenes"),
        ({"ENDING": ".x", "files": lambda world, folder, together: lines(world, named=False)}, "does not name mug"),
        ({"ENDING": ".x", "files": lambda world, folder, together: lines(world, mass=2.0)}, "has the mass of mug"),
        ({"ENDING": ".x", "files": lambda world, folder, together: lines(world, shift=0.01)}, "has no x ="),
        ({"ENDING": ".x", "files": lambda world, folder, together: lines(world)}, "together=True: 3 files of 3"),
        ({"ENDING": ".x", "files": None, "meshes": lambda world: [("a/b.obj", b"")]}, "needs a plain file name"),
    ],
)
def test_what_does_not_conform_is_said(module, reason):
    parts = {"ENDING": None, "meshes": lambda world: [], **module}
    with pytest.raises(AssertionError, match=re.escape(reason)):
        check_exporter(SimpleNamespace(**parts))
