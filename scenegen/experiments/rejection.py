"""How many draws a scene costs: plain rejection, our two samplers, and a model whose scenes are refined."""

from __future__ import annotations

import time
from typing import Any

from scenegen.api.sample import sample
from scenegen.engine.threads import one_thread
from scenegen.experiments.known import HITS
from scenegen.experiments.plan import Plan
from scenegen.experiments.problems import BAND, PROBLEMS, Problem
from scenegen.experiments.report import Report, short, table
from scenegen.experiments.samplers import CHUNK, plain_rejection

PAPER = (
    "The paper: rejection needs 700,000 draws in experiment 1 for what the GAN gives from the 20,000 scenes that it was"
    " trained on (35 times as many); in experiment 2 it found 60 scenes in 100 million draws and 7 hours."
)


def run(plan: Plan) -> Report:
    """One table over the five problems."""
    lines, facts = [], []
    with one_thread():
        for problem in PROBLEMS.values():
            plan.tell(f"{problem.title}: counting draws")
            found = _counts(plan, problem)
            facts.append({"problem": problem.key, **found})
            lines.append([problem.title, *_cells(found, problem)])
    head = [
        "phi as wanted +- 0.0125",
        "one scene in",
        "plain rejection: draws a scene",
        "scenes/s",
        "pruned rejection: draws a scene",
        "scenes/s",
        "splitting: draws a scene",
        "scenes/s",
        "published model and filter, scenes/s",
    ]
    first, second = facts[0], facts[1]
    saved = first["plain_draws"] / first["rejection_draws"] if first["plain_draws"] else 0.0
    blocks = [
        PAPER,
        table(head, lines),
        "A draw is a scene that phi is evaluated for. Of plain rejection"
        f" {plan.sizes.draws:,} were made; where they found no scene, the count follows from the exact samplers'"
        " probability and the speed is that of the draws. Scenes a second are CPU seconds on one core, the whole"
        f" request included, {plan.sizes.exact:,} scenes for the samplers. Splitting moves populations and pays for its"
        " levels once a request; it is there for what pruning cannot cut down. The last column is the reference"
        " measurement of the published networks on another machine: scenes that a filter lets through, with the"
        " coverage that exp1.md, exp2.md and exp3.md give.",
        f"In experiment 1 pruned rejection evaluates phi {saved:,.0f} times less often than plain rejection for the"
        " same scenes, and nothing is trained. The paper counts draws against training scenes; the 20,000 scenes that"
        f" its GAN is trained on are as many draws as {20_000 / first['rejection_draws']:,.0f} true scenes take here,"
        " each of them in the range and independent of the others. In experiment 2 the paper's 100 million draws are"
        f" what {1e8 / second['rejection_draws']:,.0f} true scenes take.",
    ]
    return Report("rejection", "Draws per scene", blocks, {"problems": facts, "band": BAND})


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


def _cells(found: dict[str, Any], problem: Problem) -> list[str]:
    one_in = 10.0 ** -float(found["log10_probability"])
    return [
        short(one_in),
        short(found["plain_draws"]),
        short(found["plain_speed"]),
        f"{found['rejection_draws']:.2f}",
        short(found["rejection_speed"]),
        short(found["splitting_draws"]),
        short(found["splitting_speed"]),
        short(HITS[problem.key][1]),
    ]
