"""`scenegen fmt`: files rewritten whole or not at all, and never for nothing."""

import io
import os
import subprocess
import sys

import pytest

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
