"""`import` and the files of shapes: what comes along, and everything that must not be read."""

import os
import time

import pytest

from scenegen.errors import SpecError
from scenegen.lang.check import imports
from scenegen.lang.checker import check_file, check_text

TASK = "task: leftOf(mug, plate)\n"


class Files:
    """A project's folder, `p`, inside a folder that is none of its business."""

    def __init__(self, folder):
        self.outside = folder
        self.root = folder / "p"
        self.root.mkdir()

    def write(self, **texts):
        for name, text in texts.items():
            (self.root / f"{name}.spec").write_text(text)

    def check(self, text, root=None):
        path = self.root / "main.spec"
        path.write_text(text)
        return check_file(path, path.read_bytes(), root)

    def refused(self, text, root=None):
        """The one problem of a text: its title and the place, relative to the project's folder."""
        with pytest.raises(SpecError) as error:
            self.check(text, root)
        (problem,) = error.value.diagnostics
        assert problem.span is not None
        return problem.title.replace(f"{self.root}/", ""), problem.span.place.replace(f"{self.root}/", "")


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path.resolve())


def test_statements_stand_where_the_import_stood(files):
    files.write(
        table='workspace [0, 2] x [0, 1]\nobject mug, plate\nimport "more.spec"',
        more="const E = 1\nsafe: closeTo(mug, plate, E)",
    )
    spec = files.check('import "table.spec"\nobject fork\n' + TASK)
    assert spec.objects == ("mug", "plate", "fork") and spec.labels == ("safe", "task") and spec.workspace.width == 2.0
    inlined = (
        "workspace [0, 2] x [0, 1]\nobject mug, plate\nconst E = 1\nsafe: closeTo(mug, plate, E)\nobject fork\n" + TASK
    )
    assert spec.source == check_text(inlined).source
    again = check_text(spec.source)
    assert again.sha256 == spec.sha256 and again.objects == spec.objects and again.core.nodes


def test_what_two_files_import_is_taken_once(files):
    files.write(a='import "c.spec"\nconst A = C', b='import "c.spec"\nconst B = C', c="const C = 1")
    spec = files.check('import "a.spec"\nimport "b.spec"\nimport "./a.spec"\nimport "sub/../c.spec"\n' + TASK)
    assert spec.source == "const C = 1\nconst A = C\nconst B = C\n" + TASK
    assert files.refused('import "a.spec"\nconst C = 2\n' + TASK)[0] == "`C` is defined twice"


def test_a_definition_means_what_its_own_file_says(files):
    files.write(lib="def near(a, b, e = SLACK) = closeTo(a, b, e)\nconst SLACK = 30 cm")
    one = files.check('import "lib.spec"\ntask: near(mug, plate)')
    assert one.core.nodes == files.check('import "lib.spec"\ntask: near(mug, plate)').core.nodes
    assert "0.3" in str(
        [getattr(node, "text", "") for node in one.core.nodes] + [getattr(node, "value", "") for node in one.core.nodes]
    )
    assert files.refused('import "lib.spec"\nconst SLACK = 1\ntask: near(mug, plate)')[0] == "`SLACK` is defined twice"


def test_mistakes_are_told_where_they_stand(files):
    files.write(lib="const A = 1\nconst B = Q\n")
    assert files.refused('import "lib.spec"\n' + TASK) == ("unknown constant `Q`", "lib.spec:2:11")
    files.write(lib="const A = \nconst B = 1\n")
    assert files.refused('import "lib.spec"\n' + TASK)[1] == "lib.spec:2:1"
    (files.root / "lib.spec").write_bytes(b"\x7fELF\0\0")
    assert files.refused('import "lib.spec"\n' + TASK) == ("lib.spec is a binary file", "main.spec:1:8")
    files.write(lib="leftOf(a, b)")
    assert files.refused('import "lib.spec"\n' + TASK) == ("lib.spec has no statements to import", "main.spec:1:8")


OUTSIDE = "a spec cannot read outside its folder"
WAYS_OUT = [
    "../secret.spec",
    "sub/../../secret.spec",
    "/etc/passwd",
    "/dev/zero",
    "/dev/stdin",
    "/proc/self/mem",
    "link.spec",
    "folder/secret.spec",
]


@pytest.mark.parametrize("path", WAYS_OUT)
@pytest.mark.parametrize("statement", ['import "{}"\n', 'object tray = urdf("{}")\nobject mug, plate\n'])
def test_nothing_outside_the_folder_is_read(files, path, statement):
    (files.outside / "secret.spec").write_text("const A = 1")
    (files.root / "link.spec").symlink_to(files.outside / "secret.spec")
    (files.root / "folder").symlink_to(files.outside)
    assert files.refused(statement.format(path) + TASK)[0] == OUTSIDE


def test_another_root_widens_or_narrows(files):
    (files.outside / "secret.spec").write_text("const A = 1")
    files.write(a="const A = 1")
    assert files.check('import "../secret.spec"\n' + TASK, files.outside).source.startswith("const A = 1")
    assert files.refused('import "a.spec"\n' + TASK, files.root / "sub")[0] == OUTSIDE


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/stdin", "/dev/null", "zero.spec"])
def test_devices_are_not_read_wherever_the_root_is(files, path):
    (files.root / "zero.spec").symlink_to("/dev/zero")
    assert files.refused(f'import "{path}"\n{TASK}', files.root.__class__("/"))[0] == f"{path} is not a file"


def test_pipes_folders_and_what_is_not_there(files):
    os.mkfifo(files.root / "pipe.spec")
    (files.root / "sub.spec").mkdir()
    (files.root / "around.spec").symlink_to(files.root / "round.spec")
    (files.root / "round.spec").symlink_to(files.root / "around.spec")
    for path, said in {
        "pipe.spec": "pipe.spec is not a file",
        "sub.spec": "sub.spec is not a file",
        ".": ". is not a file",
        "": " is not a file",
        "around.spec": "cannot find around.spec",
        "gone.spec": "cannot read gone.spec: no such file or directory",
        "main.spec/a.spec": "cannot read main.spec/a.spec: not a directory",
        "a" * 5000: f"cannot read {'a' * 5000}: file name too long",
        "a/" * 3000: f"cannot read {'a/' * 3000}: file name too long",
        "~/a.spec": "cannot read ~/a.spec: no such file or directory",
    }.items():
        assert files.refused(f'import "{path}"\n{TASK}')[0] == said


def test_files_of_the_same_ending_are_named(files):
    (files.root / "mine.toml").write_text("")
    for wanted, beside in (('import "gone.spec"', "main.spec"), ('robot a = arm("gone.toml")', "mine.toml")):
        with pytest.raises(SpecError) as error:
            files.check(f"{wanted}\n{TASK}")
        assert error.value.diagnostics[0].help == f"beside it are {beside}"


def test_circles_are_refused_however_they_are_written(files):
    files.write(a='import "b.spec"', b='import "./a.spec"', c='import "main.spec"')
    assert files.refused('import "main.spec"\n' + TASK) == ("main.spec imports itself", "main.spec:1:8")
    assert files.refused('import "../p/main.spec"\n' + TASK)[0] == "../p/main.spec imports itself"
    assert files.refused('import "a.spec"\n' + TASK) == ("./a.spec imports itself", "b.spec:1:8")
    assert files.refused('import "c.spec"\n' + TASK) == ("main.spec imports itself", "c.spec:1:8")


def test_a_spec_that_is_a_link_reads_beside_its_file(files):
    home = files.outside / "home"
    home.mkdir()
    (home / "real.spec").write_text('import "a.spec"\n' + TASK)
    (home / "a.spec").write_text("const A = 1")
    link = files.root / "main.spec"
    link.symlink_to(home / "real.spec")
    assert check_file(link, link.read_bytes()).source.startswith("const A = 1")


def test_long_chains_many_files_and_large_ones(files, monkeypatch):
    monkeypatch.setattr(imports, "MAX_IMPORTED_FILES", 50)
    for number in range(60):
        files.write(**{f"c{number}": f'import "c{number + 1}.spec"', f"f{number}": f"const F{number} = 1"})
    files.write(c60="const Z = 1", c51="const Z = 1")
    assert files.refused('import "c0.spec"\n' + TASK) == ("more than 50 files are imported", "c49.spec:1:8")
    assert files.check('import "c2.spec"\n' + TASK).source == "const Z = 1\n" + TASK
    many = "".join(f'import "f{number}.spec"\n' for number in range(60))
    assert files.refused(many + TASK) == ("more than 50 files are imported", "main.spec:51:8")
    with (files.root / "huge.spec").open("wb") as file:
        file.truncate(10**12)  # a hole: no disk holds it
    assert files.refused('import "huge.spec"\n' + TASK)[0] == "huge.spec is too large"
    monkeypatch.setattr(imports, "MAX_CHARACTERS", 100)
    files.write(a="const A = 1" + " " * 60, b="const B = 1")
    assert files.refused('import "a.spec"\nimport "b.spec"\n' + TASK)[0].startswith(
        "this spec is too long with its imports"
    )


def test_names_alike_but_for_case_are_other_files(files):
    """On a disk that does not tell case apart they are one file, and what it defines is defined twice."""
    files.write(a="const A = 1", A="const B = 1")
    try:
        assert "const A" in files.check('import "a.spec"\nimport "A.spec"\n' + TASK).source
    except SpecError as refused:
        assert "is defined twice" in str(refused)


def test_a_text_without_a_file_imports_nothing():
    for text in ('import "a.spec"\n' + TASK, 'object tray = urdf("a.urdf")\nobject mug, plate\n' + TASK):
        with pytest.raises(SpecError, match="a spec without a file cannot read files"):
            check_text(text)


def test_the_outline_of_a_file_is_written_out(files):
    """So that the canonical text needs no other file; where it is written out, the file is not read."""
    text = 'object tray[2] = urdf("/nowhere/tray.urdf", prism([(0, 0), (0.1, 0), (0, 0.1)], 2 cm)), mug\n'
    text += "task: leftOf(tray[1], mug)"
    spec = check_text(text)
    assert 'urdf("/nowhere/tray.urdf", prism([(0.0, 0.0), (0.1, 0.0), (0.0, 0.1)], 0.02))' in spec.source
    again = check_text(spec.source)
    assert again.source == spec.source and again.shapes == spec.shapes and again.sha256 == spec.sha256
    round_ = check_text('object tray = urdf("t.urdf", cylinder(1 / 3, 0.1)), mug\ntask: gap(tray, mug) >= 0')
    assert check_text(round_.source).shapes == round_.shapes, "sizes survive to the last bit"


SHAPE = '<robot name="r"><link name="l"><collision><geometry>{}</geometry></collision></link></robot>'
ENTITIES = "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(9))
HOSTILE = {
    "entities that multiply": f'<!DOCTYPE r [<!ENTITY e0 "lol">{ENTITIES}]>{SHAPE.format("&e9;")}',
    "an entity that reads a file": f'<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/passwd">]>{SHAPE.format("&e;")}',
    "elements inside each other": "<robot>" + "<a>" * 100_000 + "</a>" * 100_000 + "</robot>",
    "a size that is none": SHAPE.format('<box size="nan inf -1"/>'),
    "a mesh outside the folder": SHAPE.format('<mesh filename="../secret.stl"/>'),
    "a mesh of another package": SHAPE.format('<mesh filename="package://../../../etc/passwd"/>'),
    "a mesh that is a device": SHAPE.format('<mesh filename="/dev/zero"/>'),
    "a mesh that is itself": SHAPE.format('<mesh filename="tray.urdf"/>'),
    "nothing": "",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_urdf_files(files, name):
    (files.root / "tray.urdf").write_text(HOSTILE[name])
    (files.outside / "secret.stl").write_bytes(b"solid")
    began = time.process_time()
    title, place = files.refused('object tray = urdf("tray.urdf"), mug\ntask: leftOf(mug, tray)')
    assert place == "main.spec:1:20" and title
    assert time.process_time() - began < 20.0


@pytest.mark.parametrize("written", ["sub\\\\near.spec", "sub\\near.spec", "sub/near.spec"])
def test_folders_separated_as_on_windows(written, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "near.spec").write_text("def near(a, b) = closeTo(a, b, 20 cm)\n")
    text = f'import "{written}"\nobject a, b\ntask: near(a, b)\n'
    assert check_file(tmp_path / "main.spec", text.encode()).labels == ("task",)
