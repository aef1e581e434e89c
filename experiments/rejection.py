"""How many draws a scene costs: plain rejection, our two samplers, and a model whose scenes are refined."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from experiments.known import HITS
from experiments.page import table
from experiments.plan import Plan
from experiments.problems import BAND, PROBLEMS, Problem
from experiments.report import Report, short
from experiments.samplers import CHUNK, plain_rejection
from scenegen.api.sample import sample
from scenegen.processes.pool import one_thread


def run(plan: Plan) -> Report:
    """One table over the five problems."""
    facts = []
    with one_thread():
        for problem in PROBLEMS.values():
            plan.tell(f"{problem.title}: counting draws")
            facts.append({"problem": problem.key, **_counts(plan, problem)})
    return Report("rejection", "Draws per scene", tables(facts), {"problems": facts, "band": BAND})


def tables(facts: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """The table of what was counted, a line per problem."""
    head = [
        f"phi as wanted +- {BAND}",
        "one scene in",
        "plain rejection: draws a scene",
        "scenes/s",
        "pruned rejection: draws a scene",
        "scenes/s",
        "splitting: draws a scene",
        "scenes/s",
        "published model and filter, scenes/s",
    ]
    return {"draws": table(head, [_cells(found, PROBLEMS[found["problem"]]) for found in facts])}


def _counts(plan: Plan, problem: Problem) -> dict[str, Any]:
    spec, sizes = problem.load(), plan.sizes
    hits, seconds = plain_rejection(problem, spec, sizes.draws)
    found: dict[str, Any] = {"plain_hits": hits.shape[1], "plain_speed": hits.shape[1] / seconds}
    for method in ("rejection", "splitting"):
        began = time.process_time()
        scenes = sample(spec, problem.band, sizes.exact, seed=0, spread="base", method=method, workers=1)
        rate = sizes.exact / max(time.process_time() - began, 1e-9)
        facts = scenes.header.sampler
        draws = float(str(facts.get("draws", facts.get("candidates"))))
        found |= {f"{method}_draws": draws / sizes.exact, f"{method}_speed": rate}
        if method == "rejection":
            found["rejection_draws"] = 1.0 / float(str(facts["acceptance"]))
            found["log10_probability"] = facts["log10_probability"]
    probability = 10.0 ** float(found["log10_probability"])
    done = -(-sizes.draws // CHUNK) * CHUNK
    found["plain_draws"] = done / hits.shape[1] if hits.shape[1] else 1.0 / probability
    if not hits.shape[1]:
        found["plain_speed"] = done / seconds * probability
    return found


def _cells(found: Mapping[str, Any], problem: Problem) -> list[str]:
    one_in = 10.0 ** -float(found["log10_probability"])
    return [
        problem.title,
        short(one_in),
        short(found["plain_draws"]),
        short(found["plain_speed"]),
        f"{found['rejection_draws']:.2f}",
        short(found["rejection_speed"]),
        short(found["splitting_draws"]),
        short(found["splitting_speed"]),
        short(HITS[problem.key][1]),
    ]
