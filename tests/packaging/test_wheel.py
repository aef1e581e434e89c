"""scenegen from a wheel in a clean environment, and from the checkout: the same specs, the same scenes."""

import json
import os
import re
import subprocess
import sys
import sysconfig
import zipfile
from email import message_from_bytes
from importlib import metadata
from pathlib import Path

import pytest
from hatchling.builders.sdist import SdistBuilder
from packaging.requirements import Requirement

FROM_RESOURCES = "from scenegen.resources import shipped_specs; print(shipped_specs()['first'])"


def build_wheel(source, folder):
    """The wheel of a checkout or of a source distribution, built offline."""
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    command += ["--disable-pip-version-check", "--wheel-dir", str(folder), str(source)]
    subprocess.run(command, check=True, timeout=120)
    (path,) = folder.glob("scenegen_dsl-*.whl")
    return path


@pytest.fixture(scope="module")
def wheel(tmp_path_factory, pytestconfig):
    return build_wheel(pytestconfig.rootpath, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def wheel_of_source(tmp_path_factory, pytestconfig):
    """The wheel of the source distribution."""
    folder = tmp_path_factory.mktemp("source")
    (source,) = SdistBuilder(str(pytestconfig.rootpath)).build(directory=str(folder), versions=["standard"])
    return build_wheel(source, folder)


def needed(requirements):
    """The distributions that requirements without extras need, and those need in turn."""
    found, todo = {}, list(requirements)
    while todo:
        requirement = Requirement(todo.pop())
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        distribution = metadata.distribution(requirement.name)
        if distribution.name not in found:
            found[distribution.name] = distribution
            todo += distribution.requires or []
    return list(found.values())


def empty_environment(wheel, folder):
    """An environment with a wheel and what it needs, and nothing else: a small install."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True, timeout=60)
    (site,) = folder.glob("lib/python*/site-packages")
    command = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(folder / "bin" / "python"),
        "install",
        "--quiet",
        "--no-deps",
    ]
    command += ["--no-index", "--no-compile", "--disable-pip-version-check", str(wheel)]
    subprocess.run(command, check=True, timeout=120)
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        requirements = message_from_bytes(archive.read(name)).get_all("Requires-Dist")
    for distribution in needed(requirements):
        for top in {file.parts[0] for file in distribution.files if ".." not in file.parts}:
            target = Path(distribution.locate_file(top))
            if target.exists() and not (site / top).exists():
                (site / top).symlink_to(target)
    return folder / "bin"


@pytest.fixture(scope="module")
def clean(wheel, tmp_path_factory):
    """A new virtual environment with the wheel alone; its dependencies are this environment's, by a .pth file."""
    folder = tmp_path_factory.mktemp("clean") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True, timeout=60)
    python = folder / "bin" / "python"
    (site,) = folder.glob("lib/python*/site-packages")
    # A path named in a .pth file is appended as it is: .pth files found there, the editable install's, are not read.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    command = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*command, "--no-compile", "--disable-pip-version-check", str(wheel)], check=True, timeout=120)
    return folder


def run(command, cwd):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120, check=True)


@pytest.mark.long
def test_what_the_wheel_holds(wheel, root):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        prelude = archive.read("scenegen/_data/grammar/prelude.spec")
    assert prelude == (root / "grammar" / "prelude.spec").read_bytes()
    for folder in ("grammar", "specs"):
        for path in (root / folder).rglob("*.*"):
            assert f"scenegen/_data/{path.relative_to(root).as_posix()}" in names
    assert {"scenegen/py.typed", "scenegen/_data/suites/tabletop/suite.json"} <= set(names)
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)
    shipped = {name.split("/")[0] for name in names}
    # experiments/ and tests/ stay in the repository
    assert shipped == {"scenegen", next(name for name in shipped if name.endswith(".dist-info"))}


@pytest.mark.long
def test_what_a_package_index_shows_leads_somewhere(wheel):
    """Neither pictures nor pages of the repository can be seen from there."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [name for name in archive.namelist() if name.endswith(".dist-info/METADATA")]
        head, _, text = archive.read(name).decode().partition("\n\n")
    assert "Description-Content-Type: text/markdown" in head
    assert text.startswith("# scenegen\n") and "## Two commands" in text
    assert "![" not in text and "<!--" not in text
    links = re.findall(r"\]\(([^)]*)\)", text)
    assert links and all(link.startswith("https://") for link in links)


@pytest.mark.long
def test_the_clean_environment_is_clean(clean, tmp_path):
    program = f"import scenegen; print(scenegen.__file__); {FROM_RESOURCES}"
    package, spec = run([clean / "bin" / "python", "-c", program], tmp_path).stdout.splitlines()
    assert package.startswith(str(clean)) and spec.startswith(str(clean))


@pytest.mark.long
def test_the_same_scenes_from_the_wheel_and_from_the_checkout(clean, tmp_path):
    outputs = []
    for program in ([clean / "bin" / "scenegen"], [sys.executable, "-m", "scenegen"]):
        checked = run([*program, "check", "first"], tmp_path).stdout
        assert checked.startswith("first: ok\n")
        scenes = run([*program, "sample", "first", "--phi", "0:0.2", "-n", "8"], tmp_path).stdout
        assert len(json.loads(scenes)["scenes"]) == 8
        outputs.append((checked, scenes))
    assert outputs[0] == outputs[1]
    assert "table_setting " in run([clean / "bin" / "scenegen", "specs"], tmp_path).stdout
    assert list(tmp_path.iterdir()) == []


SMALL = (
    "check first",
    "sample first --phi 0:0.2 -n 4 --out s.json",
    "eval first s.json",
    "range first",
    "export s.json --to mjcf --out worlds",
    "render s.json --out top --figure topview",
    "suite check tabletop",
)


@pytest.mark.long
@pytest.mark.parametrize("built", ["wheel", "wheel_of_source"])
def test_a_small_install_draws_scenes(built, request, tmp_path):
    """Without torch and PyBullet scenes are parsed, sampled, exported and drawn flat; pictures say what to install."""
    programs = empty_environment(request.getfixturevalue(built), tmp_path / "venv")
    program = (
        "from importlib.util import find_spec; print([find_spec(one) for one in ('torch', 'pybullet', 'hypothesis')])"
    )
    assert run([programs / "python", "-c", program], tmp_path).stdout == "[None, None, None]\n"
    for words in SMALL:
        run([programs / "scenegen", *words.split()], tmp_path)
    assert len(json.loads((tmp_path / "s.json").read_text())["scenes"]) == 4
    drawn = subprocess.run(
        [programs / "scenegen", "render", "s.json", "--out", "pictures"], cwd=tmp_path, capture_output=True, text=True
    )
    assert drawn.returncode == 1 and "error[not-installed]: pybullet" in drawn.stderr


def test_the_editable_install_reads_the_checkout(root, tmp_path):
    spec = run([sys.executable, "-c", FROM_RESOURCES], tmp_path).stdout.strip()
    assert spec == str(root / "specs" / "first.spec")


def test_the_source_distribution_holds_what_make_needs(root):
    builder = SdistBuilder(str(root))
    folders = {file.distribution_path.split("/")[0] for file in builder.recurse_included_files()}
    assert {"scenegen", "experiments", "tests", "docs", "grammar", "specs", "Makefile"} <= folders
    assert not {name for name in folders if name.endswith(("-out", ".json", "runs"))}
