"""`scenegen libero`: start states of LIBERO's tasks, by its own judgement."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli import options
from scenegen.cli.many import JobMessages, shared_work
from scenegen.cli.options import WORKERS, argument, option
from scenegen.cli.output import print_error

if TYPE_CHECKING:
    from scenegen.play.libero.files import LiberoTask, StatesJob


def libero(
    name: str = argument("A suite, such as libero_spatial, the name of a task, or a BDDL file.", "SUITE|TASK"),
    out: Path = option("The folder of the states, which is LIBERO's home then.", "DIR", default=...),
    phi: list[str] | None = option(
        "Wanted phi of goal, start or visible: NAME=LO:HI; default: starts that miss the goal.", "NAME=LO:HI"
    ),
    n: int = option("How many states of each task.", "N", flags="-n", default=50),
    seed: int = option("The same seed gives the same states.", "SEED", default=0),
    settle: float = option("Seconds to come to rest in, at most.", "SECONDS", default=1.0, parser=options.seconds),
    workers: int | None = WORKERS,
) -> int:
    """Make states of LIBERO's tasks at a chosen phi, at rest, and judged by LIBERO itself.

    \b
      scenegen libero libero_spatial --phi goal=-0.3:0 --out starts
      scenegen libero libero_goal --phi goal=0: --out solved
      scenegen libero libero_object --phi visible=0.25:0.35 --out hidden
      LIBERO_CONFIG_PATH=starts python evaluate.py

    The spec is made from the task's own environment. A state is kept if nothing moves in it, and if LIBERO finds the
    goal solved where phi >= 0, and nowhere else, at once and after 20 steps, wherever a reset may put the fixtures; of
    starts that miss also if the initial facts hold, to 1 cm.

    phi of visible is the share of what the goal moves that LIBERO's camera agentview sees; a state has it by what the
    camera's picture shows. Then, and where phi of start may be below 0, what the goal moves stands anywhere.

    DIR gets init_files/SUITE/TASK.pruned_init and .pruned_init.npz, the specs, a report of each task, and config.yaml,
    by which LIBERO and LeRobot find the states. What was made by the same request before is not made again. A task with
    too few states is named with the reasons, the others are made, and the exit status is 1.
    """
    from scenegen.play.libero.files import SPEC_LABELS, StatesJob, tasks_of, write_home
    from scenegen.sampling.request import parse_phi

    parse_phi(phi or (), SPEC_LABELS)
    tasks = tasks_of(name)
    home = write_home(out)
    job = _TaskJob(StatesJob(out, tuple(phi or ()), n, seed, settle))
    status = shared_work(job, [(one.name, one) for one in tasks], "local", workers, None, "tasks")
    print_error(f"states of {len(tasks)} tasks in {out}; LIBERO reads them with LIBERO_CONFIG_PATH={home.parent}")
    return status


@dataclass(frozen=True, slots=True)
class _TaskJob:
    """The job of one task among several."""

    states: StatesJob

    def __call__(self, task: LiberoTask) -> JobMessages:
        return JobMessages((self.states(task),))
