"""The tasks, and how long they are learnt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenegen.api.spec import Spec

TWO_OBJECTS = """\
# A plate in the middle of the near half, and a mug close to it on the right, behind it.
object plate, mug
task: closeTo(plate, (0.5, 0.25), 2 cm) & closeTo(mug, plate, 10 cm) & rightOf(mug, plate) & aboveOf(mug, plate)
"""


@dataclass(frozen=True, slots=True)
class Task:
    """What is to be learnt: `text` is the spec's, or the name of one that ships with scenegen. All objects move at
    once, in a step by at most `step` metres along x and along y and by `turn` radians where headings count; an episode
    has at most `horizon` steps, a run at most `budget` steps of all tables together."""

    key: str
    title: str
    text: str
    step: float
    turn: float
    horizon: int
    budget: int

    def load(self) -> Spec:
        """The spec."""
        from scenegen.api.spec import load, parse
        from scenegen.resources import shipped_specs

        shipped = shipped_specs()
        return load(shipped[self.text]) if self.text in shipped else parse(self.text, f"{self.key}.spec")


TASKS: dict[str, Task] = {
    "two": Task("two", "Two movable objects", TWO_OBJECTS, 0.05, 0.3, 40, 163_840),
    "setting": Task("setting", "A table set for one, four movable objects", "table_setting", 0.1, 0.3, 30, 327_680),
}


@dataclass(frozen=True, slots=True)
class Effort:
    """What a run costs. `tables` are learnt from at once. `budget` replaces that of the task, unless None; success is
    measured every `each` steps, on `held_out` scenes: 500 give a standard error of at most 0.022. `epochs`, `scenes`
    and `data` train the model, its recipe's own where None."""

    tables: int
    budget: int | None
    each: int
    held_out: int
    epochs: int | None
    scenes: int | None
    data: str | None


FULL = Effort(128, None, 8_192, 500, 4, None, None)
QUICK = Effort(16, 512, 512, 32, 1, 256, "uniform")
