"""Write the weights that come with the package: `python -m experiments.any.ship STATE [REPORT.jsonl]`.

STATE is of experiments.any.train, REPORT of experiments.any.report for the specs that are reported on.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import torch

from experiments.any.report import figures
from scenegen.learn.models.checkpoint import pack
from scenegen.learn.models.graph_flow import WEIGHTS, WEIGHTS_FORMAT, GraphHyper, WeightsCard
from scenegen.scenes.files import write_whole


def main(path: Path, report: Path | None) -> None:
    state = torch.load(path, weights_only=True)
    rows = [] if report is None else [json.loads(line) for line in report.read_text().splitlines()]
    card = WeightsCard(
        hyper={**state["hyper"], "steps": GraphHyper().steps},
        seed=state["seed"],
        steps=state["step"],
        specs=state["next"],
        cpu_hours=round(state["seconds"] / 3600.0, 2),
        figures=figures(rows) if rows else {},
    )
    write_whole(WEIGHTS, pack(WEIGHTS_FORMAT, card.model_dump_json(), state["mean"]))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
