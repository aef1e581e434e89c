"""What LeRobot calls a suite: the one name of ours that its results keep."""

from __future__ import annotations

import re

from scenegen.play.suites.suite import Suite

SHORT_DIGEST, REVERSED = 12, "-reversed"  # how many of the 64 digits; what ends the name of reversed tasks


def group_name(suite: Suite) -> str:
    """`NAME-DIGEST`, or `NAME-DIGEST-reversed`; it is part of the names of folders, too."""
    return f"{suite.name}-{suite.digest[:SHORT_DIGEST]}{REVERSED * suite.reverse}"


def suite_of_group(name: str) -> tuple[str | None, bool]:
    """The beginning of the digest in such a name, if there is one, and whether it is of reversed tasks."""
    found = re.search(f"-([0-9a-f]{{{SHORT_DIGEST}}})({REVERSED})?$", name)
    return (found[1], found[2] is not None) if found else (None, False)
