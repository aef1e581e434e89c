"""The site: every page in its navigation, every public name in the reference, and nothing loaded from elsewhere.
docs/llms.txt is what `make llms` makes: short, and its examples check. docs/relations.md and its pictures are what
`make pictures` makes; docs/extending.md's new relation works. Every example runs, and the demo writes what it says.
"""

import importlib.util
import os
import re
import runpy
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path

import pytest
import yaml

import scenegen
from scenegen.lang.checker import check_text

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def pages():
    """docs/site_pages.py"""
    spec = importlib.util.spec_from_file_location("site_pages", ROOT / "docs" / "site_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def leaves(tree):
    """The files that a navigation names."""
    if isinstance(tree, str):
        return [tree]
    return [name for part in (tree.values() if isinstance(tree, dict) else tree) for name in leaves(part)]


def test_the_navigation_names_every_page_once(pages):
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    docs = ROOT / "docs"
    written = [str(path.relative_to(docs)) for path in docs.rglob("*.md")]
    assert sorted(leaves(settings["nav"])) == sorted([*written, *pages.PAGES.values()])
    assert settings["theme"]["font"] is False


def test_the_reference_has_every_public_name():
    named = re.findall(r"^::: scenegen\.(\w+)$", (ROOT / "docs" / "api.md").read_text(), re.MULTILINE)
    assert sorted(named) == sorted(set(scenegen.__all__) - {"__version__"})


@pytest.mark.parametrize(
    ("name", "written", "shown"),
    [
        ("index.md", "[a](docs/language.md#tools)", "[a](language.md#tools)"),
        ("index.md", "![a](docs/images/sweep.gif)", "![a](images/sweep.gif)"),
        ("index.md", "[specs](specs), [e](editors/README.md)", "[specs](specs.md), [e](editors.md)"),
        ("experiments/exp1.md", "[a](../language.md)", "[a](../language.md)"),
        ("experiments/exp1.md", "[b](../../README.md)", "[b](../index.md)"),
        ("experiments/README.md", "[code](../../experiments) of it", "code of it"),
        (
            "relations.md",
            "[p](../grammar/prelude.spec), [w](https://example.org/)",
            "[p](prelude.md), [w](https://example.org/)",
        ),
        ("language.md", "| or | `\\|` `or` |", "| or | <code>&#124;</code> `or` |"),
        ("language.md", "```spec file=a.spec\n[x](y)\n```\n", '```text title="a.spec"\n[x](y)\n```\n'),
        ("language.md", "```python\nx\n```\n", "```python\nx\n```\n"),
    ],
)
def test_links_and_fences_of_the_site(pages, name, written, shown):
    assert pages.turned(written, name) == shown


class Loaded(HTMLParser):
    """What a page loads when it is shown; links that a reader may follow are not among it."""

    SOURCES = ("src", "srcset", "data", "poster", "action", "style")

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in self.SOURCES or (name == "href" and tag in ("link", "use", "base")):
                self.found.append(value or "")


def elsewhere(text):
    return re.findall(r"(?:https?:)?//[\w.-]+", text)


def test_what_is_loaded_from_elsewhere_is_noticed():
    parser = Loaded()
    parser.feed(
        '<a href="https://a.org"><script src="https://b.org/x.js"></script><link href="//c.org/f.css"><img src="d.png">'
    )
    assert [found for one in parser.found for found in elsewhere(one)] == ["https://b.org", "//c.org"]


@pytest.mark.slow
def test_the_site_is_built_strictly_and_loads_nothing_from_elsewhere(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    made = tmp_path / "site"
    for path in made.rglob("*.html"):
        parser = Loaded()
        parser.feed(path.read_text())
        alone = path.parent.name == "pages"  # a page of `scenegen view --export` has everything in it
        assert (parser.found or alone) and not [
            one for one in parser.found if elsewhere(one) and not one.startswith("data:")
        ], path
    for path in made.rglob("*.css"):
        loaded = re.findall(r"@import[^;]+|url\((?!\W?data:)[^)]*\)", path.read_text())
        assert not [one for one in loaded if elsewhere(one)], path
    # Every relation can be found, and its picture is there; the reference says what functions take.
    found = (made / "search" / "search_index.json").read_text()
    assert "relations/#evenlyspaced" in found and "api/#scenegen.sample" in found
    assert (made / "images" / "relations" / "evenlySpaced.svg").is_file()
    assert "keep_partial" in (made / "api" / "index.html").read_text()


PAGE = ROOT / "docs" / "llms.txt"


def test_the_page_is_up_to_date():
    made = runpy.run_path(str(ROOT / "docs" / "make_llms.py"))
    assert made["page"]() == PAGE.read_text(encoding="utf-8"), "run make llms"


def test_it_fits_a_prompt_and_its_examples_check():
    text = PAGE.read_text(encoding="utf-8")
    assert len(text) < 12_500  # two or three relations more than there are
    examples = re.findall(r"^```spec\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert len(examples) == 2
    for example in examples:
        assert not check_text(example).warnings


def test_it_names_all_there_is():
    from scenegen.lang.check.scope import STEPS, prelude, signatures
    from scenegen.lang.syntax import ast

    text = PAGE.read_text(encoding="utf-8")
    names = [one.name.id for one in prelude().statements if isinstance(one, ast.Definition | ast.Constant)]
    known = [*names, *signatures(), *STEPS]
    assert [name for name in known if not re.search(rf"\b{name}\b", text)] == []


GOLDENS = Path("tests/golden/lang/relations")


@pytest.fixture(scope="module")
def made():
    """What docs/make_relations.py would write: path -> text."""
    spec = importlib.util.spec_from_file_location("make_relations", ROOT / "docs" / "make_relations.py")
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.files()


def test_the_page_and_its_pictures_are_up_to_date(made):
    pictures = set((ROOT / "docs" / "images" / "relations").iterdir())
    assert pictures | {ROOT / "docs" / "relations.md"} == set(made), "run make pictures"
    stale = [path.name for path, text in made.items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "run make pictures, and look at the pictures"


def test_pictures_are_small_and_well_formed(made):
    for path, text in made.items():
        if path.suffix == ".svg":
            assert len(text) < 12_000, path.name
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


EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.long
@pytest.mark.parametrize("example", [one for one in EXAMPLES if one.name != "00_demo.py"], ids=lambda path: path.stem)
def test_example(example, tmp_path, warm):
    done = warm.run([example], tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_demo(tmp_path, warm):
    out = tmp_path / "out"
    done = warm.run([ROOT / "examples" / "00_demo.py", "--quick", "--out", out], tmp_path)
    assert done.returncode == 0, done.stderr
    files = ("exact/contact_sheet.png", "exact/scenes.json", "model/contact_sheet.png", "model/scenes.json")
    for file in (*files, "flow.safetensors"):
        assert (out / file).is_file()
        assert str(out / file) in done.stdout.split("Open:")[1]
    # Pictures come first: they are said and drawn before torch is loaded.
    assert done.stdout.index(str(out / files[0])) < done.stdout.index("A trained model")
    assert (out / files[0]).stat().st_mtime < (out / "flow.safetensors").stat().st_mtime
