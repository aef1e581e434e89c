"""`sample --settle`: scenes that stay put, counted by object where they do not."""

import json

import numpy as np
import pytest

from scenegen.things import shape_of
from tests.physics.drops import settle_scenes

OVERLAPPING = "object mug, crackerbox\ntask: leftOf(mug, crackerbox) & closeTo(mug, crackerbox, 15 cm)\n"


def test_what_is_handed_out_settles(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    words = ["sample", "near.spec", "--phi", "0:", "-n", "6", "--seed", "4"]
    assert scenegen(*words, "--out", "any.json").status == 0
    outcome = scenegen(*words, "--settle", "--out", "still.json")
    assert outcome.status == 0
    assert "scenes did not settle: " in outcome.err and "`mug` moved in " in outcome.err
    kept = {}
    for name in ("any", "still"):
        data = json.loads((here / f"{name}.json").read_text())
        poses = [[list(scene["poses"][one].values()) for one in ("mug", "crackerbox")] for scene in data["scenes"]]
        kept[name] = settle_scenes([shape_of("mug"), shape_of("crackerbox")], np.array(poses), workers=1).kept
        assert data["sampler"].get("settled", False) == (name == "still")
    assert kept["still"].all() and not kept["any"].all()


@pytest.mark.long
def test_the_number_of_processes_changes_nothing(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    words = ["sample", "near.spec", "--phi", "0:0.03", "-n", "6", "--settle"]
    assert scenegen(*words, "--workers", "1", "--out", "one.jsonl").status == 0
    assert scenegen(*words, "--workers", "2", "--out", "two.jsonl").status == 0
    assert (here / "one.jsonl").read_bytes() == (here / "two.jsonl").read_bytes()


def test_what_stands_in_a_tray_settles(scenegen, here):
    """Specs that declare heights: bodies have their own pieces, so that a can is in the tray, not on top of it."""
    (here / "carried.spec").write_text("object tray at (0.5, 0.5), can on tray\ntask: leftOf(can, tray)\n")
    words = ["sample", "carried.spec", "--settle", "-n", "3", "--workers", "1", "--out", "kept.json"]
    assert scenegen(*words).status == 0
    assert json.loads((here / "kept.json").read_text())["sampler"]["settled"]


def test_settle_counts_in_its_last_line(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    assert scenegen("sample", "near.spec", "--phi", "0:", "-n", "6", "--seed", "4", "--out", "any.json").status == 0
    words = ["settle", "any.json", "--in", "pybullet", "--seconds", "0.2", "--workers", "1"]
    outcome = scenegen(*words, "--max-shift", "5 mm", "--max-turn", "0.05rad", "--out", "rest.jsonl")
    assert outcome.status == 0, outcome.err
    header, *lines = map(json.loads, (here / "rest.jsonl").read_text().splitlines())
    good = sum(line["settled"] for line in lines)
    assert len(lines) == 6 and good < 6
    assert (header["max_shift_mm"], round(header["max_turn_deg"], 6)) == (5.0, 2.864789)
    last = outcome.err.splitlines()[-1]
    assert last.startswith(f"{good} of 6 scenes settled (pybullet, 0.2 s); in {6 - good} an object moved too far: ")
    wrong = scenegen(*words, "--max-shift", "5", "--out", "other.jsonl")
    assert wrong.status == 1 and "a length with its unit" in wrong.err and not (here / "other.jsonl").exists()
    over = scenegen(*words, "--out", "any.json")
    assert over.status == 1 and "any.json" in over.err
