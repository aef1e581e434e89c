"""One request: its fields are the options of `scenegen sample`, of Python, and of the table in docs/sampling.md."""

import dataclasses
import inspect
from pathlib import Path

import pytest

import scenegen
from scenegen.cli.app import COMMANDS
from scenegen.cli.sample import sample as command
from scenegen.errors import RequestError
from scenegen.sampling.request import FixedPose, Range, SampleRequest
from scenegen.validation import Option, options_of

FIELDS = options_of(SampleRequest)
DEFAULTS = {one.name: one.default for one in dataclasses.fields(SampleRequest)}
PAGE = Path(__file__).resolve().parents[2] / "docs" / "sampling.md"
START, END = "<!-- options: made by `make derived` -->\n", "<!-- end of options -->\n"


@pytest.mark.parametrize(
    "function, what",
    [
        (scenegen.sample, {"scenes"}),
        (scenegen.sample_to, {"scenes", "files", "sets"}),
        (scenegen.sample_motions, {"motions"}),
    ],
)
def test_python_has_the_options_that_mean_something_by_the_same_names_and_defaults(function, what):
    given = inspect.signature(function).parameters
    usual = {name for name, (_, option) in FIELDS.items() if what & {*option.of}}
    assert usual <= set(given) and not (set(FIELDS) - usual) & set(given)
    for name in usual & set(given):
        if name not in ("phi", "fix", "n"):  # which may be left out
            assert given[name].default == DEFAULTS[name], name


def test_the_command_has_every_option():
    given = inspect.signature(command).parameters
    assert set(FIELDS) <= set(given)
    for name, (_, option) in FIELDS.items():
        assert given[name].default.help == option.help


def test_what_is_typed_becomes_the_request():
    typed = {"phi": ["task=0:0.2"], "n": 4, "fix": ["mug=0.5,25cm"], "method": None, "raw": False}
    request = SampleRequest.parse(typed, ["task", "safe"])
    assert request == SampleRequest({"task": Range(0.0, 0.2)}, 4, fix={"mug": FixedPose(0.5, 0.25)})
    assert request.method == "auto"


@pytest.mark.parametrize(
    "changes, what, name",
    [
        ({}, ["motions"], None),
        ({"settle": True}, ["motions"], None),
        ({"raw": True}, ["motions", "sets"], "raw"),
        ({"settle": True}, ["scenes"], None),
        ({"engine": "ray"}, ["scenes", "files"], "engine"),
        ({"resume": True}, ["scenes"], "resume"),
        ({"shard_size": 65536}, ["scenes"], "shard_size"),
        ({"shard_size": 65536, "address": "auto"}, ["motions", "sets"], None),
    ],
)
def test_options_that_mean_nothing_are_found(changes, what, name):
    assert SampleRequest(**changes).misplaced_option(*what) == name


@pytest.mark.parametrize(
    "changes", [{"n": True}, {"n": 0}, {"seed": 1.5}, {"spread": "best"}, {"fix": [1]}, {"timeout": "soon"}, {"phi": 3}]
)
def test_a_request_that_can_be_none_is_never_made(changes):
    with pytest.raises(RequestError):
        SampleRequest(**changes)


def test_the_table_of_options(derived):
    """In docs/sampling.md: all that `scenegen sample` takes, in the order of its help."""
    assert COMMANDS["sample"].endswith(":sample")
    lines = ["| option | | for |", "|---|---|---|"]
    for name, one in inspect.signature(command).parameters.items():
        if not isinstance(one.default, type(inspect.signature(command).parameters["phi"].default)):
            continue  # an argument
        flag = one.default.param_decls[0] if one.default.param_decls else f"{'-' if len(name) == 1 else '--'}{name}"
        shown = f"{flag.replace('_', '-')} {one.default.metavar or ''}".strip().replace("|", "\\|")
        of = FIELDS[name][1].of if name in FIELDS else ()
        usual = f"; {one.default.default} by default" if one.default.show_default else ""
        where = "" if of == Option("").of else ", ".join(of)
        lines.append(f"| `{shown}` | {one.default.help.rstrip('.').replace('|', chr(92) + '|')}{usual} | {where} |")
    table = "\n".join(lines) + "\n"
    before, _, rest = PAGE.read_text().partition(START)
    _, _, after = rest.partition(END)
    derived("docs/sampling.md", before + START + table + END + after)
