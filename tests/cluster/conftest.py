"""A Ray cluster of several nodes on this machine, and an object store: both end with the tests."""

import os
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


def free_port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def add_node(cluster, cores, tries=3):
    """A node, which does not wait until its agents have found ports: that takes too long on a busy machine. Ray gives
    up after half a minute."""
    ports = ("metrics_agent_port", "metrics_export_port", "dashboard_agent_listen_port", "runtime_env_agent_port")
    try:
        return cluster.add_node(
            num_cpus=cores, object_store_memory=300 << 20, include_dashboard=False, include_log_monitor=False,
            **{name: free_port() for name in ports},
        )  # fmt: skip
    except Exception:  # Ray has no type for it
        if tries == 1:
            raise
        return add_node(cluster, cores, tries - 1)


@pytest.fixture(scope="session")
def ray():
    return pytest.importorskip("ray", reason="needs Ray: make test-cluster installs it")


@pytest.fixture
def cluster(ray, server, monkeypatch):
    """A head without cores of its own, and two nodes of two cores each."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("AWS_ENDPOINT_URL", server[0])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), *filter(None, sys.path)]))
    made = Cluster()
    made.add = lambda cores=2: add_node(made, cores)
    for cores in (0, 2, 2):
        made.add(cores)
    made.wait_for_nodes()
    yield made
    made.shutdown()


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    """An S3 server on this machine: its address, and the file that makes it fail (see bucket_server.py)."""
    pytest.importorskip("moto", reason="needs moto: make test-cluster installs it")
    port = free_port()
    folder = tmp_path_factory.mktemp("moto")
    log, faults = (folder / "log").open("wb"), folder / "faults"
    command = [sys.executable, str(Path(__file__).with_name("bucket_server.py")), str(port), str(faults)]
    running = subprocess.Popen(command, stdout=log, stderr=log)
    address = f"http://127.0.0.1:{port}"
    for _ in range(300):
        try:
            urllib.request.urlopen(urllib.request.Request(f"{address}/sets", method="PUT"), timeout=5)
            break
        except OSError:
            time.sleep(0.2)
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {
            "AWS_ACCESS_KEY_ID": "test",
            "AWS_SECRET_ACCESS_KEY": "test",
            "AWS_DEFAULT_REGION": "us-east-1",
            "AWS_EC2_METADATA_DISABLED": "true",
        }.items():
            patch.setenv(name, value)
        yield address, faults
    running.kill()
    running.wait()
    log.close()


@pytest.fixture
def s3(server, monkeypatch):
    """The URL of a bucket, for the tests' processes by their environment."""
    monkeypatch.setenv("AWS_ENDPOINT_URL", server[0])
    yield "s3://sets"
    server[1].unlink(missing_ok=True)
