"""How many examples hypothesis tries of a law: two fifths of them in `make test`, all of them in `make test-slow`, or
wherever the variable HYPOTHESIS_PROFILE is `full`."""

import os

FULL = os.environ.get("HYPOTHESIS_PROFILE") == "full"


def examples(count: int) -> int:
    return count if FULL else max(10, 2 * count // 5)
