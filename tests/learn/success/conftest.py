"""A small suite whose bands are halves of random starts, and outcomes of policies that are known."""

import hashlib
from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen.learn.success.files import BLANK_DIGEST
from scenegen.play.suites.outcomes import EpisodeOutcome, OutcomesHeader, dump_outcomes
from scenegen.play.suites.suite import SUITE_JSON, BandData, Suite, SuiteFile, TaskData

OWN = """object cube = box(5 cm, 4 cm, 4 cm), can, crate = box(20 cm, 20 cm, 10 cm)
require noOverlap()
goal: leftOf(cube, can) & closeTo(cube, can, 12 cm)
near: closeTo(cube, can, 30 cm)
"""
TASK = OWN + "require !goal\n"  # as a suite has it


def sigmoid(odds):
    return 1.0 / (1.0 + np.exp(-np.asarray(odds)))


POLICIES = {
    "by phi": lambda start: sigmoid(14.0 * (start.phi["goal"] + 0.4)),
    "by reach": lambda start: sigmoid(25.0 * (0.6 - np.hypot(start.poses[0, 0], start.poses[0, 1] - 0.5))),
    "by nothing": lambda start: 0.6,
    "never": lambda start: 0.0,
    "but for one": lambda start: float(start.number != 7),
}


def make_suite(folder, n=100, seed=3):
    """Starts of the task, half of them below the median of phi."""
    scenes = scenegen.sample(scenegen.parse(TASK), n=2 * n, seed=seed, spread="base")
    order = np.argsort(-scenes.phi["goal"])
    phi = scenes.phi["goal"][order]
    folder.mkdir()
    scenes[order].save(folder / "cube.json")
    ends = [(float(phi[n - 1]), 0.0), (float(phi[-1]), float(phi[n - 1]))]
    rare = np.log10((np.arange(2 * n)[::-1] + 1.0) / (2 * n))
    bands = [
        BandData(
            name=f"level{k + 1}", phi=ends[k], probability=0.5, error=0.0, log10p=rare[k * n : (k + 1) * n].tolist(),
            seeds=list(range(n)),
        )
        for k in (0, 1)
    ]  # fmt: skip
    checksum = hashlib.sha256((folder / "cube.json").read_bytes()).hexdigest()
    task = TaskData(
        name="cube", instruction="Put it there.", success="goal", scenes="cube.json", sha256=checksum, bands=bands
    )
    suite = SuiteFile(name="halves", digest=BLANK_DIGEST, seed=seed, n=n, tasks=[task])
    (folder / SUITE_JSON).write_bytes(suite.dump())
    return folder


def write_outcomes(path, suite, policy, seed=0, episodes=None, **header):
    suite, rng = Suite.load(suite), np.random.default_rng(seed)
    facts = {"world": "simulated", "policy": policy, **header}
    head = OutcomesHeader(suite=suite.name, digest=suite.digest, episodes=len(suite), **facts)
    ended = [
        EpisodeOutcome(
            episode=start.number, task=start.task.name, band=start.band, steps=9,
            success=bool(rng.random() < POLICIES[policy](start)),
        )
        for start in suite
    ]  # fmt: skip
    path.write_bytes(dump_outcomes(head, ended[:episodes]))
    return path


@pytest.fixture(scope="session")
def halves(tmp_path_factory) -> Path:
    return make_suite(tmp_path_factory.mktemp("suites") / "halves")


@pytest.fixture(scope="session")
def outcomes(halves, tmp_path_factory):
    """A function from a policy to its file of outcomes."""
    folder, made = tmp_path_factory.mktemp("outcomes"), {}

    def of(policy):
        if policy not in made:
            made[policy] = write_outcomes(folder / f"{policy.replace(' ', '_')}.jsonl", halves, policy)
        return made[policy]

    return of


@pytest.fixture(scope="session")
def fitted(halves, outcomes, tmp_path_factory):
    """A function from a policy to the file of its fit."""
    from scenegen.fit import fit_outcomes

    folder, made = tmp_path_factory.mktemp("fits"), {}

    def of(policy):
        if policy not in made:
            made[policy] = folder / f"{policy.replace(' ', '_')}.fit"
            fit_outcomes([outcomes(policy)], halves).save(made[policy])
        return made[policy]

    return of
