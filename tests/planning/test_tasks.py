"""The starts of imported tasks: some that miss the goal by little, and some that meet it, without much work.

The files in tasks/ are our own, in the grammar of LIBERO; those of test_original.py and test_import.py are PDDL and
BEHAVIOR's."""

from pathlib import Path

import numpy as np
import pytest

import scenegen
from tests.planning.test_import import HOUSE, KITCHEN
from tests.planning.test_original import BLOCKS, DOMAIN, FORMULAS

TASKS = sorted((Path(__file__).parent / "tasks").glob("*.bddl"))
HOUSES = [
    "(exists (?c - cup.n.01) (under ?c table.n.02_1))",
    "(forn (1) (?c - cup.n.01) (ontop ?c table.n.02_1))",
    "(and (nextto cup.n.01_1 cup.n.01_2) (not (touching cup.n.01_1 cup.n.01_2)))",
]
TEXTS = {
    **{path.stem: path.read_text() for path in TASKS},
    **{f"blocks{number}": BLOCKS.replace("FORMULA", one) for number, one in enumerate(FORMULAS)},
    **{f"house{number}": HOUSE.replace("FORMULA", one) for number, one in enumerate(HOUSES)},
    **{f"kitchen_{one}": KITCHEN.replace("GOAL", one) for one in ("plate_1", "flat_stove_1_cook_region")},
}


def spec_of(name: str, folder: Path) -> scenegen.Spec:
    (folder / "task.bddl").write_text(TEXTS[name])
    (folder / "domain.pddl").write_text(DOMAIN)
    domain = folder / "domain.pddl" if name.startswith("blocks") else None
    return scenegen.parse(scenegen.import_problem(folder / "task.bddl", domain).text)


@pytest.mark.long
@pytest.mark.parametrize("name", list(TEXTS))
def test_starts_miss_the_goal_or_meet_it(name: str, tmp_path: Path) -> None:
    spec = spec_of(name, tmp_path)
    for low, high in ((-0.3, 0.0), (0.0, None)):
        scenes = scenegen.sample(spec, phi={"goal": (low, high)}, n=50, workers=1)
        phi = scenes.phi["goal"]
        assert len(phi) == 50 and phi.min() >= low and (high is None or phi.max() <= high)


@pytest.mark.long
@pytest.mark.parametrize(("name", "cells"), [("blocks2", 27), ("caddy", 27), ("stack_tray", 27), ("bowls_plate", 20)])
def test_a_cover_is_not_made_better_than_few_scenes_are_worth(name: str, cells: int, tmp_path: Path) -> None:
    """These took two to four times as long: their covers, of all cells or of rare ones, took so much work that growth
    was chosen."""
    scenes = scenegen.sample(spec_of(name, tmp_path), phi={"goal": (-0.3, 0.0)}, n=50, workers=1)
    told = scenes.header.sampler
    assert told["method"] == "rejection" and told["cells"]["reached"] >= cells, told
    share = np.histogram(scenes.phi["goal"], 32, (-0.3, 0.0))[0]
    assert share.max() == -(-50 // told["cells"]["reached"]) and (share > 0).sum() >= cells, (
        "evenly over what is reached"
    )
