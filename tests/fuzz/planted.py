"""Planted scenes: random specs, each written around a scene that satisfies it by a margin down to 1e-9.

First come declarations, on tables of 1 cm to 100 m: heights, choices of surfaces, numbers of things. A scene of them is
drawn, and then relations are written whose tolerances fit it. So whatever says that no scene can satisfy the spec is
wrong.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.api.feasibility import doubts
from scenegen.errors import RequestError, SpecError
from scenegen.errors.requests import BEYOND_BOUNDS, NO_SUCH_SCENE, TABLE_TOO_FULL
from scenegen.geometry import NUMPY
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import CheckedSpec, combinations
from scenegen.sampling.growth.graph import make_graph
from scenegen.sampling.growth.packing import packing_proof
from scenegen.sampling.parts import independent_parts
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rejection.sampler import make_plan
from scenegen.sampling.rejection.trial import make_cover
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search import spec_bounds
from scenegen.search.conflict import minimal_conflict
from scenegen.search.effort import Budget, Effort, TooMuchError
from scenegen.search.prune import find_witness

Array = npt.NDArray[np.float64]

PROOFS = (NO_SUCH_SCENE, BEYOND_BOUNDS, TABLE_TOO_FULL)
MARGINS = (1e-9, 1e-9, 1e-8, 1e-7, 1e-5, 1e-3)
NUMBERS = (  # of one or several things
    "x({a})", "y({a})", "dist({a}, {b})", "gap({a}, {b})", "x({a}) - x({b})", "y({a}) - y({b})", "theta({a})",
    "room({a}, workspace)", "wrap(theta({a}) - theta({b}))", "wrap(theta({a}) - bearing({a}, {b}))", "leftEdge({a})",
    "topEdge({a}) - topEdge({b})", "dist({a}, {b}) + dist({b}, {c}) - dist({a}, {c})", "2 * x({a}) - 3 * y({b})",
    "mean(gaps([{a}, {b}, {c}]))", "max(x({a}), x({b}))", "apart({a}, {b})", "gap({a}, {r})", "room({a}, {r})",
    "dist({a}, {b}) - 1.5 * dist({a}, {c})", "z({a}) + x({b})", "cos(theta({a})) * 2", "x({a}) * 1000",
    "min(dist({a}, {b}), dist({a}, {c}))", "sum(x({a}), x({b}), x({c}))", "abs(x({a}) - x({b}))", "dist({a}, {r})",
)  # fmt: skip
RELATIONS = (  # of the prelude; the larger e, the easier they are to satisfy
    "closeTo({a}, {b}, {e})", "angle({a}, 40 deg, {e})", "between({a}, {b}, {c}, {e})", "alignedX({a}, {b}, {e})",
    "alignedY({a}, {b}, {e})", "facing({a}, {b}, {e})", "sameHeading({a}, {b}, {e})", "touching({a}, {b}, {e})",
    "mirroredPlace({a}, {b}, e = {e})", "nearEdge({a}, e = {e})", "inCorner({a}, e = {e})", "touching({a}, {r}, {e})",
    "evenlySpaced([{a}, {b}, {c}], {e})", "!farFrom({a}, {b}, {e})", "!clearOf({a}, {b}, {e})",
    "atLevel({a}, {b}, {e})",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Planted:
    """`member` is the checked spec of `text` with the numbers of things that the scene `rows` (3N,) has; `phi` is that
    of the scene by label, that of what is required among them. `numbers` says how many things there are."""

    text: str
    member: CheckedSpec
    rows: Array
    phi: dict[str, float]
    numbers: dict[str, int]
    margin: float


@dataclass(slots=True)
class Planter:
    """Writes one spec."""

    rng: random.Random
    things: list[str] = field(default_factory=list)
    regions: list[str] = field(default_factory=lambda: ["workspace"])
    declared: list[str] = field(default_factory=list)
    which: int = 0  # among the numbers of things
    rows: Array = field(default_factory=lambda: np.empty(0))

    def declare(self) -> None:
        """A table of 1 cm to 100 m, and up to 8 things on it."""
        rng = self.rng
        side = 10.0 ** rng.uniform(-2.0, 2.0)
        self.declared.append(f"workspace [0, {side!r}] x [0, {side * rng.uniform(0.5, 1.5)!r}]")
        for number in range(rng.choice([0, 1, 2])):
            x, y = (rng.uniform(0.0, 0.4) * side for _ in "xy")
            high = rng.choice(["", f" at {rng.uniform(0.01, 2.0):.2f} m"])
            self.regions.append(f"r{number}")
            self.declared.append(f"region r{number} = rect({x}, {y}, {x + side / 4}, {y + side / 3}){high}")
        surfaces = list(self.regions)
        for number in range(rng.randint(3, 5)):
            name, size = f"o{number}", rng.uniform(0.01, 0.06) * side
            count = rng.choice([1, 1, 1, 2, 3])
            shape = rng.choice([f"cylinder({size}, {size})", f"box({2 * size}, {size}, {size / 2})"])
            where = ""
            if rng.random() < 0.5 and len(surfaces) > 1:
                where = f" on any of [{', '.join(rng.sample(surfaces, min(len(surfaces), rng.choice([2, 2, 3]))))}]"
            array = "" if count == 1 else f"[{count}]"
            if not number and rng.random() < 0.25:
                array, count = "[3..4]", 3
            self.declared.append(f"object {name}{array} = {shape}{where}")
            self.things += [name] if not array else [f"{name}[{one + 1}]" for one in range(count)]
            if not array:
                surfaces.append(name)

    def spec(self, *lines: str) -> tuple[CheckedSpec, dict[str, int]]:
        """The checked spec with these lines after its declarations, for the numbers of things of the scene."""
        spec = check_text("\n".join([*self.declared, *lines]) + "\n")
        if not spec.members:
            return spec, {}
        return spec.members[self.which], list(combinations(spec.counts))[self.which]

    def values(self, formulas: list[str]) -> list[float]:
        """phi of formulas in the scene."""
        spec, _ = self.spec(*(f"f{number}: {formula}" for number, formula in enumerate(formulas)))
        found = phi(spec.core, list(self.rows[:, None]), NUMPY)
        return [float(np.ravel(value)[0]) for value in found.values()]

    def relation(self, margin: float) -> str:
        """A relation that the scene satisfies by `margin`."""
        while True:
            try:
                return self._relation(margin)
            except SpecError:  # of constants
                pass

    def _relation(self, margin: float) -> str:
        rng = self.rng
        a, b, c = (rng.sample(self.things, 3) * 3)[:3]
        names = {"a": a, "b": b, "c": c, "r": rng.choice(self.regions)}
        if rng.random() < 0.5:
            form = rng.choice(RELATIONS)
            (missing,) = self.values([form.format(**names, e=0)])
            return form.format(**names, e=repr(max(margin - missing, 0.0)))
        number = rng.choice(NUMBERS).format(**names)
        (value,) = self.values([f"{number} >= 0"])
        return rng.choice(
            [
                f"abs({number} - {value!r}) <= {margin!r}",
                f"{number} >= {value - margin!r}",
                f"{number} <= {value + margin!r}",
                f"!({number} >= {value + margin!r})",
            ]
        )

    def formula(self, margin: float) -> str:
        """Relations of which the scene satisfies enough."""
        rng, parts = self.rng, []
        for _ in range(rng.choice([1, 2, 3, 5])):
            one = self.relation(margin)
            if rng.random() < 0.3:
                form = rng.choice(RELATIONS).format(
                    **dict(zip("abc", rng.sample(self.things, 3), strict=True)), r=self.regions[0], e=repr(margin)
                )
                one = f"({' | '.join(rng.sample([one, form], 2))})"
            parts.append(one)
        return " & ".join(parts)

    def write(self) -> Planted:
        rng, margin = self.rng, self.rng.choice(MARGINS)
        self.declare()
        any_ = f"task: x({self.things[0]}) >= 0"
        family = check_text("\n".join([*self.declared, any_]))
        self.which = rng.randrange(max(1, len(family.members)))
        spec, numbers = self.spec(any_)
        problem = make_problem(spec, SampleRequest(n=16, seed=rng.randrange(1000)))
        self.rows = make_plan(problem, Budget()).draw(0).rows[:, 0]
        lines = [f"require {self.formula(margin)}"] if rng.random() < 0.4 else []
        lines += [f"{name}: {self.formula(margin)}" for name in ["task", "safe"][: rng.choice([1, 1, 2])]]
        member, numbers = self.spec(*lines)
        found = {
            name: float(np.ravel(value)[0])
            for name, value in phi(gate(member.core), list(self.rows[:, None]), NUMPY).items()
        }
        return Planted("\n".join([*self.declared, *lines]) + "\n", member, self.rows, found, numbers, margin)


def planted(seed: int) -> Planted:
    """The same on any machine. Where rounding takes the margin, the scene misses it by less than 1e-12."""
    made = Planter(random.Random(f"planted {seed}")).write()
    assert made.phi.get(REQUIRE, 0.0) >= -1e-12 * max(1.0, float(np.abs(made.rows).max())), made.text
    return made


def wrong_proofs(made: Planted, work: float = 3e7) -> list[str]:
    """Who says that no scene can satisfy a planted spec, or lie close to the phi of its scene: the places at which
    scenegen proves such things, one after another."""
    found, core = [], gate(made.member.core)
    bounds = spec_bounds(made.member)
    found += [f"bounds of {name}" for name, (low, high) in bounds.items() if not low <= made.phi[name] <= high]
    satisfied = {name: Range(0.0) for name in bounds if made.phi[name] >= 0.0}
    near = {
        name: Range(made.phi[name] - made.margin, made.phi[name] + made.margin)
        for name in satisfied
        if made.phi[name] + made.margin > made.phi[name]
    }
    for what, asked in (("satisfied", satisfied), ("near", near)):
        try:
            problem = make_problem(made.member, SampleRequest(asked, n=20, seed=1))
        except RequestError as error:
            if error.diagnostics[0].kind in PROOFS:
                found.append(f"{what}: make_problem: {error}")
            continue
        values = np.array([[made.phi[name]] for name in core.labels])
        (cell,) = map(int, problem.cells.find(values))
        if cell >= 0 and cell not in problem.possible | problem.improbable:
            found.append(f"{what}: cell {cell}")
        if (
            minimal_conflict(core, *made.member.box(), problem.demand(), search=False, work=int(work / 1000))
            is not None
        ):
            found.append(f"{what}: clash")
        if find_witness(core, *made.member.box(), problem.demand(), work=int(work / 1000)).verdict == "no":
            found.append(f"{what}: search")
        with np.errstate(all="ignore"):
            found += [f"{what}: {proof}" for proof in [packing_proof(make_graph(problem), problem.spec)] if proof]
            for mine, wanted in (("range", problem.demand()), ("cell", problem.demand(max(cell, 0)))):
                try:
                    if not make_cover(problem, wanted, (1, 2), Effort(most=work)).parts:
                        found.append(f"{what}: cover of the {mine}")
                except TooMuchError:
                    pass
        try:
            independent_parts(problem, Budget())
        except RequestError as error:
            found.append(f"{what}: parts: {error}")
    found += [
        f"check: {one.label}" for one in doubts(made.member) if one.proved and made.phi.get(one.label, 0.0) >= 0.0
    ]
    return found
