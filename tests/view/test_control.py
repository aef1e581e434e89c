"""Errors on the page name its own fields; what has none is an option of the command."""

from pathlib import Path

import pytest

from scenegen.cli.output import flag
from scenegen.errors import RequestError
from scenegen.errors.requests import RANGE_WITHOUT_END
from scenegen.view.control import FIELDS, control
from scenegen.view.jobs.source import refusal

PANEL = Path(__file__).parents[2] / "page/src/panels/Request.tsx"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("spread", "base", "spread: as they occur"),
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
    assert "as they occur</option>" in panel and "flat in phi</option>" in panel


def test_refusal_speaks_of_the_page():
    found = refusal(RequestError(RANGE_WITHOUT_END()))
    assert "--phi of the command line" in found["help"] and found["help"] in found["text"]
    assert "`phi`" not in found["text"] and flag("phi") in found["text"]
