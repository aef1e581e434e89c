"""Many independent jobs on a cluster: the bytes of this machine; and data sets in the hands of hubs' libraries."""

import hashlib
import subprocess
import sys

import pytest

pytestmark = pytest.mark.cluster

# a cluster of the test's own, whatever else runs on this machine
ENGINES = {"local": ("--workers", "2"), "ray": ("--engine", "ray", "--address", "local")}
RUN = (sys.executable, "-m", "scenegen")
SPECS = {"left": "task: leftOf(mug, plate)\n", "bad": "leftof(mug", "near": "task: closeTo(mug, plate, 30 cm)\n"}


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in SPECS.items():
        (tmp_path / f"{name}.spec").write_text(text)
    return tmp_path


def run(*words):
    return subprocess.run([*RUN, *words], capture_output=True, text=True)


def digests(folder):
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix != ".train"
    }


@pytest.mark.parametrize(
    "words",
    [
        ("dataset", "left.spec", "bad.spec", "near.spec", "-n", "6000"),
        ("train", "left.spec", "bad.spec", "near.spec", "--epochs", "1", "--scenes", "512", "--no-card"),
    ],
    ids=["dataset", "train"],
)
def test_jobs_of_a_cluster(words, ray, here):
    """A bad job is named, the others give the same files as on this machine."""
    for engine, options in ENGINES.items():
        done = run(*words, "--out", f"{engine}/", *options)
        assert done.returncode == 1 and "bad failed:\n" in done.stderr, done.stderr
    assert digests(here / "ray") == digests(here / "local") and len(digests(here / "ray")) >= 2


def test_verified_on_a_cluster(ray, here):
    assert run("sample", "left.spec", "-n", "140000", "--shard-size", "65536", "--out", "set/", "-q").returncode == 0
    words = ("data", "set/", "--verify", "--timeout", "0", *ENGINES["ray"])
    done = run(*words)
    assert done.returncode == 0 and "3 of 3 shards, by checksums and phi of every scene" in done.stdout, done.stderr
    file = here / "set/part-000001.parquet"
    file.write_bytes(file.read_bytes()[:-1] + b"x")
    done = run(*words)
    assert done.returncode == 1 and "part-000001.parquet" in done.stderr


def test_loaded_as_hubs_do(here):
    """The top folder by its card's configurations, and one set by its files."""
    datasets = pytest.importorskip("datasets", reason="needs datasets: make test-cluster installs it")
    assert run("dataset", "left.spec", "near.spec", "-n", "2000", "--license", "mit", "--out", "data/").returncode == 0
    one = datasets.load_dataset("parquet", data_files="data/near/part-*.parquet", split="train", cache_dir="cache")
    assert one.num_rows == 1000 and {"mug.x", "plate.theta", "phi.task", "log10p.task"} <= set(one.column_names)
    assert sum(value >= 0.0 for value in one["phi.task"]) >= 500
    assert datasets.get_dataset_config_names("data/") == ["left", "near"]
    left = datasets.load_dataset("data/", "left", split="train", cache_dir="cache")
    assert left.num_rows == 1000
