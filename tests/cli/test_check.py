"""`scenegen check`: fast, light, and readable by editors. `scenegen fmt`: files rewritten whole or not at all, and
never for nothing.
"""

import io
import json
import os
import subprocess
import sys

import pytest


@pytest.mark.long
def test_it_loads_nothing_heavy(root):
    """How fast it is, benchmarks/language.py says; here it is held to what makes it so."""
    program = (
        "import sys; from scenegen.cli.app import run; status = run(sys.argv[1:]);"
        "sys.exit(status or ','.join(m for m in ('torch', 'pybullet', 'PIL') if m in sys.modules) or None)"
    )
    specs = [str(root / "specs" / f"{name}.spec") for name in ("first", "office_desk", "sort_3", "table_setting")]
    done = subprocess.run([sys.executable, "-c", program, "check", *specs], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", ["first", "mug_left_of_plate", "table_setting"])
def test_what_is_printed(name, scenegen, root, monkeypatch, golden):
    monkeypatch.chdir(root)
    outcome = scenegen("check", f"specs/{name}.spec")
    assert (outcome.status, outcome.err) == (0, "")
    golden(f"cli/check/{name}.txt", outcome.out)


def test_json_for_editors(scenegen, here, golden):
    (here / "bad.spec").write_text("object mug, plate\ntask: leftOf(mug, fork)\n    & nextTo(mug,\n plate)\n")
    (here / "binary.spec").write_bytes(b"\0\1\2")
    outcome = scenegen("check", "--json", "good.spec", "bad.spec", "binary.spec", "missing.spec")
    assert (outcome.status, outcome.err) == (1, "")
    reports = json.loads(outcome.out)
    text = (here / "bad.spec").read_text().splitlines()
    pointed = []
    for problem in reports[1]["diagnostics"]:
        start, end = problem["range"]["start"], problem["range"]["end"]
        assert start["line"] == end["line"]
        pointed.append(text[start["line"]][start["character"] : end["character"]])
    assert pointed == ["fork", "nextTo"]
    golden("cli/check/json.txt", outcome.out)


def test_json_has_every_syntax_error_in_utf_16_units(scenegen, here):
    (here / "bad.spec").write_text('object mug plate\ntask: f("\U0001f36d" mug)\nsafe: (leftOf(mug, plate)\n')
    outcome = scenegen("check", "--json", "bad.spec")
    assert (outcome.status, outcome.err) == (1, "")
    (report,) = json.loads(outcome.out)
    starts = [(one["range"]["start"]["line"], one["range"]["start"]["character"]) for one in report["diagnostics"]]
    assert starts == [(0, 11), (1, 13), (2, 6)] and not report["ok"]
    assert all(one["title"] == one["message"] and one["file"] == "bad.spec" for one in report["diagnostics"])


def test_json_of_a_good_spec_has_status_0(scenegen, here):
    outcome = scenegen("check", "--json", "good.spec")
    assert outcome.status == 0
    (report,) = json.loads(outcome.out)
    assert report["ok"] and report["labels"] == {"task": [-1.0, 1.0]} and report["objects"] == ["mug", "plate"]


def test_a_label_that_no_scene_satisfies_is_an_error(scenegen, here):
    (here / "hopeless.spec").write_text("task: leftOf(mug, plate) & x(mug) >= x(plate) + 2\nsafe: leftOf(mug, plate)\n")
    outcome = scenegen("check", "hopeless.spec")
    assert outcome.status == 1 and outcome.out.startswith("hopeless.spec: cannot be satisfied\n")
    assert outcome.err.startswith(
        "error[cannot-be-satisfied]: `task` can never be satisfied: phi is at most -1\n --> hopeless.spec:1:28\n"
    )
    assert "bounds prove it" in outcome.err and "--allow-unsatisfiable" in outcome.err and "`safe`" not in outcome.err
    (report,) = json.loads(scenegen("check", "hopeless.spec", "--json").out)
    assert report["ok"] is False and report["diagnostics"][0]["severity"] == "error"
    assert report["labels"]["task"] == [-3.0, -1.0], "the data is there all the same"


def test_unless_it_is_meant_so(scenegen, here):
    (here / "hopeless.spec").write_text("task: leftOf(mug, plate) & x(mug) >= x(plate) + 2\n")
    outcome = scenegen("check", "hopeless.spec", "--allow-unsatisfiable")
    assert outcome.status == 0 and outcome.out.startswith("hopeless.spec: ok\n")
    assert outcome.err.startswith("warning[cannot-be-satisfied]: `task` can never be satisfied")
    (report,) = json.loads(scenegen("check", "hopeless.spec", "--json", "--allow-unsatisfiable").out)
    assert report["ok"] is True and report["diagnostics"][0]["severity"] == "warning"


def test_what_is_not_proved_is_a_warning(scenegen, here):
    """Seven circles round one, just too large to fit: a search finds no scene, and bounds prove nothing in so little
    time."""
    text = "object ring[7] = cylinder(0.05, 0.1), hub = cylinder(0.05, 0.1)\nrequire noOverlap()\n"
    (here / "tight.spec").write_text(text + "task: forall p in ring: gap(p, hub) <= 1 mm\n")
    outcome = scenegen("check", "tight.spec")
    assert outcome.status == 0 and "can hardly be satisfied" in outcome.err and "error" not in outcome.err


def test_what_clashes_is_named_with_its_lines(scenegen, here):
    text = (
        "object mug, plate\ntask: closeTo(mug, plate, 5 cm)\n    & angle(mug, NORTH)\n    & x(mug) >= x(plate) + 0.1\n"
    )
    (here / "hopeless.spec").write_text(text)
    outcome = scenegen("check", "hopeless.spec")
    assert "hopeless.spec:2:7" in outcome.err and "hopeless.spec:4:7" in outcome.err and "angle" not in outcome.err


def test_a_requirement_that_no_scene_meets_is_told_once(scenegen, here):
    text = "object a = box(0.9, 0.9, 0.1), b = box(0.9, 0.9, 0.1)\nrequire insideWorkspace()\nrequire noOverlap()\n"
    (here / "hopeless.spec").write_text(text + "task: leftOf(a, b)\nother: leftOf(b, a)\n")
    outcome = scenegen("check", "hopeless.spec")
    assert outcome.status == 1 and outcome.err.startswith(
        "error[requirement-cannot-be-met]: what the spec requires can never be met\n"
    )
    assert outcome.err.count("error[") == 1 and "warning[" not in outcome.err


def test_it_says_where_the_search_ended(scenegen, here, monkeypatch):
    (here / "hopeless.spec").write_text("task: closeTo(mug, plate, 5 cm) & x(mug) >= x(plate) + 0.1\n")
    assert scenegen("check", "hopeless.spec").status == 1
    monkeypatch.setattr("scenegen.cli.check.LOOK_SECONDS", -1e9)
    outcome = scenegen("check", "hopeless.spec")
    assert outcome.status == 0 and outcome.err.startswith("note[not-looked-at]: ")
    assert "rough: a quick look found no scene with phi >= 0" in outcome.out


BLOCKS = "object block[30]\nrequire noOverlap() & insideWorkspace()\ntask: closeTo(block[1], block[2], 0.3)\n"
WIDE = "task: " + " & ".join(f"x(o{n}) <= y(p{n}) + 1" for n in range(100)) + "\n"
DEEP = "task: " + "".join(f"(x(a) <= 0.{n} | " for n in range(1, 60)) + "x(b) <= 1" + ")" * 59 + "\n"
MANY = "object a, b\n" + "".join(f"l{n}: leftOf(a, b) | x(a) >= 0.{n}\n" for n in range(1, 100))
LARGE = {"blocks": BLOCKS, "wide": WIDE, "deep": DEEP, "many": MANY}


@pytest.mark.long
@pytest.mark.parametrize("name", LARGE)
def test_a_page_at_most(scenegen, here, name):
    (here / "large.spec").write_text(LARGE[name])
    outcome = scenegen("check", "large.spec")
    lines = outcome.out.splitlines()
    assert outcome.status == 0 and len(lines) <= 42 and max(map(len, lines)) <= 120
    assert ("Only a page of it" in outcome.out) == (name != "blocks")
    assert len(scenegen("check", "large.spec", "--full").out.splitlines()) > 100


def test_what_repeats_is_folded(scenegen, here, golden):
    (here / "blocks.spec").write_text(BLOCKS)
    golden("cli/check/blocks.txt", scenegen("check", "blocks.spec").out)


def test_depth(scenegen, here):
    (here / "deep.spec").write_text(DEEP)
    for depth in (0, 3):
        lines = scenegen("check", "deep.spec", "--depth", str(depth)).out.splitlines()
        formulas = lines[lines.index(next(line for line in lines if line.startswith("  task:"))) + 1 :]
        assert max((len(line) - len(line.lstrip()) - 4) // 2 for line in formulas) == depth
    assert scenegen("check", "deep.spec", "--depth", "-1").status == 1
    assert len(scenegen("check", "deep.spec", "--depth", "58").out.splitlines()) > 100


def test_bounds_that_say_too_little_are_said_to_be_rough(scenegen, here):
    """40 boxes are too many for a search in half a second: nothing is claimed."""
    (here / "blocks.spec").write_text(BLOCKS.replace("block[30]", "block[40]"))
    outcome = scenegen("check", "blocks.spec")
    assert (outcome.status, outcome.err) == (0, "")
    assert "; rough: a quick look found no scene that meets it" in outcome.out


def test_shapes_and_sizes_of_all_objects(scenegen, here):
    """In words, and as data: a misspelt name shows as the block that stands in."""
    text = 'object plat, tray, can[3], vase = mesh("vase.obj", box(10 cm, 8 cm, 20 cm))\ntask: leftOf(plat, tray)\n'
    (here / "sizes.spec").write_text(text)
    outcome = scenegen("check", "sizes.spec")
    for line in (
        "sizes      plat: block, 0.05 x 0.05 x 0.05 m",
        "tray: tray, 0.4 x 0.3 x 0.045 m",
        "can[1..3]: can, radius 0.033, height 0.115 m",
        "vase: mesh vase.obj, 0.1 x 0.08 x 0.2 m",
    ):
        assert line in outcome.out
    (report,) = json.loads(scenegen("check", "sizes.spec", "--json").out)
    assert list(report["shapes"]) == report["objects"]
    box = {"footprint": "box", "length": 0.05, "width": 0.05, "height": 0.05}
    assert report["shapes"]["plat"] == {"asset": "block", **box}
    assert [one["code"] for one in report["diagnostics"]] == ["stands-in"] and report["ok"]


@pytest.mark.parametrize(
    ("text", "proved"),
    {
        "object plate[24]\nrequire noOverlap() & insideWorkspace()\ntask: leftOf(plate[1], plate[2])": True,
        "object plate[36]\nrequire noOverlap()\ntask: leftOf(plate[1], plate[2])": True,
        "object plate[24]\ntask: noOverlap() & insideWorkspace()": True,
        "object tray, plate[12] on tray\nrequire noCollision()\ntask: leftOf(plate[1], plate[2])": True,
        "object tray, mug[12] on tray\nrequire noCollision()\ntask: leftOf(mug[1], mug[2])": True,
        "object shelfunit, book[40] on shelfunit.shelf[1]\nrequire noCollision()\ntask: leftOf(book[1], book[2])": True,
        "object tray, mug[12] on tray\nrequire insideWorkspace()\ntask: noCollision(mug)": True,
        "object plate[40]\ntask: leftOf(plate[1], plate[2])": False,  # they may overlap
        "object tray, mug[12] on tray\ntask: leftOf(mug[1], mug[2])": False,
        "object tray, mug[9] on any of [tray, workspace]\nrequire noCollision()\ntask: leftOf(mug[1], mug[2])": False,
        "object plate[40]\ntask: noOverlap() | leftOf(plate[1], plate[2])": False,
        "object plate[12]\nrequire noOverlap() & insideWorkspace()\ntask: leftOf(plate[1], plate[2])": False,
        f"object plate[8] on [workspace, {', '.join(f'plate[{k}]' for k in range(1, 8))}], tray\n"
        "require noCollision()\ntask: leftOf(plate[1], tray)": False,  # a stack takes no more room than one
        "object carton[2], mug[6] on any of [carton[1], carton[2], workspace]\n"
        "require noCollision()\ntask: leftOf(mug[1], mug[2])": False,
    }.items(),
)
def test_a_table_that_cannot_hold_what_is_on_it(scenegen, here, text, proved):
    (here / "full.spec").write_text(text)
    outcome = scenegen("check", "full.spec")
    assert ("error[table-too-full]" in outcome.err) == proved and outcome.status == int(proved)
    assert ("no more than" in outcome.err or "cm2" in outcome.err) == proved


@pytest.mark.parametrize(
    ("text", "advice"),
    {
        "task: farFrom(fork, mug, 25)": "write 25 cm, or 25 m",
        "require farFrom(fork, mug, 250)\ntask: leftOf(fork, mug)": "write 250 mm, or 250 m",
        "object a = box(10, 6, 4), b\ntask: leftOf(a, b)": "write box(10 cm, 6 cm, 4 cm), or 10 m",
        "object a = box(0.1, 0.06, 40), b\ntask: leftOf(a, b)": "write box(0.1, 0.06, 40 cm), or 40 m",
        "workspace [0, 90] x [0, 60]\ntask: leftOf(a, b)": "write workspace [0, 90 cm] x [0, 60 cm], or 90 m",
        "region r = rect(10, 10, 40, 40)\ntask: leftOf(a, b) | inside(a, r)": "rect(10 cm, 10 cm, 40 cm, 40 cm)",
        "workspace [0 m, 90 m] x [0 m, 60 m]\ntask: leftOf(a, b)": "",
        "object a = box(3 m, 2 m, 1), b\ntask: leftOf(a, b)": "",
        "workspace [0, 9] x [0, 6]\nobject a = box(3, 2, 1), b\ntask: leftOf(a, b)": "",
    }.items(),
)
def test_bare_numbers_that_are_hardly_metres(scenegen, here, text, advice):
    (here / "bare.spec").write_text(text)
    err = scenegen("check", "bare.spec").err
    assert advice in err if advice else "a bare number is in metres" not in err


@pytest.mark.parametrize(
    ("text", "title", "advice"),
    [
        ("closeTo(mug, plate, 20)", "every scene satisfies `task`: phi is at least 18.59", "write 20 cm, or 20 m"),
        ("closeTo(mug, plate, 250)", "every scene satisfies `task`: phi is at least 248.6", "write 250 mm, or 250 m"),
        ("workspace [0, 5] x [0, 5]\ntask: closeTo(mug, plate, 250)", "every scene satisfies `task`", "write 250 cm"),
        (
            "closeTo(mug, plate, 20) & leftOf(mug, plate)",
            "`closeTo(mug, plate, 20)` holds in every scene: its margin is at least 18.59",
            "write 20 cm",
        ),
        ("leftOf(a, b) | farFrom(a, b, 20)", "`farFrom(a, b, 20)` holds in no scene", "write 20 cm"),
        ("angle(knife, NORTH, 5) & leftOf(knife, b)", "`angle(knife, NORTH, 5)` holds in every scene", "write 5 deg"),
        (
            "object a, b\nrequire closeTo(a, b, 20 m)\ntask: leftOf(a, b)",
            "`closeTo(a, b, 20 m)` holds in every",
            "leave",
        ),
        ("const NEAR = 20\ntask: closeTo(a, b, NEAR) & leftOf(a, b)", "`closeTo(a, b, NEAR)` holds in every", "leave"),
        ("object a[2..4], b\ntask: forall p in a: closeTo(p, b, 20)", "every scene satisfies `task`", "write 20 cm"),
        ("dist(a, b) >= 0", "every scene satisfies `task`: phi is at least 0", "make it stricter"),
    ],
)
def test_what_every_scene_satisfies(scenegen, here, text, title, advice):
    (here / "idle.spec").write_text(text)
    outcome = scenegen("check", "idle.spec")
    assert outcome.status == 0 and f"warning[always-satisfied]: {title}" in outcome.err and advice in outcome.err


@pytest.mark.parametrize(
    "text",
    [
        "0 <= x(a) <= 0.5 & leftOf(a, b)",
        "object a[3], b\ntask: forall i in 1..3: x(a[i]) <= i * 0.4",
        "object a at (0.2, 0.2), b at (0.8, 0.2), c\ntask: leftOf(c, b) & closeTo(a, b, 1 m)",
        "object block[2]\nrequire noOverlap() & insideWorkspace()\ntask: closeTo(block[1], block[2], 0.3)",
    ],
)
def test_numbers_that_decide_something_are_let_pass(scenegen, here, text):
    (here / "busy.spec").write_text(text)
    outcome = scenegen("check", "busy.spec")
    assert (outcome.status, outcome.err) == (0, "")


def test_choices_are_told_in_words(scenegen, here):
    text = (
        "object coaster = cylinder(5.5 cm, 0.5 cm), mug on any of [coaster, workspace]\ntask: restsOn(mug, coaster)\n"
    )
    (here / "choice.spec").write_text(text)
    out = scenegen("check", "choice.spec", "--full").out
    assert "mug stands on coaster.top" in out and "mug stands on workspace" in out and "mug.on" not in out


def test_robots_cameras_and_choices_are_told(scenegen, here):
    text = """robot arm = so101 at (0.5, 0.1, NORTH)
camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 16:9
camera side = at (0.5, 0.5, 0.5) looks at (0.5, 0.5, 0) fov 53.130102354 deg, 1:1
region mat = rect(0.1, 0.5, 0.9, 0.9)
object cup[2] on any of [mat: 7, workspace: 3], mug
task: reachable(cup[1], arm)
"""
    (here / "told.spec").write_text(text)
    told = scenegen("check", "told.spec")
    assert told.err == ""
    for line in (
        "surfaces   cup[1], cup[2] on mat 70 % or workspace 30 %",
        "robots     arm: so101 reaches 0.0443 to 0.284 m, -109 to 109 deg at the table, opens 0.07 m",
        "cameras    front at (0.5, -0.6, 0.7), 60 deg, 16:9, pictures 100 % of the workspace",
        "side at (0.5, 0.5, 0.5), 53.1 deg, 1:1, pictures 25 % of the workspace",
    ):
        assert line in told.out


UGLY = "# Title\n\n\nobject mug,plate # two\ntask:leftOf( mug,plate )and(aboveOf(mug, plate))\n   # hanging\n"
PRETTY = "# Title\n\nobject mug, plate  # two\ntask: leftOf(mug, plate) & aboveOf(mug, plate)\n    # hanging\n"
BAD = "task: leftOf(mug plate)\nsafe: leftOf(mug,\n"


@pytest.fixture
def ugly(here):
    path = here / "ugly.spec"
    path.write_text(UGLY)
    os.utime(path, (1000, 1000))
    return path


def test_a_file_is_rewritten(scenegen, ugly):
    ugly.chmod(0o640)
    outcome = scenegen("fmt", "ugly.spec")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "reformatted ugly.spec\n")
    assert ugly.read_text() == PRETTY
    assert ugly.stat().st_mode & 0o777 == 0o640
    assert scenegen("fmt", "ugly.spec").err == ""


def test_a_file_in_canonical_form_is_not_touched(scenegen, here):
    path = here / "good.spec"
    os.utime(path, (1000, 1000))
    inode = path.stat().st_ino
    outcome = scenegen("fmt", "good.spec", "two.spec")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")
    assert (path.stat().st_mtime, path.stat().st_ino) == (1000, inode)


def test_check_writes_nothing_and_names_the_files(scenegen, ugly, here, snapshot):
    before = snapshot(here)
    outcome = scenegen("fmt", "--check", "good.spec", "ugly.spec")
    assert (outcome.status, outcome.out, outcome.err) == (1, "", "would reformat ugly.spec\n")
    assert snapshot(here) == before and ugly.stat().st_mtime == 1000
    assert scenegen("fmt", "--check", "good.spec", "two.spec").status == 0


@pytest.mark.parametrize("text", [UGLY, UGLY.rstrip("\n"), UGLY.replace("\n", "\r\n"), "﻿" + UGLY, "leftOf(mug,plate)"])
@pytest.mark.parametrize("check", [False, True])
def test_diff_writes_nothing_and_is_a_patch(text, check, scenegen, ugly, here, snapshot):
    ugly.write_bytes(text.encode())
    before = snapshot(here)
    outcome = scenegen("fmt", "--diff", *["--check"] * check, "good.spec", "ugly.spec")
    assert outcome.status == check
    assert outcome.err == "would reformat ugly.spec\n" * check
    assert snapshot(here) == before
    patch = subprocess.run(["git", "apply", "-p0", "-"], input=outcome.out.encode(), capture_output=True, cwd=here)
    assert patch.returncode == 0, patch.stderr
    patched = ugly.read_bytes()
    ugly.write_bytes(text.encode())
    scenegen("fmt", "ugly.spec")
    assert patched == ugly.read_bytes()


def test_a_broken_file_is_left_alone_and_the_others_are_formatted(scenegen, ugly, here):
    (here / "bad.spec").write_text(BAD)
    (here / "binary.spec").write_bytes(b"\0\1")
    outcome = scenegen("fmt", "bad.spec", "binary.spec", "missing.spec", "ugly.spec")
    assert (outcome.status, outcome.out) == (1, "")
    assert outcome.err.count("error[") == 4 and outcome.err.endswith("reformatted ugly.spec\n")
    assert "Traceback" not in outcome.err
    assert (here / "bad.spec").read_text() == BAD and ugly.read_text() == PRETTY
    assert not (here / "missing.spec").exists()


def test_meaning_is_not_checked(scenegen, here):
    """A spec that does not mean anything yet can be formatted all the same."""
    (here / "unknown.spec").write_text("task:nextTo(mug ,  1 rad+1 m)")
    assert scenegen("fmt", "unknown.spec").status == 0
    assert (here / "unknown.spec").read_text() == "task: nextTo(mug, 1 rad + 1 m)\n"


def test_a_link_stays_a_link(scenegen, ugly, here):
    (here / "link.spec").symlink_to(ugly)
    assert scenegen("fmt", "link.spec").status == 0
    assert (here / "link.spec").is_symlink() and ugly.read_text() == PRETTY


def test_a_folder_without_permission(scenegen, ugly, here, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse)
    outcome = scenegen("fmt", "ugly.spec")
    assert outcome.status == 1 and outcome.err.startswith(
        "error[cannot-write]: cannot write ugly.spec: permission denied"
    )
    assert ugly.read_text() == UGLY


@pytest.mark.parametrize(
    ("options", "text", "status", "out", "err"),
    [
        ([], UGLY, 0, PRETTY, ""),
        ([], PRETTY, 0, PRETTY, ""),
        (["--check"], UGLY, 1, "", "would reformat <stdin>\n"),
        (["--check"], PRETTY, 0, "", ""),
        (["--diff"], PRETTY, 0, "", ""),
    ],
)
def test_standard_input(options, text, status, out, err, scenegen, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    outcome = scenegen("fmt", *options, "-")
    assert (outcome.status, outcome.out, outcome.err) == (status, out, err)


@pytest.mark.long
def test_standard_input_of_a_process():
    def run(text):
        command = [sys.executable, "-m", "scenegen", "fmt", "-"]
        return subprocess.run(command, input=text.encode(), capture_output=True, timeout=60)

    done = run(UGLY)
    assert (done.returncode, done.stdout.decode(), done.stderr) == (0, PRETTY, b"")
    done = run(BAD)
    assert (done.returncode, done.stdout) == (1, b"")
    assert done.stderr.decode().count("error[") == 2 and " --> <stdin>:1:18\n" in done.stderr.decode()


def test_the_shipped_specs_need_no_formatting(scenegen, root):
    specs = [*sorted((root / "specs").glob("*.spec")), root / "grammar" / "prelude.spec"]
    outcome = scenegen("fmt", "--check", *map(str, specs))
    assert (outcome.status, outcome.err) == (0, "")


def test_where_things_usually_are_is_printed_a_line_each(scenegen, here):
    text = "object mug, plate\n{}task: leftOf(mug, plate)\n"
    said = "usually mug ~ normal((0.4, 0.3), 5 cm)\nusually theta(mug), theta(plate) ~ uniform(80 deg, 100 deg)\n"
    (here / "usual.spec").write_text(text.format(said))
    lines = ["mug ~ normal((0.4, 0.3), 5 cm)", "theta(mug), theta(plate) ~ uniform(80 deg, 100 deg)"]
    outcome = scenegen("check", "usual.spec")
    assert f"  usually    {lines[0]}\n             {lines[1]}\n" in outcome.out and outcome.status == 0
    (report,) = json.loads(scenegen("check", "--json", "usual.spec").out)
    assert report["usually"] == lines
    (here / "plain.spec").write_text(text.format(""))
    assert "usually" not in json.loads(scenegen("check", "--json", "plain.spec").out)[0]
