"""States of all 130 tasks of LIBERO, one line of JSON a task; what is there already is left out.

    python -m experiments.libero OUT.jsonl --states 50 [--only REGEX]
    python -m experiments.libero OUT.jsonl --states 10 --lot 53 # ten tasks by lot that put something on or in a fixture
    python -m experiments.libero OUT.jsonl --states 5 --lost experiments/libero.jsonl # tasks whose states failed
    python -m experiments.libero OUT.jsonl --table # by suite; with --lot or --lost, how the states hold elsewhere

The first states of each request are then judged as LIBERO's evaluation does, in an environment of LIBERO's own class
with its defaults (but for cameras): each after another seed and a reset, which puts the fixtures elsewhere in their
regions, by `set_init_state`, and after 20 steps without an action. With --seeds 4 there are four such resets, and all
states are judged after each. With --exact they are set by `set_scene`, and are states of the scene as it is.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import logging
import os
import random
import re
import signal
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.libero import SettledStates, set_scene
from scenegen.play.libero.files import LIBERO_SUITES, LiberoTask, make_environment, tasks_of
from scenegen.play.libero.measure import LiveModel

REQUESTS: dict[str, Any] = {"miss": None, "solved": {"goal": (0.0, None)}}


def measure(task: LiberoTask, given: argparse.Namespace) -> dict[str, Any]:
    """One task: what was made, and what a fresh environment says of it."""
    from scenegen.libero import init_states, spec_of

    states, seed, requests = given.states, given.seed, given.request
    begun = time.time()
    env = make_environment(task, seed)
    own = spec_of(env, anywhere=not given.exact)
    line: dict[str, Any] = {"imports": True, "spec_s": round(time.time() - begun, 2)}
    made = {}
    for name in requests:
        wanted = REQUESTS[name]
        begun, used = time.time(), time.process_time()
        try:
            made[name] = found = init_states(env, wanted, states, spec=own, seed=seed)
        except Exception as error:
            line[name] = {"n": 0, "error": str(error).splitlines()[0][:300], "seconds": round(time.time() - begun, 1)}
            continue
        line[name] = {
            "n": len(found.states),
            "moved": round(float(found.moved.max(initial=0.0)), 6),
            "drawn": found.drawn,
            "judged": found.judged,
            "agreed": found.agreed,
            "refused": dict(found.refused),
            "seconds": round(time.time() - begun, 1),
            "cpu_s": round(time.process_time() - used, 1),
            "phi": [round(float(end), 5) for end in np.sort(found.phi["goal"])[[0, -1]]] if len(found.states) else [],
        }
    if not given.anew:
        return line
    env.close()
    begun = time.time()
    for name, found in made.items():
        line[name] |= judge(task, found, given)
    line["judge_s"] = round(time.time() - begun, 1)
    return line


def judge(task: LiberoTask, found: SettledStates, given: argparse.Namespace) -> dict[str, Any]:
    """What LIBERO's evaluation sees: success at once and after 20 steps, the initial facts then, and what moved."""
    from libero.libero.envs.env_wrapper import ControlEnv

    folder = tempfile.TemporaryDirectory()
    file = found.save(Path(folder.name) / "task.pruned_init") if given.exact else None
    count = min(given.anew, len(found.states))
    rows, together = list(range(count)) * (given.seeds or 1), count if given.seeds else 1

    with contextlib.redirect_stdout(io.StringIO()):
        env = ControlEnv(bddl_file_name=str(task.file), use_camera_obs=False, has_offscreen_renderer=False)
    problem = env.env.parsed_problem
    zones = {name: one["ranges"] for name, one in problem["regions"].items() if one["ranges"]}
    first, last, kept, moved = [], [], [], []
    for number, row in enumerate(rows):
        with contextlib.redirect_stdout(io.StringIO()):
            if number % together == 0:
                env.seed(given.seed + 1 + number)
                env.reset()
                live = LiveModel(env)
            env.set_init_state(found.states[row]) if file is None else set_scene(env, file, row)
            before = {name: live.data.xpos[body].copy() for name, body in live.things.items()}
            first.append(bool(env.check_success()))
            for _ in range(20):
                env.env.timestep, env.env.done = 0, False
                env.step([0.0] * 6 + [-1.0])
        last.append(bool(env.check_success()))
        moved.append(
            max(float(np.linalg.norm(live.data.xpos[live.things[name]] - before[name])) for name in live.movers)
        )
        held = []
        for fact in problem["initial_state"]:
            if fact[0] in ("on", "in") and fact[1] in live.movers:
                if fact[2] in zones:
                    x, y, _ = live.data.xpos[live.things[fact[1]]] - np.array(env.env.workspace_offset)
                    held.append(
                        any(
                            min(a, c) - 0.01 <= x <= max(a, c) + 0.01 and min(b, d) - 0.01 <= y <= max(b, d) + 0.01
                            for a, b, c, d in zones[fact[2]]
                        )
                    )
                else:
                    held.append(bool(env.env._eval_predicate(fact)))
        kept.append(all(held))
    env.close()
    folder.cleanup()
    return {"anew": {"n": len(rows), "at_once": sum(first), "after": sum(last), "facts": sum(kept), "moved": moved}}


def by_lot(seed: int, count: int) -> list[LiberoTask]:
    """Tasks that put something on or in a fixture, drawn by lot from those of all suites."""
    from libero.libero.envs.bddl_utils import robosuite_parse_problem

    found = []
    for task in (task for suite in LIBERO_SUITES for task in tasks_of(suite)):
        with contextlib.redirect_stdout(io.StringIO()):
            problem = robosuite_parse_problem(str(task.file))
        fixtures = {name for names in problem["fixtures"].values() for name in names}
        sites = {name for name, one in problem["regions"].items() if not one["ranges"] and one["target"] in fixtures}
        if any(fact[0].lower() in ("on", "in") and fact[-1] in sites for fact in problem["goal_state"]):
            found.append(task)
    print(f"{len(found)} tasks put something on or in a fixture")
    return random.Random(seed).sample(found, count)


def lost(recorded: Path) -> list[LiberoTask]:
    """The tasks of a file of ours some of whose states were not judged the same after other resets."""
    lines = [json.loads(line) for line in recorded.read_text().splitlines()]
    solved = [(one, one["solved"]["anew"]) for one in lines]
    missed = [(one, one["miss"]["anew"]) for one in lines]
    names = {(one["suite"], one["task"]) for one, anew in solved if min(anew["at_once"], anew["after"]) < anew["n"]}
    names |= {(one["suite"], one["task"]) for one, anew in missed if max(anew["at_once"], anew["after"]) > 0}
    print(f"{len(names)} tasks of {recorded} have states that did not hold elsewhere")
    return [task for suite in LIBERO_SUITES for task in tasks_of(suite) if (task.suite, task.name) in names]


def elsewhere(lines: list[dict[str, Any]]) -> None:
    """Prints how the solved states and the starts of each task hold where fixtures stand elsewhere."""
    print("| task | solved | at once | after 20 steps | starts | miss at once | miss after | facts hold | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|")
    rows = []
    for one in lines:
        empty = dict.fromkeys(("n", "at_once", "after", "facts"), 0)
        solved, miss = (one.get(name, {}).get("anew") or empty for name in ("solved", "miss"))
        rows.append([solved["n"], solved["at_once"], solved["after"], miss["n"]])
        rows[-1] += [miss["n"] - miss["at_once"], miss["n"] - miss["after"], miss["facts"]]
        rows[-1].append(round(sum(one.get(name, {}).get("cpu_s", 0) for name in REQUESTS), 1))
        print(f"| {one['task']} | {' | '.join(map(str, rows[-1]))} |")
    print(f"| all | {' | '.join(f'{sum(column):g}' for column in zip(*rows, strict=True))} |")


def table(lines: list[dict[str, Any]], states: int) -> None:
    """Prints a row for each suite, and what became of the scenes of tasks with too few states."""
    print("| suite | tasks | with all | starts / scenes | solved / scenes | agree | moved, mm | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    short = [one for one in lines if any(one.get(name, {}).get("n", 0) < states for name in REQUESTS)]
    for suite in (*LIBERO_SUITES, "all"):
        mine = [one for one in lines if suite in (one["suite"], "all")]
        cells = [suite, len(mine), sum(one not in short for one in mine)]
        cells += [
            "{:,} / {:,}".format(*(sum(one[name][key] for one in mine) for key in ("n", "drawn"))) for name in REQUESTS
        ]
        agreed, judged = (sum(one[name][key] for one in mine for name in REQUESTS) for key in ("agreed", "judged"))
        most = max(one[name]["moved"] for one in mine for name in REQUESTS)
        cells += [f"{agreed:,} / {judged:,} ({agreed / judged:.1%})", f"{1e3 * most:.1f}"]
        cells.append(f"{sum(one[name]['seconds'] for one in mine for name in REQUESTS):,.0f}")
        print(f"| {' | '.join(map(str, cells))} |")
    for one in short:
        print(one["suite"], one["task"], {name: (one[name]["n"], one[name]["refused"]) for name in REQUESTS})


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("out", type=Path)
    reader.add_argument("--states", type=int, default=50)
    reader.add_argument("--seed", type=int, default=0)
    reader.add_argument("--request", choices=list(REQUESTS), nargs="+", default=list(REQUESTS))
    reader.add_argument("--only", default="", help="a regular expression for SUITE/TASK")
    reader.add_argument("--anew", type=int, default=10, help="states of each request to judge after other resets")
    reader.add_argument("--lot", type=int, help="a seed: only tasks drawn by lot that put something on or in a fixture")
    reader.add_argument("--tasks", type=int, default=10, help="how many of these")
    reader.add_argument("--lost", type=Path, help="a file of ours: only its tasks whose states did not hold elsewhere")
    reader.add_argument("--seeds", type=int, default=0, help="resets, after each of which all these states are judged")
    reader.add_argument("--exact", action="store_true", help="states of the scene as it is, by set_scene")
    reader.add_argument("--limit", type=int, default=1800, help="seconds for a task")
    reader.add_argument("--table", action="store_true")
    given = reader.parse_args()
    if given.table:
        lines = [json.loads(line) for line in given.out.read_text().splitlines()]
        table(lines, given.states) if given.lot is None and given.lost is None else elsewhere(lines)
        return
    import libero.libero.envs.env_wrapper  # noqa: F401 - once, before the processes

    warnings.filterwarnings("ignore")
    logging.disable(logging.CRITICAL)
    done = set()
    if given.out.exists():
        done = {(one["suite"], one["task"]) for one in map(json.loads, given.out.read_text().splitlines())}
    tasks = [task for suite in LIBERO_SUITES for task in tasks_of(suite)]
    if given.lost is not None:
        tasks = lost(given.lost)
    elif given.lot is not None:
        tasks = by_lot(given.lot, given.tasks)
    for task in tasks:
        line: dict[str, Any] = {"suite": task.suite, "task": task.name}
        if tuple(line.values()) in done or not re.search(given.only, "/".join(line.values())):
            continue
        worker = os.fork()  # environments do not give all their memory back
        if worker == 0:
            signal.alarm(given.limit)
            _task(given.out, line, task, given)
            os._exit(0)
        _, status = os.waitpid(worker, 0)
        if status:
            _write(given.out, {**line, "error": f"status {status} after {given.limit} s or less"})


def _task(out: Path, line: dict[str, Any], task: LiberoTask, given: argparse.Namespace) -> None:
    begun = time.time()
    try:
        line |= measure(task, given)
    except Exception as error:
        line |= {"error": f"{type(error).__name__}: {error}"[:400], "trace": traceback.format_exc()[-500:]}
    _write(out, {**line, "total_s": round(time.time() - begun, 1)})


def _write(out: Path, line: dict[str, Any]) -> None:
    with out.open("a") as lines:
        lines.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main()
