"""Sets of scenes in the hands of numpy, torch, pandas and polars."""

import sys

import numpy as np
import pandas
import polars
import pytest
import torch

import scenegen


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse("object mug, block[2]\ntask: leftOf(mug, block[1])\nsafe: farFrom(mug, block[2])")


@pytest.fixture(scope="module")
def scenes(spec):
    return scenegen.sample(spec, {"task": (0.1, 0.3), "safe": (0.0, None)}, n=9, seed=2)


COLUMNS = [f"{name}.{axis}" for name in ("mug", "block[1]", "block[2]") for axis in ("x", "y", "theta")]
COLUMNS += ["phi.task", "phi.safe"]


def test_numpy(scenes):
    poses, phi = scenes.to_numpy()
    assert np.array_equal(poses, scenes.poses) and phi.shape == (9, 2)
    assert np.array_equal(phi[:, 1], scenes.phi["safe"])
    poses[:], phi[:] = 0.0, 0.0
    assert scenes.poses.any() and scenes.phi["safe"].any(), "these are copies"


def test_torch(scenes, spec):
    poses, phi = scenes.to_torch()
    assert poses.dtype == phi.dtype == torch.float64
    torch.testing.assert_close(spec.robustness()(poses), phi, rtol=0, atol=1e-12)
    poses, phi = scenes.to_torch(torch.float32, "cpu")
    assert poses.dtype == phi.dtype == torch.float32 and poses.shape == (9, 3, 3) and phi.shape == (9, 2)
    assert scenes[:0].to_torch()[1].shape == (0, 2)


def test_pandas(scenes):
    frame = scenes.to_pandas()
    assert list(frame.columns) == COLUMNS and len(frame) == 9
    assert np.array_equal(frame["block[2].y"], scenes.poses[:, 2, 1])
    assert frame[frame["phi.task"] > 0.2].index.tolist() == np.flatnonzero(scenes.phi["task"] > 0.2).tolist()
    assert list(scenes[:0].to_pandas().columns) == COLUMNS


def test_parquet_is_the_same_table_to_pandas_and_polars(scenes, tmp_path):
    path = scenes.save(tmp_path / "s.parquet")
    pandas.testing.assert_frame_equal(pandas.read_parquet(path), scenes.to_pandas(), check_exact=True)
    table = polars.read_parquet(path)
    assert table.columns == COLUMNS and np.array_equal(table.to_numpy(), scenes.to_pandas().to_numpy())
    assert (
        polars.scan_parquet(path).filter(polars.col("phi.task") > 0.2).collect().height
        == (scenes.phi["task"] > 0.2).sum()
    )


def test_without_pandas(scenes, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(scenegen.RequestError, match="and is not installed") as caught:
        scenes.to_pandas()
    assert caught.value.diagnostics[0].help == "pip install pandas"


def test_columns_that_would_share_a_name():
    scenes = scenegen.sample(scenegen.parse("object phi, mug\nx: leftOf(phi, mug)"), n=1)
    with pytest.raises(scenegen.OutputError, match=r"`phi\.x`"):
        scenes.to_pandas()


def test_parts(scenes):
    some = scenes[2:5]
    assert isinstance(some, scenegen.SceneSet) and len(some) == 3 and list(some) == list(scenes)[2:5]
    good = scenes[scenes.phi["task"] > 0.2]
    assert len(good) == (scenes.phi["task"] > 0.2).sum() and (good.phi["task"] > 0.2).all()
    order = np.argsort(scenes.phi["task"])
    assert np.array_equal(scenes[order].phi["task"], np.sort(scenes.phi["task"]))
    assert scenes[np.int64(3)] == scenes[3] and scenes[[3]][0] == scenes[3] and len(scenes[[]]) == 0
