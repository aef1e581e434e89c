"""How many examples hypothesis tries of a law: a sixth of them in `make test`, all of them in `make test-slow`, or
wherever the variable HYPOTHESIS_PROFILE is `full`."""

import os

import pytest

FULL = os.environ.get("HYPOTHESIS_PROFILE") == "full"
in_full_again = pytest.mark.hypothesis  # of tests that do more where FULL: `make test-slow` runs them, too


def examples(count: int) -> int:
    return count if FULL else max(10, count // 6)
