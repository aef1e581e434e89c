"""What the parts of the model of any spec are worth: `python -m experiments.any.ablations OUT [--hours 0.3]`.

Each variety is trained by itself, with the same seeds and the same CPU time, and asked for the same phi on the first
specs that models are tuned on. OUT is a folder with what was trained and measured: a second call goes on with the
varieties and specs that are missing.
"""

from __future__ import annotations

import argparse
import json
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor

from experiments.any.report import FEWER, SHORT, named, rows
from experiments.any.specs import training_text
from experiments.any.stream import KNOWN, Stream
from experiments.any.train import begin, save, train
from scenegen.api.spec import Spec
from scenegen.learn.any import AnyModel
from scenegen.learn.models.graph import ROOT, FormulaGraph
from scenegen.learn.models.graph_flow import GraphHyper, Networks
from scenegen.processes.pool import one_thread

SPECS = 20
WHOLE = GraphHyper(primitives=KNOWN)
HALF = GraphHyper(width=45, chooser=34, primitives=KNOWN)


def bag(graph: FormulaGraph) -> FormulaGraph:
    """The graph without its minima and maxima: each atom is below its labels, and that is all."""
    kept = graph.junction_features[:, ROOT] > 0.0
    place = torch.cumsum(kept, 0) - 1
    below = graph.below[kept[graph.below[:, 1]]]
    return replace(
        graph,
        junction_features=graph.junction_features[kept],
        label_of=graph.label_of[kept],
        below=torch.stack([below[:, 0], place[below[:, 1]]], 1),
    )


def whole(graph: FormulaGraph) -> FormulaGraph:
    return graph


@dataclass(frozen=True, slots=True)
class Variety:
    """Networks of these sizes; what they see of a graph; whether they are told which atoms decide."""

    hyper: GraphHyper = WHOLE
    seen: Callable[[FormulaGraph], FormulaGraph] = whole
    branches: bool = True


VARIETIES = {
    "whole": Variety(),
    "bag of atoms": Variety(seen=bag),
    "no branches": Variety(branches=False),
    "half the size": Variety(HALF),
}


class Altered(Stream):
    """Batches as a variety sees them. Mutable, like what it alters."""

    def __init__(self, variety: Variety, begin: int) -> None:
        super().__init__(training_text, begin)
        self.variety = variety

    def batch(
        self, specs: int, scenes: int, choice: random.Random, generator: Generator
    ) -> tuple[FormulaGraph, Tensor, Tensor, Tensor]:
        graph, rows, wanted, deciders = super().batch(specs, scenes, choice, generator)
        told = deciders if self.variety.branches else torch.full_like(deciders, -1)
        return self.variety.seen(graph), rows, wanted, told


class Unbranched(Networks):
    """Networks that are not told which atoms decide."""

    def draw_branches(self, graph: FormulaGraph, wanted: Tensor, generator: Generator) -> Tensor:
        return torch.full(wanted.shape, -1)


def trained(variety: Variety, path: Path, hours: float) -> Networks:
    """The networks of a variety, trained so long, or as they were kept."""
    saved = torch.load(path, weights_only=True) if path.exists() else None
    if saved is None:
        run = begin(variety.hyper, 0, torch.device("cpu"), None)
        run.stream = Altered(variety, run.stream.next)
        for losses in train(run, 3600.0 * hours):
            print(f"{path.stem}, step {run.step:,}, {run.seconds:.0f} s: {losses}", flush=True)
        save(run, path)
        saved = run.state()
    made = (Networks if variety.branches else Unbranched)(variety.hyper)
    made.load_state_dict(saved["mean"], assign=True)
    return made


def model_of(spec: Spec, variety: Variety, networks: Networks) -> AnyModel:
    """The model of any spec, with these networks."""
    model = AnyModel(spec)
    network: Any = model.trained.model
    network.networks, network.graph = networks, variety.seen(network.graph)
    return model


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("out", type=Path)
    words.add_argument("--hours", type=float, default=0.3, help="of CPU time, for each variety")
    words.add_argument("--only", choices=VARIETIES, help="train this variety, and measure nothing")
    told = words.parse_args()
    told.out.mkdir(parents=True, exist_ok=True)
    kept = told.out / "rows.jsonl"
    found = [json.loads(line) for line in kept.read_text().splitlines()] if kept.exists() else []
    with one_thread():
        names = [told.only] if told.only else list(VARIETIES)
        made = {one: trained(VARIETIES[one], told.out / f"{one.replace(' ', '-')}.pt", told.hours) for one in names}
        made_by = {one: partial(model_of, variety=VARIETIES[one], networks=mine) for one, mine in made.items()}
        for name, source, seed in [] if told.only else list(named("tune"))[:SPECS]:
            if name not in {row["spec"] for row in found}:
                mine = list(rows(name, source, seed, FEWER, SHORT, made_by))
                found += mine
                with kept.open("a") as file:
                    file.write("".join(json.dumps(row) + "\n" for row in mine))
    for name, networks in made.items():
        of = [row for row in found if row.get("model") == name]
        if not of:
            continue
        coverage = np.array([row["coverage"] for row in of])
        off = np.array([max(row["ks"], row["sliced"]) for row in of])
        print(
            f"{name}: {sum(one.numel() for one in networks.parameters()):,} weights, {len(of)} targets; coverage "
            f"mean {coverage.mean():.3f}, worst decile {np.quantile(coverage, 0.1):.3f}, at least 0.93 in "
            f"{np.mean(coverage >= 0.93):.0%}; KS and sliced at most 0.15 in {np.mean(off <= 0.15):.0%}, median "
            f"{np.median(off):.3f}; phi of the network alone off by {np.median([row['alone'] for row in of]):.3f}"
        )


if __name__ == "__main__":
    main()
