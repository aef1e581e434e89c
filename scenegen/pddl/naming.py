"""Names as every planner reads them: letters, digits, `-` and `_`, no two alike when case is ignored."""

from __future__ import annotations

import re

RESERVED = frozenset(  # words with a meaning where facts and types stand
    "and or not imply forall exists when either object number assign increase decrease scale-up scale-down preference "
    "always sometime within define".split()
)


def fits(name: str) -> bool:
    """Whether PDDL has such a name."""
    return re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) is not None


class Names:
    """Names that were given. Objects, types and predicates share them: some planners keep them in one table."""

    def __init__(self) -> None:
        self._taken = set(RESERVED)

    def give(self, wanted: str, otherwise: str = "") -> str:
        """A free name like the wanted one: itself, with `otherwise` behind it, or with a number."""
        made = re.sub(r"[^A-Za-z0-9_-]+", "_", wanted.rstrip("]")) or "thing"
        made = made if made[0].isalpha() else f"a{'' if made[0] == '_' else '_'}{made}"
        number = 1
        name = made
        while name.lower() in self._taken:
            number += 1
            name = f"{made}{otherwise}" if otherwise and number == 2 else f"{made}-{number}"
        self._taken.add(name.lower())
        return name
