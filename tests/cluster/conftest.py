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
NODE = {"object_store_memory": 300 << 20, "include_dashboard": False, "include_log_monitor": False}


@pytest.fixture(scope="session")
def ray():
    return pytest.importorskip("ray", reason="needs Ray: make test-cluster installs it")


@pytest.fixture
def cluster(ray, server, monkeypatch):
    """A head without cores of its own, and two nodes of two cores each."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("AWS_ENDPOINT_URL", server[0])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), *filter(None, sys.path)]))
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, **NODE})
    for _ in range(2):
        made.add_node(num_cpus=2, **NODE)
    made.wait_for_nodes()
    yield made
    made.shutdown()


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    """An S3 server on this machine: its address, and the file that makes it fail (see bucket_server.py)."""
    pytest.importorskip("moto", reason="needs moto: make test-cluster installs it")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
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
