"""Run a policy on a suite: every episode in a worker process, its outcome a line of a file.

An episode that fails costs itself alone: an exception is its outcome, and a process that dies or takes too long is
replaced by another one. What cannot work for any episode, such as a world that cannot be made, ends the run.
"""

from __future__ import annotations

import contextlib
import hashlib
import http.client
import inspect
import math
import pickle
import queue
import secrets
import time
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args
from urllib.parse import urlsplit

from scenegen.errors import DataError, RequestError, ScenegenError
from scenegen.errors.files import UNFINISHED_RUN
from scenegen.errors.program import PROCESS_DIED
from scenegen.errors.requests import OUT_OF_PLACE, UNKNOWN_CHOICE
from scenegen.errors.worlds import NOT_A_SUITE, WORLD_FAILS
from scenegen.learn.success.files import Instruction, OutcomesHeader
from scenegen.learn.success.statistics import decided_after
from scenegen.play.policy_server import decode, encode
from scenegen.play.suites.episodes import TaskEpisodes, check_steps, error_line, explain_failure
from scenegen.play.suites.loading import check_name, load_named, versions_of
from scenegen.play.suites.outcomes import (
    EpisodeOrder,
    EpisodeOutcome,
    SceneThatStood,
    check_same_run,
    dump_line,
    dump_outcomes,
    read_outcomes,
)
from scenegen.play.suites.suite import GradedStart, Suite
from scenegen.processes.pool import check_workers
from scenegen.processes.process import FAILED, GONE, WorkerMessage, WorkerProcess
from scenegen.scenes.files import check_writable, report_write_errors, target, write_whole
from scenegen.scenes.lock import lock_file
from scenegen.validation import as_path, as_seconds

PROCESS_START = 120.0  # seconds for a process to begin
SERVER_WAIT = 30.0  # seconds for a policy's server to come back, but at most half of those of an episode
Policy = Callable[[Any, str], Any]
Told = Callable[[EpisodeOutcome, int, int], None]  # an outcome, how many of how many there are


def run_suite(
    suite: Suite,
    out: str | Path,
    *,
    world: str,
    policy: str,
    instruction: Instruction = "own",
    episodes: Sequence[int] | None = None,
    order: EpisodeOrder | None = None,
    resume: bool = False,
    steps: int = 1000,
    timeout: float = 600.0,
    workers: int = 1,
    against: str | Path | None = None,
    told: Told = lambda outcome, done, count: None,
) -> Path:
    """Run episodes of a suite, by default all, and write their outcomes to a file, which is returned.

    `world` names a function of a task that returns an environment, `policy` a function of observation and instruction,
    a class, or a function of `env`, that makes one: "module:name" or "file.py:name", or a name such as "table" (see
    loading.py); a policy may also be the URL of a server (scenegen/play/policy_server.py). An episode ends where the
    environment says so, at success, or after so many steps. They begin task by task, or as `order` has them, which
    takes the place of `episodes`. `timeout`, in seconds, kills one that hangs. `resume` goes on with a file. `against`
    is the file of outcomes of another policy: of the starts in it as many are run, in an order drawn by lot, as show
    which of the two is better (`PairedDifference.is_decided`). Raises RequestError, DataError, OutputError, and
    ScenegenError where world or policy cannot be had at all.
    """
    out, timeout, steps = as_path("out", out), as_seconds("timeout", timeout), check_steps(steps)
    if instruction not in get_args(Instruction):
        raise RequestError(UNKNOWN_CHOICE(what="instruction", name=instruction, known=get_args(Instruction)))
    check_name("world", world)
    check_name("policy", policy)
    if order is not None and against is not None:
        rule, remedy = "is an order drawn by lot, which the test needs", "leave the order of yours out"
        raise RequestError(OUT_OF_PLACE(argument="against", rule=rule, remedy=remedy))
    numbers = list(episodes or range(len(suite)))
    other = None if against is None else _outcomes_to_compare(as_path("against", against), suite, numbers)
    if other is not None:
        turns = shuffle_episodes(suite.digest, other.keys() & numbers)
    elif order is not None:
        turns = list(order.trials)
    else:
        turns = sorted(numbers, key=lambda number: suite.tasks.index(suite[number].task))
    header = OutcomesHeader(
        suite=suite.name, digest=suite.digest, world=world, policy=policy, instruction=instruction,
        reverse=suite.reverse, episodes=len(suite), steps=steps, timeout=timeout, versions=versions_of(world),
        order=None if order is None else order.digest, blind=None if order is None else order.blind,
    )  # fmt: skip
    check_writable(out)
    whole = target(out)
    with lock_file(whole.with_name(f".{whole.name[:200]}.lock"), str(out)):
        found: list[EpisodeOutcome] = []
        if out.exists() and (before := read_outcomes(out, suite)).episodes:
            if not resume:
                raise RequestError(UNFINISHED_RUN(folder=out, outcomes=len(before.episodes)))
            check_same_run(out, before.header, header)
            header, found = before.header, list(before.episodes)
        success = {one.episode: one.success for one in found}
        todo = deque(number for number in turns if number not in success)
        count = len(todo)

        def is_decided() -> bool:
            return other is not None and decided_after(turns, success, other) is not None

        write_whole(out, dump_outcomes(header, found))
        job = Player(suite.folder, suite.reverse, world, policy, instruction == "empty", steps, timeout / 2.0)
        if is_decided():
            todo.clear()
        playing = _play_all(job, suite, todo, check_workers(workers), timeout)
        outcomes = playing if other is None else _in_order(playing, [*todo])
        with report_write_errors(out), out.open("ab") as file, contextlib.closing(playing):
            for done, outcome in enumerate(outcomes, 1):
                if order is not None:
                    outcome = outcome.model_copy(update={"trial": order.trials[outcome.episode]})
                file.write(dump_line(outcome))
                file.flush()
                found.append(outcome)
                success[outcome.episode] = outcome.success
                told(outcome, done, count)
                if is_decided():
                    break
        write_whole(out, dump_outcomes(header, found))
    return out


def _outcomes_to_compare(path: Path, suite: Suite, numbers: Collection[int]) -> dict[int, bool]:
    """Success by the number of the episode, from a file. Raises DataError where it has none of these episodes."""
    read = read_outcomes(path, suite)
    reason = ""
    if read.header.reverse != suite.reverse:
        reason = f"it is {'' if read.header.reverse else 'not '}of the reversed tasks"
    elif read.success.keys().isdisjoint(numbers):
        reason = "it has none of these episodes"
    if reason:
        raise DataError(NOT_A_SUITE(file=path, what="a file to compare this run with", reason=reason))
    return read.success


def _in_order(outcomes: Iterable[EpisodeOutcome], order: Iterable[int]) -> Iterator[EpisodeOutcome]:
    """Outcomes in an order of their episodes, each as soon as all before it are there: those that come early are rather
    successes, and a file that a kill leaves has the same episodes as one of a single worker."""
    early: dict[int, EpisodeOutcome] = {}
    coming = iter(outcomes)
    for number in order:
        while number not in early:
            outcome = next(coming)
            early[outcome.episode] = outcome
        yield early.pop(number)


def shuffle_episodes(digest: str, numbers: Iterable[int]) -> list[int]:
    """Episodes of a suite, by its digest, in an order that is drawn by lot once for all: with tasks one after the other
    a policy that is better in the first of them would seem better in all."""
    return sorted(numbers, key=lambda number: hashlib.sha256(f"{digest} {number}".encode()).digest())


def _play_all(
    job: Player, suite: Suite, todo: deque[int], workers: int, timeout: float
) -> Generator[EpisodeOutcome, None, None]:
    """The outcomes of some episodes, as they come; those of processes that die, too."""
    data = pickle.dumps(job)
    inbox: queue.SimpleQueue[WorkerMessage] = queue.SimpleQueue()
    turns: dict[WorkerProcess, int | None] = {}  # what each does
    until: dict[WorkerProcess, float] = {}

    def fail(worker: WorkerProcess, why: str) -> EpisodeOutcome:
        output, number = worker.end(), turns.pop(worker)
        if number is None:
            remedy = "run it by itself"
            raise ScenegenError(PROCESS_DIED(what="a policy's process", how=why, remedy=remedy, said=output))
        return _outcome(suite[number], False, 0, f"its process {why}")

    try:
        while todo or any(number is not None for number in turns.values()):
            while len(turns) < workers and len(todo) > sum(number is None for number in turns.values()):
                worker = WorkerProcess("a policy's process", data, inbox)
                turns[worker], until[worker] = None, time.monotonic() + PROCESS_START
            for worker, number in turns.items():
                if worker.ready and number is None and todo:
                    turns[worker], until[worker] = todo.popleft(), time.monotonic() + timeout
                    worker.order(0, turns[worker])
            waiting = [worker for worker, number in turns.items() if number is not None or not worker.ready]
            try:
                message = inbox.get(timeout=max(0.0, min(until[worker] for worker in waiting) - time.monotonic()))
            except queue.Empty:
                late = [worker for worker in waiting if until[worker] <= time.monotonic()]
                yield from [fail(worker, f"took more than {timeout:g} s") for worker in late]
                continue
            worker = message.worker
            if worker not in turns:
                continue  # it was late
            if message.status == GONE:
                status = worker.process.wait()
                yield fail(worker, f"ended with status {status}" if status >= 0 else f"was killed by signal {-status}")
            elif message.status == FAILED:
                raise message.value
            elif message.ready:
                worker.ready = True
            else:
                turns[worker] = None
                yield message.value
    finally:
        for worker in turns:
            worker.end()


def _outcome(
    start: GradedStart, success: bool, steps: int, error: str | None = None, scene: SceneThatStood | None = None
) -> EpisodeOutcome:
    return EpisodeOutcome(
        episode=start.number, task=start.task.name, band=start.band, success=success, steps=steps, error=error,
        scene=scene,
    )  # fmt: skip


@dataclass(slots=True)
class Player:
    """The job of an episode, by its number. It runs in a worker process, with one environment for a task, and one
    policy; a policy's server has `wait` seconds to begin it."""

    folder: Path
    reverse: bool
    world: str
    policy: str
    empty: bool
    most: int
    wait: float = math.inf
    suite: Suite | None = None
    episodes: TaskEpisodes | None = None
    act: Any = None

    def __call__(self, number: int) -> EpisodeOutcome:
        self.suite = self.suite or Suite.load(self.folder, reverse=self.reverse)
        start = self.suite[number]
        episodes = self._prepare(start)
        try:
            self._play(episodes, start)
        except ScenegenError:
            raise
        except Exception as error:
            self._drop()  # nobody knows what state they are in
            return _outcome(start, False, episodes.steps, error_line(error), episodes.scene)
        return _outcome(start, episodes.success, episodes.steps, scene=episodes.scene)

    def _prepare(self, start: GradedStart) -> TaskEpisodes:
        """The environment of the start's task, with a policy for it. Raises ScenegenError."""
        if self.episodes is not None and self.episodes.task is start.task:
            return self.episodes
        self._drop()
        self.episodes = episodes = TaskEpisodes(self.world, start.task, self.most, self.suite)
        try:
            self.act = load_policy(self.policy, episodes.env, self.wait)
        except Exception as error:
            self._drop()
            raise explain_failure("the policy", self.policy, error) from error
        return episodes

    def _drop(self) -> None:
        if self.episodes is not None:
            self.episodes.close()
        self.episodes = self.act = None

    def _play(self, episodes: TaskEpisodes, start: GradedStart) -> None:
        episodes.begin(start)
        if hasattr(self.act, "reset"):
            self.act.reset(start.seed)
        while not episodes.ended:
            episodes.step(self.act(episodes.observation, "" if self.empty else start.task.instruction))


def load_policy(text: str, env: Any, wait: float = math.inf) -> Policy:
    """A policy by its name or URL: classes, and functions of `env` alone, make it. Raises what they raise."""
    if text.startswith("http://"):
        return RemotePolicy(text, wait)
    return make_policy(load_named("policy", text), env)


def make_policy(policy: Any, env: Any) -> Policy:
    """A policy as it is, or made: by a class, or by a function of `env` alone."""
    parameters = list(inspect.signature(policy).parameters)
    if isinstance(policy, type) or parameters == ["env"]:
        policy = policy(env) if "env" in parameters else policy()
    acting: Policy = policy
    return acting


class RemotePolicy:
    """A policy behind a server (scenegen/play/policy_server.py). `reset` waits SERVER_WAIT seconds, or `most` if that
    is less, for one that is restarted, and `most` for its answer. Raises ScenegenError where none comes, and where the
    server is in an episode of another client."""

    def __init__(self, url: str, most: float = math.inf) -> None:
        where = urlsplit(url)
        self._url, self._path, self._most, self._wait = url, where.path.rstrip("/"), most, min(SERVER_WAIT, most)
        self._link, self._me = http.client.HTTPConnection(where.netloc, timeout=self._wait), secrets.token_hex(8)

    def reset(self, seed: int) -> None:
        until = time.monotonic() + self._wait
        while True:
            try:
                self._ask("/reset", {"seed": seed}, self._most)
                return
            except (OSError, http.client.HTTPException) as error:
                if time.monotonic() > until:
                    raise self._failure("does not answer", str(error) or type(error).__name__) from error
                time.sleep(0.2)

    def __call__(self, observation: Any, instruction: str) -> Any:
        return self._ask("/act", {"observation": observation, "instruction": instruction}, math.inf)["action"]

    def _ask(self, path: str, given: dict[str, Any], timeout: float) -> Any:
        try:
            if self._link.sock is None:
                self._link.connect()
            self._link.sock.settimeout(timeout if timeout < math.inf else None)
            data = encode({**given, "client": self._me})
            self._link.request("POST", self._path + path, data, {"content-type": "application/json"})
            response = self._link.getresponse()
            try:
                answer = dict(decode(response.read()))
            except (TypeError, ValueError):  # of a proxy, or of a server of another kind
                raise http.client.HTTPException(f"status {response.status} and no JSON object") from None
        except BaseException:
            self._link.close()  # the next request opens it again
            raise
        if "busy" in answer:
            raise self._failure("serves another client", answer["busy"])
        if "error" in answer:
            raise RuntimeError(answer["error"])
        return answer

    def _failure(self, how: str, reason: str) -> ScenegenError:
        return ScenegenError(WORLD_FAILS(what="the policy", name=self._url, how=how, reason=reason))
