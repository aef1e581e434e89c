"""docs/relations.md and its pictures are what docs/make_relations.py makes; docs/extending.md's new relation works."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


GOLDENS = Path("tests/golden/lang/relations")


@pytest.fixture(scope="module")
def made():
    """What docs/make_relations.py would write: path -> text."""
    spec = importlib.util.spec_from_file_location("make_relations", ROOT / "docs" / "make_relations.py")
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.files()


def test_the_page_and_its_pictures_are_up_to_date(made, derived):
    pictures = set((ROOT / "docs" / "images" / "relations").iterdir())
    assert pictures <= set(made), "pictures of no relation: `make derived` removes them"
    for path, text in made.items():
        derived(str(path.relative_to(ROOT)), text)


def test_pictures_are_well_formed(made):
    for path, text in made.items():
        if path.suffix == ".svg":
            ET.fromstring(text)


def test_the_page_shows_each_relation_with_all_there_is_to_say(made):
    page = made[ROOT / "docs" / "relations.md"]
    names = re.findall(r"^### (\w+)$", page, re.MULTILINE)
    assert len(names) == len(set(names)) == len(made) - 1
    for section in re.split(r"^### ", page, flags=re.MULTILINE)[1:]:
        assert re.search(r"^\w.*\.$", section, re.MULTILINE), f"no meaning: {section}"
        assert re.search(r"^\* formula: `.+`$", section, re.MULTILINE)
        assert re.search(r"^\* unit: \S", section, re.MULTILINE), f"no unit: {section}"
        for constant in re.findall(r"= ([A-Z_]+)", section.splitlines()[2]):
            assert re.search(rf"^\* defaults: .*`{constant}` = \S", section, re.MULTILINE), section


def copy(folder):
    """The parts of the project that a relation lives in, with what is compiled of them."""
    for name in ("scenegen", "grammar", GOLDENS):
        shutil.copytree(ROOT / name, folder / name)
    for name in (
        "tests/conftest.py",
        "tests/corpus.py",
        "tests/forks.py",
        "tests/laws.py",
        "tests/lang/test_relations.py",
        "tests/lang/relation_scenes.py",
    ):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    (folder / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "make_relations.py", folder / "docs")
    shutil.copy(ROOT / "pyproject.toml", folder)


@pytest.mark.long
def test_the_relation_of_extending_md(tmp_path):
    """One line in the prelude and one golden file: the golden test passes, and the page shows it."""
    page = (ROOT / "docs" / "extending.md").read_text()
    (spec,) = re.findall(r"^```spec file=relation.spec\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    ((name, golden),) = re.findall(r"^```golden file=(\w+).txt\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    definition = re.sub(r"^task:.*\n", "", spec, flags=re.MULTILINE)
    assert f"def {name}(" in definition

    def run(*command):
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), "OMP_NUM_THREADS": "1"}
        command = [sys.executable, *command]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120)

    copy(tmp_path)
    prelude = tmp_path / "grammar" / "prelude.spec"
    prelude.write_text(f"{prelude.read_text()}\n{definition}")
    assert "FileNotFoundError" in run("docs/make_relations.py").stderr  # a relation without scenes is not taken
    (tmp_path / GOLDENS / f"{name}.txt").write_text(golden)
    only = f"{name} or each_definition"
    tested = run("-m", "pytest", "-p", "no:cacheprovider", "tests/lang/test_relations.py", "-vv", "-k", only)
    assert tested.returncode == 0, tested.stdout
    assert f"[{name}: satisfied]" in tested.stdout and "test_each_definition" in tested.stdout
    done = run("docs/make_relations.py")
    assert done.returncode == 0, done.stderr
    assert f"### {name}\n" in (tmp_path / "docs" / "relations.md").read_text()
    assert (tmp_path / "docs" / "images" / "relations" / f"{name}.svg").is_file()
