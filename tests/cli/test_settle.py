"""`sample --settle`: scenes that stay put, counted by object where they do not."""

import json

import numpy as np

from scenegen.assets import shape_of
from scenegen.render.settle import settle_scenes

OVERLAPPING = "object mug, crackerbox\ntask: leftOf(mug, crackerbox) & closeTo(mug, crackerbox, 15 cm)\n"


def test_what_is_handed_out_settles(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    words = ["sample", "near.spec", "--phi", "0:", "-n", "12", "--seed", "4"]
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


def test_the_number_of_processes_changes_nothing(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    words = ["sample", "near.spec", "--phi", "0:0.03", "-n", "6", "--settle"]
    assert scenegen(*words, "--workers", "1", "--out", "one.jsonl").status == 0
    assert scenegen(*words, "--workers", "2", "--out", "two.jsonl").status == 0
    assert (here / "one.jsonl").read_bytes() == (here / "two.jsonl").read_bytes()
