"""Policies on a toy world: outcomes, errors, processes that die, runs that go on, a policy behind a server."""

import json
import os
import signal
import socket
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import numpy as np
import pytest
import torch

import scenegen
from scenegen.errors import DataError, OutputError, RequestError, ScenegenError
from scenegen.errors.files import OTHER_REQUEST, SET_IN_USE, UNFINISHED_RUN
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.errors.worlds import NOT_A_SUITE, WORLD_FAILS
from scenegen.learn.success import statistics
from scenegen.learn.success.statistics import decided_after
from scenegen.play.policy_server import decode, encode, server_of
from scenegen.play.suites import run as running
from scenegen.play.suites.episodes import explain_failure
from scenegen.play.suites.loading import versions_of
from scenegen.play.suites.outcomes import EpisodeOutcome, read_outcomes
from scenegen.play.suites.run import Player, RemotePolicy, run_suite, shuffle_episodes
from scenegen.play.suites.suite import Suite
from scenegen.scenes.lock import lock_file

from . import toy

TOY = Path(toy.__file__)
WORLD = f"{TOY}:make"


def player(small, policy, world="make", **more):
    return Player(small, more.get("reverse", False), f"{TOY}:{world}", policy, more.get("empty", False), 30)


def test_episodes_are_played_on_their_starts(small):
    steps = [player(small, f"{TOY}:towards")(number) for number in range(6)]
    suite = Suite.load(small)
    assert [one.episode for one in steps] == list(range(6)) and all(one.success for one in steps)
    for start, one in zip(suite, steps, strict=True):
        assert one.steps == pytest.approx(-start.phi["goal"] / 0.01, abs=1.0) and one.band == start.band


def test_what_makes_a_policy(small):
    """A function of env is given it, and a class is made; seeds begin episodes."""
    assert player(small, f"{TOY}:seeing")(0).steps == 7
    seeds = [start.seed % 2 == 1 for start in Suite.load(small)]
    noisy = player(small, f"{TOY}:Noisy")
    assert [noisy(number).success for number in (0, 1, 2, 3)] == seeds[:4]


def test_without_an_instruction_and_in_reverse(small):
    assert player(small, f"{TOY}:obedient")(0).success
    empty = player(small, f"{TOY}:obedient", empty=True)(0)
    assert (empty.success, empty.steps) == (False, 30)
    back = player(small, f"{TOY}:away", reverse=True)(0)
    assert back.success and back.task == "beside"


def test_an_exception_is_an_outcome_and_the_next_episode_is_played(small):
    one = player(small, f"{TOY}:dying")
    assert one(1).error == "ValueError: no plan" and one(0).success


@pytest.mark.parametrize(
    "world, policy",
    [
        ("broken", f"{TOY}:towards"),
        ("unjudged", f"{TOY}:towards"),
        ("make", f"{TOY}:nobody"),
        ("make", "no.such.module:act"),
    ],
)
def test_what_can_never_work_ends_the_run(small, world, policy):
    with pytest.raises(ScenegenError) as caught:
        player(small, policy, world)(0)
    assert caught.value.diagnostics[0].kind == WORLD_FAILS


def test_a_world_whose_package_is_missing_says_what_to_install():
    wanted = RequestError(NOT_INSTALLED(package="robosuite", purpose="for a table", command="pip install robosuite"))
    assert explain_failure("the world", "table", wanted) is wanted


@pytest.mark.long
def test_a_run_that_ends_once_it_is_decided(small, tmp_path, monkeypatch):
    """At evidence of 2, which three starts give: the first three of an order drawn by lot, whatever the workers."""
    monkeypatch.setattr(statistics, "ALPHA", 0.5)
    suite, how = Suite.load(small), {"world": WORLD, "steps": 30}
    bad = run_suite(suite, tmp_path / "bad.jsonl", policy=f"{TOY}:away", **how)
    played: list[int] = []

    def note(outcome, done, count):
        played.append(outcome.episode)

    def run(policy, name, **more):
        played.clear()
        return run_suite(suite, tmp_path / name, policy=f"{TOY}:{policy}", against=bad, told=note, **how, **more)

    good = run("towards", "good.jsonl")
    order = shuffle_episodes(suite.digest, range(6))
    assert played == order[:3] and sorted(read_outcomes(good).success) == sorted(played)
    before = good.read_bytes()
    assert run("towards", "good.jsonl", resume=True).read_bytes() == before and not played
    assert run("towards", "two.jsonl", workers=2).read_bytes() == before
    run_suite(suite, good, policy=f"{TOY}:towards", resume=True, **how)
    whole = good.read_bytes()
    assert run("towards", "good.jsonl", resume=True).read_bytes() == whole  # what was there stays there
    run("away", "same.jsonl")
    assert played == order
    back = Suite.load(small, reverse=True)
    for where, episodes, reason in ((back, None, "not of the reversed tasks"), (suite, order[3:], "none of these")):
        with pytest.raises(DataError, match=reason) as caught:
            three = tmp_path / "two.jsonl"
            run_suite(where, tmp_path / "x.jsonl", policy=f"{TOY}:away", against=three, episodes=episodes, **how)
        assert caught.value.diagnostics[0].kind is NOT_A_SUITE


def test_outcomes_wait_for_those_before_them():
    """Those that ended early are handed on with the one that they waited for, not before."""
    taken = []

    def coming():
        for number in (4, 2, 7, 9, 1):
            taken.append(number)
            yield EpisodeOutcome(episode=number, task="t", band="b", success=True, steps=1)

    handed = [(one.episode, len(taken)) for one in running._in_order(coming(), [2, 7, 1, 4])]
    assert handed == [(2, 2), (7, 3), (1, 5), (4, 5)]


def test_policies_that_are_better_in_different_tasks():
    """One is better in the first half of the tasks, the other in the second: over 400 orders of 500 starts one of them
    seems better in at most 5 %, and in every one that takes task after task."""
    first = {number: number < 250 for number in range(500)}
    second = {number: not good for number, good in first.items()}
    orders = [shuffle_episodes(f"{digest:064x}", range(500)) for digest in range(400)]
    assert np.mean([decided_after(order, first, second) is not None for order in orders]) <= 0.05
    assert decided_after(range(500), first, second) == 7


@pytest.mark.parametrize(
    "said, success",
    [
        *((True, True), (np.bool_(0), False), (1, True), (0.0, False), (np.array([[True]]), True)),
        *((np.float32(1), True), (None, False), (torch.tensor(True), True), (torch.tensor([0]), False)),
    ],
)
@pytest.mark.parametrize("when", ["step", "reset"])
def test_judgements(small, monkeypatch, said, success, when):
    monkeypatch.setattr(toy.Judging, "said", (said, False) if when == "step" else (False, said))
    found = Player(small, False, f"{toy.__name__}:judging", f"{TOY}:towards", False, 3)(0)
    assert (found.success, found.error) == (success, None)
    assert found.steps == {("step", True): 1, ("reset", True): 0}.get((when, success), 3)


@pytest.mark.parametrize("said", [np.nan, 0.3, "False", "", [], np.array([True, True]), {}, 2, torch.tensor([0.5])])
@pytest.mark.parametrize("when", ["step", "reset"])
def test_what_is_no_judgement_ends_the_run(small, monkeypatch, said, when):
    monkeypatch.setattr(toy.Judging, "said", (said, False) if when == "step" else (False, said))
    with pytest.raises(ScenegenError) as caught:
        Player(small, False, f"{toy.__name__}:judging", f"{TOY}:towards", False, 3)(0)
    (wrong,) = caught.value.diagnostics
    assert wrong.kind == WORLD_FAILS and "does not judge" in wrong.title


def test_what_travels_to_a_policy(tmp_path):
    image = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)[:, ::-1]
    value = {"image": image, "state": {"q": np.float32(0.1), "at": np.array([1.5, np.nan])}, "words": ["a", None, 2]}
    found = decode(encode(value))
    assert found["words"] == value["words"] and np.array_equal(found["image"], image)
    assert found["state"]["q"] == np.float32(0.1) and np.array_equal(
        found["state"]["at"], [1.5, np.nan], equal_nan=True
    )
    with pytest.raises(TypeError):
        encode({"object": np.array([object()])})
    with pytest.raises(ValueError):
        decode(b'{"__array__": "AAAA", "dtype": "O", "shape": [1]}')


@pytest.fixture
def served():
    class Served:
        def __init__(self):
            self.seeds, self.threads = [], set()

        def reset(self, seed):
            self.threads.add(threading.get_ident())
            self.seeds.append(seed)

        def __call__(self, observation, instruction):
            if observation["number"] == 1:
                raise ValueError("no plan")
            return toy.towards(observation, instruction)

    policy = Served()
    server = server_of(policy, 0)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    yield policy, f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_policy_behind_a_server(small, served):
    policy, url = served
    here, there = player(small, f"{TOY}:towards"), player(small, url)
    assert [there(number) for number in (0, 2)] == [here(number) for number in (0, 2)]
    assert policy.seeds == [Suite.load(small)[number].seed for number in (0, 2)]
    assert there(1).error == "RuntimeError: ValueError: no plan" and there(3).success


def test_a_silent_client_does_not_hold_the_others(served):
    host, port = served[1].removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as one, socket.create_connection((host, int(port))) as other:
        other.sendall(b"POST /act HTTP/1.1\r\ncontent-length: 99\r\n\r\n{")  # and then no more
        policy = RemotePolicy(served[1], 5.0)
        policy.reset(3)
        assert policy({"number": 0, "a": np.array([0.0, 1.0])}, "").tolist() == [0.0, -0.01] and one


def test_a_policy_acts_in_the_thread_that_serves(served):
    """What frameworks keep for each thread, such as torch's grad mode, is as it was where `serve` was called."""
    policy, url = served
    for _ in range(2):
        RemotePolicy(url).reset(0)
    assert len(policy.threads) == 1


def test_an_episode_of_another_client_is_not_mixed_in(served):
    """Of a policy that remembers its episode; other programs, which name no client, may do as they like."""
    policy, seen = RemotePolicy(served[1]), {"number": 0, "a": np.array([0.0, 1.0])}
    policy.reset(3)
    RemotePolicy(served[1]).reset(4)
    with pytest.raises(ScenegenError, match="serves another client"):
        policy(seen, "")
    policy.reset(5)
    assert policy(seen, "").tolist() == [0.0, -0.01]
    unnamed = RemotePolicy(served[1])
    unnamed._me = None
    assert unnamed(seen, "").tolist() == [0.0, -0.01]


def test_another_path_of_a_server_is_an_error(served):
    with pytest.raises(RuntimeError, match="there are /reset and /act here, not /v1/reset"):
        RemotePolicy(f"{served[1]}/v1/").reset(0)


def test_numbers_of_steps_that_are_none(small, tmp_path):
    for steps in (0, -3, 2.5):
        with pytest.raises(RequestError):
            run_suite(Suite.load(small), tmp_path / "o.jsonl", world=WORLD, policy=WORLD, steps=steps)
    assert not [*tmp_path.iterdir()]


def test_a_second_run_in_the_same_file_is_refused(small, tmp_path):
    """Whatever link it is named by; what is there stays as it is."""
    out, link = tmp_path / "o.jsonl", tmp_path / "link.jsonl"
    link.symlink_to(out)
    with lock_file(tmp_path / ".o.jsonl.lock", "o.jsonl"):
        for path in (out, link):
            with pytest.raises(OutputError) as caught:
                run_suite(Suite.load(small), path, world=WORLD, policy=WORLD, resume=True)
            (wrong,) = caught.value.diagnostics
            assert wrong.kind == SET_IN_USE and str(path) in wrong.title and not out.exists()


def test_versions_are_told():
    found = versions_of("scenegen.play.suites.adapters.table:make")
    assert found["scenegen"] == scenegen.__version__ and {*found} <= {"scenegen", "robosuite"}
    assert {*versions_of("numpy.of.a.world:make")} == {"scenegen", "numpy"}
    assert {*versions_of("numpy.py:make")} == {*versions_of("no.such.package:make")} == {"scenegen"}


@pytest.mark.parametrize("argument, text", [("policy", "https://localhost"), ("world", "http://localhost:80")])
def test_names_that_are_none(small, tmp_path, argument, text):
    with pytest.raises(RequestError) as caught:
        run_suite(Suite.load(small), tmp_path / "o.jsonl", **{"world": WORLD, "policy": WORLD, argument: text})
    assert text in str(caught.value) and ("http://HOST:PORT" in str(caught.value)) == (argument == "policy")


@pytest.fixture
def silent():
    """The address of a server that takes connections and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"127.0.0.1:{server.getsockname()[1]}"


@pytest.fixture
def foreign():
    """That of a server of another kind, which answers with a page."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            self.rfile.read(int(self.headers["content-length"]))
            self.send_response(502)
            self.end_headers()
            self.wfile.write(b"<html>bad gateway</html>")

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield f"127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


@pytest.mark.parametrize("place", ["127.0.0.1:9", "no-such-host.invalid", "silent", "foreign"])
def test_a_server_that_never_answers_ends_the_run(place, request):
    where = request.getfixturevalue(place) if place in ("silent", "foreign") else place
    with pytest.raises(ScenegenError) as caught:
        RemotePolicy(f"http://{where}", 0.2).reset(0)
    (wrong,) = caught.value.diagnostics
    assert wrong.kind == WORLD_FAILS and "does not answer" in wrong.title


def test_a_server_is_waited_for_half_of_an_episode():
    waits = [RemotePolicy("http://localhost", most)._wait for most in (2.5, 300.0)]
    assert waits == [2.5, running.SERVER_WAIT]


@pytest.mark.long
def test_a_policy_that_dies_costs_one_episode(small, tmp_path):
    def run(out, policy, **more):
        path = run_suite(Suite.load(small), tmp_path / out, world=WORLD, policy=f"{TOY}:{policy}", steps=30, **more)
        return read_outcomes(path).episodes

    well = run("well.jsonl", "towards")
    for workers in (1, 2):
        found = run(f"{workers}.jsonl", "dying", workers=workers, timeout=8.0)
        assert {one.episode: one.error for one in found if one.error} == {
            1: "ValueError: no plan",
            2: "its process ended with status 3",
            4: "its process took more than 8 s",
        }
        assert [one for one in found if not one.error] == [one for one in well if one.episode in (0, 3, 5)]
    assert (tmp_path / "1.jsonl").read_bytes() == (tmp_path / "2.jsonl").read_bytes()


@pytest.mark.long
def test_a_run_goes_on(small, tmp_path):
    suite = Suite.load(small)
    given = {"world": WORLD, "policy": f"{TOY}:Noisy", "steps": 30}
    whole = run_suite(suite, tmp_path / "whole.jsonl", **given).read_bytes()
    out = run_suite(suite, tmp_path / "part.jsonl", episodes=suite.part(4), **given)
    with pytest.raises(RequestError) as caught:
        run_suite(suite, out, **given)
    assert caught.value.diagnostics[0].kind == UNFINISHED_RUN
    out.write_bytes(out.read_bytes() + b'{"episode": 0, "task": "bes')  # killed in the midst of a line
    run_suite(suite, out, resume=True, **given)
    assert out.read_bytes() == whole
    assert not out.with_name(".part.jsonl.lock").exists()
    for key, other in (("policy", f"{TOY}:towards"), ("steps", 31), ("timeout", 9.0)):
        with pytest.raises(RequestError) as caught:
            run_suite(suite, out, resume=True, **{**given, key: other})
        assert caught.value.diagnostics[0].kind == OTHER_REQUEST and caught.value.diagnostics[0].facts["key"] == key
    head, *rest = whole.splitlines(keepends=True)
    old = {key: one for key, one in json.loads(head).items() if key not in ("steps", "timeout", "versions")}
    out.write_bytes(json.dumps(old).encode() + b"\n" + b"".join(rest[:3]))
    run_suite(suite, out, resume=True, **given)
    assert out.read_bytes() == json.dumps(old).encode() + b"\n" + b"".join(rest)


@pytest.mark.long
def test_a_killed_run_keeps_what_it_has(small, tmp_path, interruptible):
    suite, out = Suite.load(small), tmp_path / "out.jsonl"

    def told(outcome, done, count):
        if done == 3:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run_suite(suite, out, world=WORLD, policy=f"{TOY}:towards", steps=30, told=told)
    assert len(read_outcomes(out).episodes) == 3


def test_files_are_no_other_modules(small, tmp_path):
    """A policy in a file called random.py, with a module beside it."""
    (tmp_path / "beside_it.py").write_text("GAIN = 0.5\n")
    policy = (
        "import beside_it\n\ndef policy(observation, instruction):\n    return -beside_it.GAIN * observation['a'][:2]\n"
    )
    (tmp_path / "random.py").write_text(policy)
    assert player(small, f"{tmp_path}/random.py:policy")(0).success
