"""`scenegen explain`: complete, and true, for their examples are run."""

import ast
import importlib
import re
import shlex
from pathlib import Path

import numpy
import pytest

import scenegen
from scenegen import curriculum
from scenegen.api.feasibility import doubts, idle
from scenegen.errors import Kind, ScenegenError
from scenegen.errors.catalog import GROUPS, catalog
from scenegen.errors.diagnostic import fields
from scenegen.play.strategies import strategy

CATALOG = catalog()
PACKAGE = Path(scenegen.__file__).parent
TRIED = [code for code, entry in CATALOG.items() if not entry.untried]
TABLE = "object mug, plate\ntask: leftOf(mug, plate)\n"
TWO = "object mug, plate\ntask: leftOf(mug, plate)\nsafe: !closeTo(mug, plate, 25 cm)\n"


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A folder with what the examples use: table.spec, two.spec and scenes.json."""
    folder = tmp_path_factory.mktemp("examples")
    (folder / "table.spec").write_text(TABLE)
    (folder / "two.spec").write_text(TWO)
    spec = scenegen.load(folder / "table.spec")
    scenegen.sample(spec, (0.0, None), n=3).save(folder / "scenes.json")
    return folder


def codes_of_spec(text):
    """The codes that `scenegen check` shows for a text, without the program."""
    path = Path("example.spec")
    path.write_text(text)
    try:
        spec = scenegen.load(path)
    except ScenegenError as error:
        return [one.code for one in error.diagnostics]
    found = [one.problem for one in doubts(spec.declared) if one.problem is not None] if spec.horizon is None else []
    return [one.code for one in (*spec.warnings, *found, *idle(spec.declared))]


def codes_of_shell(lines, run, capfd):
    """The codes that the last line of a shell session shows."""
    codes = []
    for line in lines:
        words = shlex.split(line.removeprefix("$ "))
        if words[0] == "mkdir":
            Path(words[1]).mkdir(exist_ok=True)
        elif words[0] == "printf":
            said = re.sub(r"\\([0-7]{3}|.)", unescaped, words[1])
            Path(words[3]).write_bytes(said.encode("latin-1") if "\\" in words[1] else said.encode())
        else:
            assert words[0] == "scenegen", line
            capfd.readouterr()
            run(words[1:])
            codes = re.findall(r"^(?:error|warning|note)\[([a-z0-9-]+)\]", capfd.readouterr().err, re.MULTILINE)
    return codes


def unescaped(found):
    return {"n": "\n", "0": "\0"}.get(found[1]) or (chr(int(found[1], 8)) if found[1].isdigit() else found[1])


def codes_of_python(lines):
    """The codes of the errors and warnings of lines of Python."""
    values = {
        "scenegen": scenegen,
        "spec": scenegen.load("table.spec"),
        "two": scenegen.load("two.spec"),
        "np": numpy,
        "curriculum": curriculum,
        "strategy": strategy,
    }
    try:
        for line in lines:
            exec(line.removeprefix(">>> "), values)  # noqa: S102 - our own
    except ScenegenError as error:
        return [one.code for one in error.diagnostics]
    except Exception as error:  # of gymnasium
        return [error.diagnostic.code]
    return [one.code for one in getattr(values.get("found"), "warnings", ())]


@pytest.fixture
def codes(table, monkeypatch, capfd):
    """The codes that an example triggers."""
    from scenegen.cli.app import run

    monkeypatch.chdir(table)

    def found(example):
        lines = example.splitlines()
        if lines[0].startswith("$ "):
            return codes_of_shell(lines, run, capfd)
        return codes_of_python(lines) if lines[0].startswith(">>> ") else codes_of_spec(example)

    return found


@pytest.mark.long
@pytest.mark.parametrize("code", TRIED)
def test_an_example_triggers_its_code_and_mended_it_does_not(code, codes):
    entry = CATALOG[code]
    assert codes(entry.example) == [code]
    assert codes(entry.mended) == []


def test_every_kind_is_explained_and_nothing_else():
    for group in GROUPS:
        module = vars(importlib.import_module(f"scenegen.errors.{group}"))
        for name, kind in module.items():
            if isinstance(kind, Kind):
                assert name == kind.code.replace("-", "_").upper(), "the code is the name"
                assert CATALOG[kind.code].kind is kind, f"{kind.code} is the code of two kinds"
    text = "".join((PACKAGE / "errors" / "explanations" / f"{group}.toml").read_text() for group in GROUPS)
    assert sorted(re.findall(r"^\[([a-z0-9-]+)\]$", text, re.MULTILINE)) == sorted(CATALOG)
    for entry in CATALOG.values():
        assert entry.means.endswith(".") and bool(entry.untried) == (not entry.example) == (not entry.mended), entry
    assert len(TRIED) >= 0.69 * len(CATALOG), "most kinds have an example that is run"


def uses():
    """Where the package makes a problem of a kind: (place, kind, facts given, or None where they are computed)."""
    known = {kind.code.replace("-", "_").upper(): kind for kind in (entry.kind for entry in CATALOG.values())}
    for path in sorted(PACKAGE.rglob("*.py")):
        if path.parent.name == "errors":
            continue
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id in known and isinstance(node.ctx, ast.Load):
                yield f"{path.relative_to(PACKAGE)}:{node.lineno}", known[node.id], None
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in known:
                given = {word.arg for word in node.keywords}
                yield (
                    f"{path.relative_to(PACKAGE)}:{node.lineno}",
                    known[node.func.id],
                    None if None in given else given,
                )


@pytest.mark.long
def test_every_kind_is_used_and_gets_the_facts_that_its_title_needs():
    used = set()
    for place, kind, given in uses():
        used.add(kind.code)
        if given is None:
            continue
        titles = (kind.title,) if isinstance(kind.title, str) else kind.title
        assert any(fields(title)[0] <= given for title in titles), (place, kind.code, given)
        texts = [
            one
            for text in (kind.title, kind.label, kind.help, kind.note)
            for one in ([text] if isinstance(text, str) else text)
        ]
        known = set.union(*(set.union(*fields(text)) for text in texts)) | {"name", "known"}
        assert given <= known, (place, kind.code, given - known)
    assert used == set(CATALOG)


@pytest.mark.long
def test_problems_are_made_of_kinds_and_flags_are_named_in_the_program_alone():
    for path in sorted(PACKAGE.rglob("*.py")):
        if path.parent.name in ("errors", "cli"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id != "Diagnostic", f"{path}:{node.lineno}: call a kind instead"
            if isinstance(node, ast.JoinedStr | ast.Constant) and not path.name.startswith(("needs", "card")):
                shown = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
                docstring = shown.count("\n") > 0 or shown.endswith(".")
                assert docstring or not re.search(r"(?<!\w)--[a-z]", shown), f"{path}:{node.lineno}: {shown}"


def test_explain(codes, capfd):
    from scenegen.cli.app import run

    assert run(["explain", "unknown-relation"]) == 0
    said = capfd.readouterr().out
    entry = CATALOG["unknown-relation"]
    assert said.startswith("error[unknown-relation]\n") and entry.means in said
    assert entry.example in said and entry.mended in said
    assert run(["explain"]) == 0
    assert set(re.findall(r"^  ([a-z0-9-]+) ", capfd.readouterr().out, re.MULTILINE)) == set(CATALOG)
    assert run(["explain", "unknown-relatoin"]) == 1
    assert "did you mean `unknown-relation`?" in capfd.readouterr().err


def test_former_codes_are_explained_and_belong_to_one_kind(capfd):
    from scenegen.cli.app import run

    former = [(old, code) for code, entry in CATALOG.items() for old in entry.kind.formerly]
    olds = [old for old, _ in former]
    assert len(set(olds)) == len(olds) and not set(olds) & set(CATALOG)
    for old, code in former:
        assert run(["explain", old]) == 0
        assert f"[{code}]" in capfd.readouterr().out.splitlines()[0]
