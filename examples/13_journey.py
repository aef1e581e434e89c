"""One request at each stop on its way from text to file, as docs/pipeline.md tells it: `13_journey.py [STOP]`."""

import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import scenegen
from scenegen.api.request import check_request
from scenegen.errors.diagnostic import Source
from scenegen.lang.checker import check
from scenegen.lang.formula.core import Atom
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax.parse import parse
from scenegen.sampling.plan import Plan
from scenegen.sampling.plans import plan_for
from scenegen.sampling.request import SampleRequest
from scenegen.search.effort import Budget

SOURCE = Source("mug.spec", "leftOf(mug, plate)")


def tree() -> None:
    print(parse(SOURCE).bare)


@cache
def checked() -> CheckedSpec:
    return check(SOURCE)


def core() -> None:
    for number, node in enumerate(checked().core.nodes):
        print(number, replace(node, spans=()) if isinstance(node, Atom) else node)


def phi() -> None:
    poses = np.array([[0.2, 0.5, 0.0], [0.6, 0.5, 0.0]])  # of the mug and the plate: x, y, theta
    print(scenegen.parse(SOURCE.text).scenes(poses[None]).phi)
    print(scenegen.parse(SOURCE.text).bounds())


@cache
def request() -> SampleRequest:
    return SampleRequest.parse({"phi": ["0:0.2"], "n": 4}, checked().labels)


@cache
def made() -> Plan:
    return plan_for(checked(), check_request(scenegen.parse(SOURCE.text), request()), Budget(60.0))


def plan() -> None:
    print(request().phi, request().n, request().seed)
    print(made().problem.cells.edges[0][:4], "...")
    print(f"{made().method}: {made().why}")


def piece() -> None:
    drawn = made().draw(0)
    print(drawn.rows.shape, drawn.phi.shape)
    print(drawn.rows[:, 0].round(3), drawn.phi[:, 0].round(3))


def file() -> None:
    scenes = scenegen.sample(scenegen.parse(SOURCE.text), (0.0, 0.2), n=4)
    print(scenes)
    with tempfile.TemporaryDirectory() as folder:
        path = scenes.save(Path(folder) / "scenes.jsonl")
        print(path.read_text().splitlines()[1])


STOPS: dict[str, Callable[[], None]] = {
    "tree": tree,
    "core": core,
    "phi": phi,
    "plan": plan,
    "piece": piece,
    "file": file,
}

if __name__ == "__main__":
    for stop in sys.argv[1:] or STOPS:
        STOPS[stop]()
