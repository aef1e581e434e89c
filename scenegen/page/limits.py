"""What one page may ask of the machine that serves it. A request beyond a limit is refused with a sentence."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

MAX_TEXT = 256 * 1024  # bytes of a spec
MAX_BODY = 8 * 1024 * 1024  # bytes of an HTTP request: a set of scenes to download
MAX_MESSAGE = 1024 * 1024  # bytes of one message over the WebSocket
MAX_PAGE_SCENES = 400  # that one request samples or evaluates
MAX_POSES = 20_000  # objects times scenes of one request
MAX_MOTION = 10_000  # objects times moments of one motion: it travels in one message
MAX_MOMENTS = 60_000  # objects times moments of all motions of one request
MAX_PLAYED = 100  # moments of a motion that is drawn as a GIF
MAX_SESSIONS = 12  # pages that are open at a time
MAX_REQUESTS = 64  # HTTP requests that are served at a time
MAX_WAITING = 32  # messages of one page that wait for their turn
MAX_PAGE_WORKERS = 40  # processes that work for all pages together
MAX_LISTED_SPECS = 500  # specs of a folder that the menu lists
MAX_CONNECTIONS = 512
MAX_WORKER_MEMORY = 6 << 30  # bytes of address space of one worker process; torch alone maps three

HEADER_SECONDS = 10.0  # that a client may take to send the head of a request
BODY_SECONDS = 20.0  # and its body
IDLE_SECONDS = 20.0  # a connection is kept between two requests

# seconds that a job of each kind may take, its process is ended then
JOB_SECONDS: Mapping[str, float] = MappingProxyType(
    {
        "check": 15.0,
        "assist": 5.0,
        "evaluate": 10.0,
        "sample": 60.0,
        "first": 6.0,
        "spread": 6.0,
        "range": 90.0,
        "download": 60.0,
    }
)


def most_scenes(objects: int) -> int:
    """How many scenes of so many objects the page shows."""
    return min(MAX_PAGE_SCENES, max(1, MAX_POSES // max(1, objects)))


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


_DECIMAL = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_RANGE = re.compile(rf"(?<![\w.:`-])(?:({_DECIMAL}):({_DECIMAL})?|:({_DECIMAL}))(?![\w:-]|\.\d)(?=:?)")


def without_command_line(text: str) -> str:
    """A text with ranges in words, not as the command line takes them: `0:` is `0 or more`."""

    def words(found: re.Match[str]) -> str:
        low, high, alone = found.groups()
        if alone is not None:
            return f"{alone} or less"
        return f"{low} or more" if high is None else f"{low} to {high}"

    return _RANGE.sub(words, text)
