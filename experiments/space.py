"""What it takes to keep scenes: a look-up table, a network, or the spec."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.page import table
from experiments.plan import Plan
from experiments.problems import PROBLEMS
from experiments.report import Report, short
from experiments.trainings import trained
from experiments.variants import VARIANTS
from scenegen.api.sample import sample
from scenegen.pose import row_count
from scenegen.scenes.formats.registry import FORMATS

# experiment -> megabytes of the paper's look-up table and of its network
PAPER = {"exp1": (5_600.0, 0.5), "exp2": (28_400.0, 0.4)}
FLOAT = 4  # bytes
BARE = "float32, bare"


def run(plan: Plan) -> Report:
    """Files of scenes by format, models by kind, and the spec, for experiments 1 and 2."""
    facts = []
    for key in PAPER:
        problem = PROBLEMS[key]
        spec = problem.load()
        plan.tell(f"{problem.title}: weighing")
        found = trained(plan, problem)
        models = {one.name: found[one.name][0].size for one in VARIANTS if one.steps is None}
        scenes = sample(spec, dict.fromkeys(spec.labels, (None, None)), plan.sizes.exact, seed=0, workers=1)
        sizes = {BARE: float(FLOAT * (row_count(len(spec.objects)) + len(spec.labels)))}
        with tempfile.TemporaryDirectory() as folder:
            for ending in FORMATS:
                file = scenes.save(Path(folder) / f"scenes{ending}")
                sizes[ending] = file.stat().st_size / len(scenes)
        text = len(spec.source.encode())
        facts.append(
            {"problem": key, "bytes_per_scene": sizes, "models": models, "spec": text, "paper_mb": PAPER[key][0]}
        )
    return Report("space", "Space", tables(facts), {"problems": facts})


def tables(facts: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """What takes how much space, and how many bytes a scene takes in a file."""
    lines, against = [], []
    for found in facts:
        name = PROBLEMS[found["problem"]].title.split(" at ")[0]
        look_up, network = PAPER[found["problem"]]
        sizes, models, text = found["bytes_per_scene"], found["models"], found["spec"]
        lines += [[f"{name}, {kind}", f"{size:.1f}", short(look_up * 1e6 / size)] for kind, size in sizes.items()]
        bare = sizes[BARE]
        against.append([f"{name}: the paper's look-up table", f"{look_up:,.0f} MB", "-"])
        against.append(["the paper's network", f"{network:g} MB", short(network * 1e6 / bare)])
        against += [
            [f"{kind}, model file", f"{size / 1e6:.2f} MB", short(size / bare)] for kind, size in models.items()
        ]
        against.append(["the spec, which the exact sampler draws from", f"{text} bytes", short(text / bare)])
    return {
        "sizes": table(["", "size", "bare scenes in that space"], against),
        "files": table(["", "bytes a scene", "scenes in the paper's table"], lines),
    }
