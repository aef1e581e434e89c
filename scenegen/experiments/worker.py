"""A process that trains: jobs as lines of JSON on standard input, an answer of fixed size for each on standard output.

What the process has to say besides goes to standard error, as everything that is no answer does.
"""

from __future__ import annotations

import json
import os
import struct
import sys
from collections.abc import Mapping
from typing import Any

ANSWER = struct.Struct("<d")  # CPU seconds


def main(job: Mapping[str, Any]) -> None:
    """Serve until standard input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)

    from scenegen.experiments.trainings import Job, perform

    del job  # the first line says only how to start
    for line in sys.stdin.buffer:
        answers.write(ANSWER.pack(perform(Job(**json.loads(line)))))
        answers.flush()
