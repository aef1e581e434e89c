"""What it takes to keep scenes: a look-up table, a network, or the spec."""

from __future__ import annotations

import tempfile
from pathlib import Path

from experiments.page import table
from experiments.plan import Plan
from experiments.problems import PROBLEMS
from experiments.report import Report, short
from experiments.trainings import trained
from experiments.variants import VARIANTS
from scenegen.api.sample import sample
from scenegen.formats.table import FORMATS

# experiment -> megabytes of the paper's look-up table and of its network
PAPER = {"exp1": (5_600.0, 0.5), "exp2": (28_400.0, 0.4)}
FLOAT = 4  # bytes


def run(plan: Plan) -> Report:
    """Files of scenes by format, models by kind, and the spec, for experiments 1 and 2."""
    lines, against, facts = [], [], []
    for key, (look_up, network) in PAPER.items():
        problem = PROBLEMS[key]
        spec = problem.load()
        plan.tell(f"{problem.title}: weighing")
        found = trained(plan, problem)
        models = {one.name: found[one.name][0].size for one in VARIANTS if one.steps is None}
        scenes = sample(spec, dict.fromkeys(spec.labels, (None, None)), plan.sizes.exact, seed=0, workers=1)
        numbers = 3 * len(spec.objects) + len(spec.labels)
        sizes = {"float32, bare": float(FLOAT * numbers)}
        with tempfile.TemporaryDirectory() as folder:
            for ending in FORMATS:
                file = scenes.save(Path(folder) / f"scenes{ending}")
                sizes[ending] = file.stat().st_size / len(scenes)
        text = len(spec.source.encode())
        for name, size in sizes.items():
            of_paper = look_up * 1e6 / size
            lines.append([f"{problem.title.split(' at ')[0]}, {name}", f"{size:.1f}", short(of_paper)])
        bare = sizes["float32, bare"]
        against.append([f"{problem.title.split(' at ')[0]}: the paper's look-up table", f"{look_up:,.0f} MB", "-"])
        against.append(["the paper's network", f"{network:g} MB", short(network * 1e6 / bare)])
        against += [
            [f"{name}, model file", f"{size / 1e6:.2f} MB", short(size / bare)] for name, size in models.items()
        ]
        against.append(["the spec, which the exact sampler draws from", f"{text} bytes", short(text / bare)])
        facts.append({"problem": key, "bytes_per_scene": sizes, "models": models, "spec": text, "paper_mb": look_up})
    blocks = {
        "sizes": table(["", "size", "bare scenes in that space"], against),
        "files": table(["", "bytes a scene", "scenes in the paper's table"], lines),
    }
    return Report("space", "Space", blocks, {"problems": facts})
