"""Every format of scene files goes in and out of the commands."""

from pathlib import Path

import pytest

from scenegen.formats.registry import FORMATS

WANTED = ["--phi", "0:0.2", "-n", "3", "--seed", "5"]


@pytest.mark.parametrize("ending", FORMATS)
def test_sample_and_eval(ending, scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", "all.json").status == 0
    sampled = scenegen("sample", "good.spec", *WANTED, "--out", f"x{ending}")
    assert sampled.status == 0 and "3 scenes (rejection" in sampled.err
    evaluated = scenegen("eval", "good.spec", f"x{ending}")
    assert evaluated.status == 0 and evaluated.err == ""
    assert evaluated.out == scenegen("eval", "good.spec", "all.json").out and len(evaluated.out.splitlines()) == 4


@pytest.mark.long
@pytest.mark.parametrize("ending", FORMATS)
def test_render(ending, scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", f"x{ending}").status == 0
    assert scenegen("render", f"x{ending}", "--out", "pictures", "--size", "32x24", "--workers", "1").status == 0
    assert len(list(Path("pictures").glob("scene_*_top.png"))) == 3


@pytest.mark.parametrize("ending", FORMATS)
def test_noise(ending, scenegen, here):
    Path(f"x{ending}").write_bytes(b"\x00noise\xff" * 10)
    refused = scenegen("eval", "good.spec", f"x{ending}")
    assert refused.status == 1 and refused.out == "" and refused.err.startswith("error[") and "help: " in refused.err
