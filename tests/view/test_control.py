"""Errors on the page name its own fields; what has none is an option of the command."""

from pathlib import Path

import pytest

from scenegen.cli.output import flag
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.show.view.jobs.source import refusal
from scenegen.show.view.limits import FIELDS, control, without_command_line

PANEL = Path(__file__).parents[2] / "page/src/panels/Request.tsx"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("spread", "base", "spread: like random scenes"),
        ("method", "growth", "method: growth"),
        ("n", None, "scenes"),
        ("timeout", None, "--timeout of the command line"),
        ("keep_partial", "True", "--keep-partial of the command line"),
        ("fix", "mug=0.5,0.5", "--fix mug=0.5,0.5 of the command line"),
    ],
)
def test_control(name, value, said):
    assert control(name, value) == said


def test_fields_are_those_of_the_page():
    panel = PANEL.read_text()
    assert all(f"<label>{field} " in panel for field in FIELDS.values())
    assert "like random scenes</option>" in panel and "evenly over phi</option>" in panel


def test_refusal_speaks_of_the_page():
    found = refusal(RequestError(NO_TIME_TO_CHECK()))
    assert "--timeout of the command line" in found["help"] and found["help"] in found["text"]
    assert "`timeout`" not in found["text"] and flag("timeout") in found["text"]


def test_ranges_are_told_in_words():
    assert without_command_line("no scene can have phi of `set` in 0:") == "no scene can have phi of `set` in 0 or more"
    assert without_command_line("write 0.01:0.05, or :-1e-3") == "write 0.01 to 0.05, or -1e-3 or less"
    assert without_command_line("-0.2:-0.1") == "-0.2 to -0.1"
    for text in ("my.spec:2:28: unknown", "`task`: 3 of 4", "at 10:15:00", "a:b", "block[1]: 2"):
        assert without_command_line(text) == text
