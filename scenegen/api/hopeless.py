"""Formulas that no scene satisfies, and why."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from scenegen.bounds import spec_bounds
from scenegen.errors import Diagnostic
from scenegen.lang.core import REQUIRE, Core, gated, part
from scenegen.lang.interpret import phi
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives import NUMPY

Array = npt.NDArray[np.float64]

ENDS = (0.0, math.inf)  # satisfied
SCENES, LIVE = 256, 1 << 22  # scenes of the first look, and numbers that it may hold at a time
WORK = 3000  # visits of nodes that one label's search for clashes may take: about 0.2 s
MOST = 24  # labels that are searched for clashes; of more, bounds alone decide


def hopeless(spec: CheckedSpec) -> list[Diagnostic]:
    """A warning for each label that no scene seems to satisfy, and for a requirement that no scene meets.

    Scenes are looked for first: most labels are done with that. Each warning names the smallest set of conjuncts that
    clash, and says whether bounds prove it or the search just found nothing.
    """
    core, box, bounds = gated(spec.core), spec.box(), spec_bounds(spec)
    required = (REQUIRE,) if REQUIRE in core.labels else ()
    waiting = _not_at_once(core, box)
    if not waiting:
        return []
    from scenegen.bounds.clash import clash, explain
    from scenegen.bounds.search import find

    if len(waiting) > MOST:
        waiting = [name for name in waiting if bounds[name][1] < 0.0][:MOST]
    missing = []
    for name in waiting:
        one = part(core, (name, *required))
        if find(one, *box, dict.fromkeys(one.labels.values(), ENDS), work=WORK).verdict != "yes":
            highest = bounds[name][1]
            most = f": phi is at most {highest:.4g}" if highest < 0.0 else ""
            missing.append((f"`{name}`", f"satisfied{most}", one))
    if required and len(missing) == len(spec.labels):  # some label's scene would have met the requirement, too
        missing.insert(0, ("what the spec requires", "met", part(core, required)))
    found: list[Diagnostic] = []
    for what, done, one in missing:
        result = clash(one, *box, dict.fromkeys(one.labels.values(), ENDS), work=WORK)
        if result is None:
            continue
        title = f"{what} {'can never' if result.proved else 'can hardly'} be {done}"
        found.append(explain(one, result, title, "change one of the parts that clash", "warning"))
        if done == "met":
            break  # without it nothing else matters
    return found


def _not_at_once(core: Core, box: tuple[Array, Array]) -> list[str]:
    """The labels that none of a few random scenes satisfies together with the requirement."""
    lowest, highest = (end[:, None] for end in box)
    scenes = max(8, min(SCENES, LIVE // len(core.nodes)))
    rows = lowest + (highest - lowest) * np.random.default_rng(0).random((len(lowest), scenes))
    met = {name: np.broadcast_to(value, scenes) >= 0.0 for name, value in phi(core, list(rows), NUMPY).items()}
    valid = met.pop(REQUIRE, np.ones(scenes, dtype=bool))
    return [name for name, satisfied in met.items() if not (satisfied & valid).any()]
