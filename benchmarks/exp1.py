"""Experiment 1 at (task, safe) = (0.19, 0.08): the GAN and the AAE, raw and refined, beside the paper's figures.

`make exp1` trains both models with the paper's settings (50 epochs, 20,000 uniform scenes) for three seeds and writes
docs/experiments/exp1.md. Six trainings take about five minutes on one core. Coverage is measured against fresh truth
from plain rejection, never against the training set; see scenegen.metrics.coverage.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from pathlib import Path

import numpy as np
import torch

import scenegen
from scenegen.metrics.coverage import coverage
from scenegen.metrics.errors import error_statistics
from scenegen.resources import shipped_specs
from scenegen.sampling.base import draw
from scenegen.sampling.refine import refine

WANTED = {"task": 0.19, "safe": 0.08}
BAND = 0.0125
SCENES = 5000
COVERED = 2000
SEEDS = (0, 1, 2)

# mean (std) of phi - wanted from the paper's table; mean absolute error, share within 0.025 and coverage as measured
# from the published weights (reference figures of the project)
KNOWN = """\
| paper, GAN | -0.007 (0.038) | 0.002 (0.035) | - | - | - |
| paper, AAE | -0.085 (0.003) | 0.117 (0.157) | - | - | - |
| published weights, GAN | - | - | 0.015; 0.034 | 0.25 | 0.09 |
| published weights, AAE | - | - | 0.097; 0.152 | 0.05 | 0.64 |"""


def rows_of(scenes: scenegen.SceneSet) -> np.ndarray:
    """(n, N, 3) poses as (3N, n) storage."""
    return scenes.poses.reshape(len(scenes), -1).T


def measure(spec: scenegen.Spec, rows: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """Error of phi against WANTED, and coverage of the truth, of scenes stored as (3N, n)."""
    phi = spec.robustness().rows(torch.from_numpy(np.ascontiguousarray(rows))).numpy()
    found = error_statistics(phi, np.array(list(WANTED.values())), spec.labels)
    values = {"within": found.within, "coverage": coverage(reference, rows[:, :COVERED])}
    for label, error in zip(spec.labels, found.labels, strict=True):
        values |= {f"{label} mean": error.mean, f"{label} std": error.std, f"{label} mae": error.mean_abs}
    return values


def refined(spec: scenegen.Spec, rows: np.ndarray) -> np.ndarray:
    """The scenes moved onto WANTED itself, all labels to within 1e-6."""
    start = torch.from_numpy(np.ascontiguousarray(rows, dtype=np.float64))
    target = torch.tensor(list(WANTED.values()), dtype=torch.float64)[:, None].expand(-1, start.shape[1])
    return refine(spec.robustness(), spec.workspace, start, target, target - 1e-6, target + 1e-6).numpy()


def line(name: str, runs: list[dict[str, float]]) -> str:
    """One row: the mean over the runs, and the smallest and largest where there are several."""

    def cell(key: str, digits: int) -> str:
        values = [run[key] for run in runs]
        text = f"{statistics.mean(values):.{digits}f}"
        return text if len(values) == 1 else f"{text} [{min(values):.{digits}f}, {max(values):.{digits}f}]"

    def both(label: str) -> str:
        mean, std = (statistics.mean(run[f"{label} {what}"] for run in runs) for what in ("mean", "std"))
        return f"{mean:+.3f} ({std:.3f})"

    mae = "; ".join(cell(f"{label} mae", 3) for label in WANTED)
    return f"| {name} | {both('task')} | {both('safe')} | {mae} | {cell('within', 2)} | {cell('coverage', 2)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--epochs", type=int, default=50)
    parser.add_argument("--out", type=Path, default=Path("docs/experiments/exp1.md"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    spec = scenegen.load(shipped_specs()["mug_left_of_plate"])
    band = {label: (value - BAND, value + BAND) for label, value in WANTED.items()}
    reference = rows_of(scenegen.sample(spec, band, COVERED, seed=99, spread="base"))
    truth = [rows_of(scenegen.sample(spec, band, SCENES, seed=100 + seed, spread="base")) for seed in SEEDS]
    table = [line("plain rejection in the band (the truth)", [measure(spec, rows, reference) for rows in truth])]
    chance = [draw(*spec.box(), SCENES, torch.Generator().manual_seed(seed)).numpy() for seed in SEEDS]
    table.append(
        line("uniform scenes, refined (no model)", [measure(spec, refined(spec, rows), reference) for rows in chance])
    )
    inside = handed = 0
    effect: list[str] = []
    for name in ("gan", "aae"):
        runs: dict[str, list[dict[str, float]]] = {
            "raw": [],
            "refined onto the point": [],
            "handed out for the band": [],
        }
        for seed in SEEDS:
            with tempfile.TemporaryDirectory() as folder:
                out = Path(folder) / f"{name}.safetensors"
                model = scenegen.train(spec, name, out=out, epochs=options.epochs, seed=seed)
            target = torch.tensor(list(WANTED.values()))[:, None].expand(-1, SCENES)
            raw = model.trained.propose(target, torch.Generator().manual_seed(1000 + seed)).double().numpy()
            scenes = scenegen.sample(model, band, SCENES, seed=seed)
            handed += len(scenes)
            inside += int(np.logical_and.reduce([abs(scenes.phi[k] - v) <= BAND for k, v in WANTED.items()]).sum())
            for kind, rows in zip(runs, (raw, refined(spec, raw), rows_of(scenes)), strict=True):
                runs[kind].append(measure(spec, rows, reference))
            print(
                name,
                seed,
                {kind: {k: round(v, 3) for k, v in run[-1].items()} for kind, run in runs.items()},
                flush=True,
            )
        raw_cover, fine_cover = (
            statistics.mean(run["coverage"] for run in runs[kind]) for kind in ("raw", "handed out for the band")
        )
        effect.append(f"{name.upper()} {raw_cover:.2f} raw, {fine_cover:.2f} handed out")
        table += [line(f"{name.upper()}, {kind}", found) for kind, found in runs.items()]
    text = f"""# Experiment 1 at (task, safe) = (0.19, 0.08)

Made by `make exp1`: {options.epochs} epochs, 20,000 uniform scenes, batch 32, lr 1e-3 (the paper's settings), seeds
{", ".join(map(str, SEEDS))}; {SCENES:,} scenes a row, coverage on {COVERED:,} against {COVERED:,} fresh scenes from
plain rejection with every |phi - wanted| < {BAND}. Ours are means over the seeds, with [smallest, largest].

| | task: mean (std) of phi - wanted | safe: mean (std) | mean abs. error, task; safe | both within 0.025 | coverage |
|---|---|---|---|---|---|
{KNOWN}
{chr(10).join(table)}

{inside:,} of {handed:,} handed-out scenes lie in the band that was asked for.

What refinement does to coverage: {"; ".join(effect)}.
It puts every scene on the target and spreads those of a diverse model over the thin band that its raw output misses;
what a collapsed model does not know, refinement does not find. The row without a model is the one to beat: uniform
scenes, moved onto the point, cover more than either network. Plain rejection from the spec has the truth's coverage by
construction.
"""
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
