"""The model of any spec tuned to one, against a flow trained anew: `python -m experiments.any.tuned OUT.jsonl`.

Of every fourth spec that is reported on. What the flow scores and costs is what docs/experiments/unseen.json keeps of
its first training. Rows are kept spec by spec; a second call goes on.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from experiments.unseen.queries import SCENES, queries, truth
from experiments.unseen.runs import TRUTH, Run
from experiments.unseen.specs import REPORT, spec_text
from scenegen.api.spec import parse
from scenegen.errors import RequestError
from scenegen.learn.evaluation.card import level
from scenegen.learn.train import train
from scenegen.learn.training.balanced import reach
from scenegen.processes.pool import one_thread

KEPT = Path(__file__).parents[2] / "docs" / "experiments" / "unseen.json"


def flows() -> dict[int, Run]:
    """The first trainings of the flow by the seeds of their specs."""
    runs = [Run.model_validate(one) for one in json.loads(KEPT.read_text())["runs"]]
    return {one.seed: one for one in runs if one.training_seed == 0 and not one.failed}


def tuned(seed: int, flow: Run) -> dict[str, Any]:
    """Coverage of both at what both were asked for, and the CPU seconds of both."""
    spec = parse(spec_text(seed))
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        model = train(spec, "any", out=Path(folder) / "m.safetensors")
        cost = time.process_time() - began
    known = {tuple(sorted(row.wanted.items())): row.coverage for row in flow.rows}
    rows = []
    for query in queries(spec.checked, reach(spec.checked, 0), seed)[0]:
        key = tuple(sorted(query.wanted.items()))
        if key in known:
            try:
                exact, phi = truth(spec.checked, query, 2 * SCENES, TRUTH)
            except RequestError:
                continue
            rows.append([known[key], level(model, query.wanted, exact, phi).made.coverage])
    return {"seed": seed, "seconds": [flow.cpu_seconds, cost], "coverage": rows}


def main(out: Path) -> None:
    found = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    with one_thread(), out.open("a") as file:
        for seed, flow in sorted(flows().items()):
            if seed in REPORT[::4] and seed not in {one["seed"] for one in found}:
                found.append(tuned(seed, flow))
                file.write(json.dumps(found[-1]) + "\n")
                file.flush()
    for one in found:
        anew, mine = np.mean(one["coverage"], axis=0)
        print(f"spec {one['seed']}: coverage {anew:.3f} anew, {mine:.3f} tuned; CPU seconds {one['seconds']}")
    means = np.array([np.mean(one["coverage"], axis=0) for one in found])
    print(f"mean coverage {means[:, 0].mean():.4f} anew, {means[:, 1].mean():.4f} tuned")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
