"""States of all 130 tasks of LIBERO, one line of JSON a task; what is there already is left out.

    python -m experiments.libero OUT.jsonl --states 50 [--only REGEX]
    python -m experiments.libero OUT.jsonl --table # what there is, by suite

The first states of each request are then judged in another environment, too, with another seed, whose reset puts
the fixtures elsewhere in their regions: by LIBERO's `set_init_state`, and after 20 steps of its own.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import logging
import os
import re
import signal
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.worlds.libero.files import SUITES, LiberoTask, make_environment, tasks_of

REQUESTS: dict[str, Any] = {"miss": None, "solved": {"goal": (0.0, None)}}


def measure(task: LiberoTask, states: int, seed: int, anew: int) -> dict[str, Any]:
    """One task: what was made, and what a fresh environment says of it."""
    from scenegen.libero import init_states, spec_of

    begun = time.time()
    env = make_environment(task, seed)
    own = spec_of(env)
    line: dict[str, Any] = {"imports": True, "spec_s": round(time.time() - begun, 2)}
    made = {}
    for name, wanted in REQUESTS.items():
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
            "phi": [round(float(end), 5) for end in (np.min(found.phi["goal"]), np.max(found.phi["goal"]))],
        }
    if not anew:
        return line
    env.close()
    begun = time.time()
    env = make_environment(task, seed + 1)
    for name, found in made.items():
        line[name] |= judge(env, found.states[:anew])
    line["judge_s"] = round(time.time() - begun, 1)
    return line


def judge(env: Any, states: Any) -> dict[str, Any]:
    """What LIBERO's evaluation sees: success at once and after 20 steps, the initial facts then, and what moved."""
    from scenegen.libero import spec_of

    live = spec_of(env).live
    problem = env.env.parsed_problem
    zones = {name: one["ranges"] for name, one in problem["regions"].items() if one["ranges"]}
    first, last, kept, moved = [], [], [], []
    for state in states:
        with contextlib.redirect_stdout(io.StringIO()):
            env.env.timestep, env.env.done = 0, False
            env.set_init_state(state)
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
    return {"anew": {"n": len(states), "at_once": sum(first), "after": sum(last), "facts": sum(kept), "moved": moved}}


def table(lines: list[dict[str, Any]], states: int) -> None:
    """Prints a row for each suite, and what became of the scenes of tasks with too few states."""
    print("| suite | tasks | with all | starts / scenes | solved / scenes | agree | moved, mm | seconds |")
    print("|---|---|---|---|---|---|---|---|")
    short = [one for one in lines if any(one.get(name, {}).get("n", 0) < states for name in REQUESTS)]
    for suite in (*SUITES, "all"):
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
    reader.add_argument("--only", default="", help="a regular expression for SUITE/TASK")
    reader.add_argument("--anew", type=int, default=10, help="states of each request to judge in another environment")
    reader.add_argument("--limit", type=int, default=1800, help="seconds for a task")
    reader.add_argument("--table", action="store_true")
    given = reader.parse_args()
    if given.table:
        table([json.loads(line) for line in given.out.read_text().splitlines()], given.states)
        return
    import libero.libero.envs.env_wrapper  # noqa: F401 - once, before the processes

    warnings.filterwarnings("ignore")
    logging.disable(logging.CRITICAL)
    done = set()
    if given.out.exists():
        done = {(one["suite"], one["task"]) for one in map(json.loads, given.out.read_text().splitlines())}
    for task in (task for suite in SUITES for task in tasks_of(suite)):
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
        line |= measure(task, given.states, given.seed, given.anew)
    except Exception as error:
        line |= {"error": f"{type(error).__name__}: {error}"[:400], "trace": traceback.format_exc()[-500:]}
    _write(out, {**line, "total_s": round(time.time() - begun, 1)})


def _write(out: Path, line: dict[str, Any]) -> None:
    with out.open("a") as lines:
        lines.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main()
