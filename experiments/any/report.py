"""How good the model of any spec is: `python -m experiments.any.report OUT.jsonl WHICH [COUNT]`.

WHICH is one of tune, report, wide, larger and shipped; COUNT takes the first so many specs. Each is asked for phi as in
experiments.unseen.queries: quantiles of each label, and pairs of labels. A row compares raw scenes with as many exact
ones. Rows are kept spec by spec; a second call goes on.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import torch

from experiments.any.specs import LARGER, wide_text
from experiments.any.specs import TUNE as WIDE
from experiments.unseen.queries import PATIENCE, SCENES, Array, Query, queries, truth
from experiments.unseen.specs import REPORT, TUNE, spec_text
from scenegen.api.spec import Spec, load, parse
from scenegen.errors import RequestError, ScenegenError
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.learn.any import AnyModel
from scenegen.learn.evaluation.card import level
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.balanced import reach
from scenegen.processes.pool import one_thread
from scenegen.resources import shipped_specs

SEED = 20_261_128  # of the truth
FEWER, SHORT = 600, 5.0  # scenes of a row, and CPU seconds for its truth, on specs that no other model is measured on
BARS: dict[str, tuple[Callable[[dict[str, Any]], bool], float]] = {
    "error <= 0.01": (lambda row: row["error"] <= 0.01, 0.9),
    "coverage >= 0.90": (lambda row: row["coverage"] >= 0.9, 0.8),
    "coverage >= 0.75": (lambda row: row["coverage"] >= 0.75, 0.95),
    "KS and sliced KS <= 0.15": (lambda row: max(row["ks"], row["sliced"]) <= 0.15, 0.8),
    "goal: coverage >= 0.93": (lambda row: row["coverage"] >= 0.93, 0.9),
}


def named(which: str) -> Iterator[tuple[str, str | Path, int]]:
    """Names of specs, their texts or files, and the seeds of what they are asked for."""
    if which == "shipped":
        yield from ((name, path, 0) for name, path in shipped_specs().items())
        return
    seeds, text = {
        "tune": (TUNE, spec_text),
        "report": (REPORT, spec_text),
        "wide": (WIDE[:40], wide_text),
        "larger": (LARGER[:40], wide_text),
    }[which]
    for seed in seeds:
        yield f"{which} {seed}", text(seed), seed


def rows(
    name: str,
    source: str | Path,
    seed: int,
    scenes: int,
    patience: float,
    made_by: Mapping[str, Callable[[Spec], AnyModel]] = MappingProxyType({"any": AnyModel}),
) -> Iterator[dict[str, Any]]:
    """What is found for a spec, query by query and model by model; one row with `refused` where it is none for them."""
    try:
        spec: Spec = load(source) if isinstance(source, Path) else parse(source)
        began = time.process_time()
        models = {one: make(spec) for one, make in made_by.items()}
        bound = (time.process_time() - began) / len(models)
        wanted, missing = queries(spec.checked, reach(spec.checked, 0), seed, patience)
    except ScenegenError as error:
        yield {"spec": name, "refused": error.diagnostics[0].title}
        return
    yield from ({"spec": name, "missing": why} for why in missing)
    for query in wanted:
        told = {"spec": name, "objects": len(spec.objects), "wanted": dict(query.wanted)}
        began = time.process_time()
        try:
            exact, phi = truth(spec.checked, query, 2 * scenes, SEED, patience)
        except RequestError as error:
            yield {**told, "missing": error.diagnostics[0].title}
            continue
        cost = (time.process_time() - began) / exact.shape[1]
        for one, model in models.items():
            began = time.process_time()
            found = level(model, query.wanted, exact, phi)
            yield {
                **told,
                "model": one,
                "error": found.error,
                "coverage": found.made.coverage,
                "ks": found.made.ks,
                "sliced": found.made.sliced,
                "required": found.required,
                "true": [found.truth.coverage, found.truth.ks, found.truth.sliced],
                "alone": found.alone,
                "seconds": [bound, time.process_time() - began],
                "proposals": [cost, *proposals(model, query, phi[:, scenes:])],
            }


def proposals(model: AnyModel, query: Query, phi: Array) -> tuple[float, float]:
    """CPU seconds of a scene of the network alone, asked for the phi (L, n) of exact scenes, and the share of them that
    lie in the query's bands and meet what is required: with the exact samplers' seconds a scene these bound what could
    be saved by drawing from it, if weights cost nothing and were all equal."""
    wanted = model.trained.with_free_labels(torch.from_numpy(phi).float(), list(query.wanted))
    began = time.process_time()
    rows = model.trained.network.propose(wanted, torch.Generator().manual_seed(SEED))
    cost = (time.process_time() - began) / rows.shape[1]
    core = gate(model.spec.checked.core)
    found = dict(zip(core.labels, Robustness(core).rows(rows), strict=True))
    inside = torch.ones(rows.shape[1], dtype=torch.bool) if REQUIRE not in found else found[REQUIRE] >= 0.0
    for label, ends in query.ranges.items():
        assert ends.low is not None and ends.high is not None
        inside &= (found[label] >= ends.low) & (found[label] <= ends.high)
    return cost, float(inside.float().mean())


def figures(found: list[dict[str, Any]]) -> dict[str, str]:
    """What the rows of a report say, by name."""
    measured = [row for row in found if "error" in row]
    specs = len({row["spec"] for row in measured})
    left = sum("missing" in row for row in found), len({row["spec"] for row in found if "refused" in row})
    told = {
        "measured on": f"{len(measured)} rows of {specs} specs; {left[0]} rows without a truth, {left[1]} specs refused"
    }
    for name, (meets, share) in BARS.items():
        told[name] = f"{np.mean([meets(row) for row in measured]):.1%} of the rows (bar: {share:.0%})"
    cheaper = [cost > made / share if share else False for cost, made, share in (row["proposals"] for row in measured)]
    told["as a proposal"] = f"cheaper than exact sampling at best in {np.mean(cheaper):.0%} of the rows"
    for key in ("error", "coverage", "ks", "sliced"):
        low, middle, high = np.quantile([row[key] for row in measured], (0.1, 0.5, 0.9))
        told[key] = f"median {middle:.4f}, from {low:.4f} to {high:.4f} in the middle 80 %"
    return told


def main(out: Path, which: str, count: int | None) -> None:
    found = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    done = {row["spec"] for row in found}
    with one_thread(), out.open("a") as file:
        for name, source, seed in list(named(which))[:count]:
            if name in done:
                continue
            mine = list(rows(name, source, seed, *((SCENES, PATIENCE) if which == "report" else (FEWER, SHORT))))
            found += mine
            file.write("".join(json.dumps(row) + "\n" for row in mine))
            file.flush()
    print("\n".join(f"{name}: {told}" for name, told in figures(found).items()))


if __name__ == "__main__":
    torch.set_num_threads(1)
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else None)
