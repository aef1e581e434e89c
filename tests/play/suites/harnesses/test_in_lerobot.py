"""A suite on a hub, loaded by LeRobot itself, and policies evaluated by LeRobot's own loop."""

import json
import os
import threading
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.play.suites.harnesses.envhub import write_envhub
from scenegen.play.suites.harnesses.groups import group_name
from scenegen.play.suites.harnesses.results import read_results
from scenegen.play.suites.report import report_suite
from scenegen.play.suites.suite import Suite

from . import worlds

pytestmark = pytest.mark.harnesses

WORLD, COMMIT = f"{worlds.__name__}:Forgetful", "0123456789" * 4
SMALL = Path(__file__).parents[4] / "tests" / "golden" / "play" / "suites" / "small"


class Hub(BaseHTTPRequestHandler):
    """A folder as the one repository of a hub, me/graded."""

    def __init__(self, folder, *given):
        self.folder = folder
        super().__init__(*given)

    def do_GET(self):
        name = self.path.rpartition("/")[2].partition("?")[0]
        file = self.folder / name
        if self.path.startswith("/api/"):
            names = [{"rfilename": one.name} for one in sorted(self.folder.iterdir())]
            data = json.dumps({"id": "me/graded", "sha": COMMIT, "siblings": names}).encode()
        elif "/resolve/" in self.path and file.is_file():
            data = file.read_bytes()
        else:
            self.send_error(404)
            return
        self.send_response(200)
        for key, value in (("ETag", f'"{name}"'), ("X-Repo-Commit", COMMIT), ("Content-Length", str(len(data)))):
            self.send_header(key, value)
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(data)

    do_HEAD = do_GET  # noqa: N815

    def log_message(self, *given):
        pass


@pytest.fixture(scope="module")
def lerobot(tmp_path_factory):
    """LeRobot's loop, and its loader with a hub that has the suite `small`."""
    pytest.importorskip("lerobot", reason="needs LeRobot: make test-harnesses installs it")
    folder, cache = tmp_path_factory.mktemp("hub") / "graded", tmp_path_factory.mktemp("cache")
    write_envhub(SMALL, folder, world=WORLD, steps=12)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Hub, folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    os.environ["HF_ENDPOINT"] = f"http://127.0.0.1:{server.server_port}"  # read when huggingface_hub is imported
    from lerobot.envs.factory import make_env
    from lerobot.scripts.lerobot_eval import eval_policy_all

    make = partial(make_env, "me/graded", hub_cache_dir=str(cache), trust_remote_code=True)
    yield SimpleNamespace(make=make, evaluate=eval_policy_all, cache=cache)
    server.shutdown()


@pytest.fixture
def stopping():
    """A policy that stops at random moments, and keeps what it has seen."""
    import torch
    from lerobot.configs.policies import PreTrainedConfig
    from lerobot.policies.pretrained import PreTrainedPolicy

    class Config(PreTrainedConfig):
        observation_delta_indices = action_delta_indices = reward_delta_indices = None
        get_optimizer_preset = get_scheduler_preset = validate_features = lambda self: None

    class Stopping(PreTrainedPolicy):
        config_class, name = Config, "stopping"
        get_optim_params = forward = predict_action_chunk = lambda self, *given: None

        def __init__(self):
            super().__init__(Config(device="cpu"))
            self.rng, self.seen = np.random.default_rng(5), []

        def reset(self):
            self.fresh = True

        def select_action(self, batch):
            if self.fresh:
                self.seen.append(batch)
            self.fresh, n = False, len(batch["task"])
            stops = (self.rng.random((n, 1)) < 0.2).astype(np.float32)
            return torch.from_numpy(np.hstack([self.rng.uniform(-1, 1, (n, 2)).astype(np.float32), stops]))

    return Stopping()


def same(batch):
    return batch


def evaluate(lerobot, envs, policy, n, seed=1000, **more):
    steps = {"env_preprocessor": same, "env_postprocessor": same, "preprocessor": same, "postprocessor": same}
    return lerobot.evaluate(envs, policy, n_episodes=n, start_seed=seed, **steps, **more)


@pytest.mark.parametrize("n", [1, 2, 3])
def test_every_start_is_evaluated_once_in_order(lerobot, stopping, small, n):
    """What the loop evaluates, episode i of a task, began with start i: poses are those of the suite bit for bit."""
    envs = lerobot.make(n_envs=n)
    begun, suite = [], Suite.load(small)
    group = group_name(suite)
    assert {name: list(some) for name, some in envs.items()} == {group: [0]}
    reset = envs[group][0].reset

    def note(**given):
        observation, info = reset(**given)
        begun.extend(zip(info["start"].tolist(), observation["environment_state"].copy(), strict=True))
        return observation, info

    envs[group][0].reset = note
    for seed in (1000, 1000, None if n == 1 else 7):  # LeRobot 0.4.4 wants seeds of several environments
        begun.clear()
        found = evaluate(lerobot, envs, stopping, 6, seed)
        assert found["overall"]["n_episodes"] == 6 and [number for number, _ in begun] == list(range(6))
        for start, (_, seen) in zip(suite, begun, strict=True):
            assert seen.tobytes() == start.poses.tobytes()
    assert stopping.seen[0]["task"] == [suite[0].task.instruction] * n
    assert stopping.seen[0]["observation.images.eye"].shape == (n, 3, 8, 8)


def test_the_hubs_files_are_those_of_the_suite(lerobot):
    lerobot.make()
    snapshot = lerobot.cache / "models--me--graded" / "snapshots" / COMMIT
    assert sorted(one.name for one in snapshot.iterdir() if one.name != "__pycache__") == [
        "beside.json",
        "beside.reverse.json",
        "env.py",
        "suite.json",
    ]


def test_success_and_videos_are_lerobots(lerobot, stopping, small, tmp_path):
    envs = lerobot.make(n_envs=2)
    stopping.select_action = lambda batch: -20.0 * batch["observation.environment_state"][:, :3]
    found = evaluate(lerobot, envs, stopping, 4, max_episodes_rendered=2, videos_dir=tmp_path)
    assert found["overall"]["pc_success"] == 100.0
    videos = tmp_path / f"{group_name(Suite.load(small))}_0"
    assert sorted(one.name for one in videos.iterdir()) == ["eval_episode_0.mp4", "eval_episode_1.mp4"]


@pytest.mark.parametrize("n", [1, 2, 4])
def test_what_lerobot_writes_are_our_outcomes(lerobot, stopping, small, tmp_path, n):
    """Success of start i is that of the episode that began there, also where the last environments are left over."""
    suite, envs, ended = Suite.load(small), lerobot.make(n_envs=n), {}
    vector = envs[group_name(suite)][0]
    reset, step = vector.reset, vector.step
    playing = {}  # by environment, the start of its last reset, until that has ended

    def note_reset(**given):
        observation, info = reset(**given)
        playing.update(enumerate(info["start"].tolist()))
        return observation, info

    def note_step(actions):
        *found, terminated, truncated, info = step(actions)
        for k in np.flatnonzero(terminated | truncated):
            if k in playing:  # what begins by itself then is thrown away
                ended.setdefault(playing.pop(k), bool(info["final_info"]["is_success"][k]))
        return *found, terminated, truncated, info

    vector.reset, vector.step = note_reset, note_step
    push = stopping.select_action
    stopping.select_action = lambda batch: (
        -20.0 * batch["observation.environment_state"][:, :3]
        if len(stopping.seen) % 2 and not stopping.fresh
        else push(batch)
    )
    for episodes in (6, 5):
        ended.clear()
        found = evaluate(lerobot, envs, stopping, episodes)
        file = tmp_path / "mine" / "eval_info.json"
        file.parent.mkdir(exist_ok=True)
        file.write_text(json.dumps(found, indent=2))  # as lerobot-eval does
        read = read_results(file, suite)
        assert {one.episode: one.success for one in read.episodes} == {start: ended[start] for start in range(episodes)}
        assert read.header.policy == "mine"
    assert "mine" in report_suite(small, [file], tmp_path / "report.md").read_text()
