"""How broad random tests are: as broad as their numbers say in `make test-slow`, half as broad in `make test`."""

import os

THOROUGH = bool(os.environ.get("SCENEGEN_THOROUGH"))


def many(count: int) -> int:
    """Of so many examples, those that are tried in this run."""
    return count if THOROUGH else max(20, count // 2)
