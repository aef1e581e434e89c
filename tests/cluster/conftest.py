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
STORE = 300 << 20  # bytes of a node's object store


@pytest.fixture(scope="session")
def ray():
    return pytest.importorskip("ray", reason="needs Ray: make test-cluster installs it")


@pytest.fixture
def cluster(ray, monkeypatch):
    """A head without cores of its own, and two nodes of two cores each."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), *filter(None, sys.path)]))
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "object_store_memory": STORE})
    for _ in range(2):
        made.add_node(num_cpus=2, object_store_memory=STORE)
    made.wait_for_nodes()
    yield made
    made.shutdown()


@pytest.fixture(scope="session")
def s3(tmp_path_factory):
    """The URL of a bucket in a server on this machine, for the tests' processes by their environment."""
    pytest.importorskip("moto", reason="needs moto: make test-cluster installs it")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    log = (tmp_path_factory.mktemp("moto") / "log").open("wb")
    server = subprocess.Popen([sys.executable, "-m", "moto.server", "-p", str(port)], stdout=log, stderr=log)
    address = f"http://127.0.0.1:{port}"
    for _ in range(200):
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
            "AWS_ENDPOINT_URL": address,
        }.items():
            patch.setenv(name, value)
        yield "s3://sets"
    server.kill()
    server.wait()
    log.close()
