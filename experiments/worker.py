"""A process that trains, or does other jobs: these come as lines of JSON on standard input, an answer of fixed size for
each goes to standard output.

What the process has to say besides goes to standard error, as everything that is no answer does.
"""

from __future__ import annotations

import importlib
import json
import os
import struct
import sys
from collections.abc import Mapping
from typing import Any

ANSWER = struct.Struct("<d")  # what a job says of itself: CPU seconds


def main(job: Mapping[str, Any]) -> None:
    """Serve until standard input ends. `job` names a module, its function, and the class of what the function takes."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    module = importlib.import_module(job["module"])
    perform, kind = getattr(module, job["function"]), getattr(module, job["kind"])
    for line in sys.stdin.buffer:
        answers.write(ANSWER.pack(perform(kind(**json.loads(line)))))
        answers.flush()
