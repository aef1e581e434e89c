"""How the page names what an error asks for: by its own fields, and what has no field as an option of the command."""

from __future__ import annotations

import re

FIELDS = {"n": "scenes", "seed": "seed", "method": "method", "spread": "spread"}
"""The page's fields by argument, as page/src/panels/Request.tsx labels them."""
CHOICES = {("spread", "base"): "like random scenes", ("spread", "flat"): "evenly over phi"}


def control(name: str, value: str | None = None) -> str:
    """An argument as the page names it: `spread: like random scenes`, or `--timeout` where no field has it."""
    if name in FIELDS:
        chosen = CHOICES.get((name, value or ""), value)
        return FIELDS[name] if chosen is None else f"{FIELDS[name]}: {chosen}"
    option = f"--{name.replace('_', '-')}"
    return f"{option} of the command line" if value in (None, "True") else f"{option} {value} of the command line"


_NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_RANGE = re.compile(rf"(?<![\w.:`-])(?:({_NUMBER}):({_NUMBER})?|:({_NUMBER}))(?![\w:-]|\.\d)(?=:?)")


def without_command_line(text: str) -> str:
    """A text with ranges in words, not as the command line takes them: `0:` is `0 or more`."""

    def words(found: re.Match[str]) -> str:
        low, high, alone = found.groups()
        if alone is not None:
            return f"{alone} or less"
        return f"{low} or more" if high is None else f"{low} to {high}"

    return _RANGE.sub(words, text)
