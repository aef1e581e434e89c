"""One version, in scenegen/resources.py. The package's metadata comes from there; CHANGELOG.md has a section for it."""

import re

import yaml
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager

import scenegen


def releases(root):
    """The headings of CHANGELOG.md: ("0.1.0", "unreleased", a date or "")."""
    return re.findall(
        r"^## (\S+)(?: \((unreleased|\d{4}-\d\d-\d\d)\))?$", (root / "CHANGELOG.md").read_text(), re.MULTILINE
    )


def test_the_metadata_has_the_version_of_the_module(root):
    metadata = ProjectMetadata(str(root), PluginManager())
    assert "version" not in metadata.config["project"]
    assert metadata.version == scenegen.__version__


def test_the_changelog_has_a_section_for_every_release(root):
    found = releases(root)
    assert len(found) == len(re.findall(r"^## ", (root / "CHANGELOG.md").read_text(), re.MULTILINE))
    numbers = [tuple(map(int, name.split("."))) for name, _ in found]
    assert numbers == sorted(set(numbers), reverse=True)
    assert all(when != "unreleased" for _, when in found[1:])
    newest = next(name for name, when in found if when != "unreleased")
    assert newest == scenegen.__version__


def test_hooks_run_what_the_environment_has(root):
    """No network: every hook is a program of .venv, and together they are what `make lint` runs."""
    settings = yaml.safe_load((root / ".pre-commit-config.yaml").read_text())
    hooks = [hook for repo in settings["repos"] for hook in repo["hooks"]]
    assert all(repo["repo"] == "local" for repo in settings["repos"])
    assert all(hook["language"] == "system" for hook in hooks)
    programs = {hook["entry"].split()[0] for hook in hooks}
    lint = re.search(r"^lint:.*\n((?:\t.*\n)+)", (root / "Makefile").read_text(), re.MULTILINE)[1]
    assert programs == {f".venv/bin/{name}" for name in re.findall(r"\$\(BIN\)/(\S+)", lint)}
