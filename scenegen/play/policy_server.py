"""A policy in a process of its own, behind HTTP: how values travel, and a server.

`POST /reset` with {"seed": 7} begins an episode, `POST /act` with {"observation": ..., "instruction": "..."} returns
{"action": ...}; a policy that fails answers with status 500 and {"error": "..."}. Where both also have a {"client":
"..."}, a policy in an episode of another client answers {"busy": "..."}. Bodies are JSON. An array is an object: its
bytes in base64 under `__array__`, beside `dtype`, such as "<f4", and `shape`.
Nothing is pickled. This file needs numpy alone, so that it can be copied into any environment.
"""

from __future__ import annotations

import base64
import contextlib
import json
import threading
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer
from queue import SimpleQueue
from typing import Any

import numpy as np


def encode(value: Any) -> bytes:
    """A value as JSON: numbers, texts, lists and objects by name, and arrays. Raises TypeError for what is none."""
    return json.dumps(value, default=_array).encode()


def _array(value: Any) -> object:
    if not hasattr(value, "__array__"):
        raise TypeError(f"{type(value).__name__} does not travel")
    array = np.asarray(value)
    if array.dtype.kind not in "biuf":
        raise TypeError(f"arrays of {array.dtype} do not travel")
    if not array.shape:
        return array.item()
    data = base64.b64encode(array.tobytes()).decode()
    return {"__array__": data, "dtype": array.dtype.str, "shape": array.shape}


def decode(data: bytes) -> Any:
    """The value of some JSON. Raises ValueError."""
    return json.loads(data, object_hook=_object)


def _object(value: dict[str, Any]) -> Any:
    if "__array__" not in value:
        return value
    data, dtype = base64.b64decode(value["__array__"]), np.dtype(value["dtype"])
    if dtype.kind not in "biuf":
        raise ValueError(f"arrays of {dtype} do not travel")
    return np.frombuffer(data, dtype).reshape(value["shape"]).copy()


def serve(policy: Callable[[Any, str], Any], port: int = 8000, host: str = "127.0.0.1") -> None:
    """Answer for a policy until the process ends: policy(observation, instruction) is an action; its `reset(seed)`,
    if it has one, begins an episode."""
    server_of(policy, port, host).serve_forever()


def server_of(policy: Callable[[Any, str], Any], port: int, host: str = "127.0.0.1") -> HTTPServer:
    """The server, which listens already; port 0 is any free one. Each client has a thread of its own, but the policy
    acts in the thread that calls `serve_forever`, for one request at a time. If it has a `reset`, who begins an episode
    ends that of another client."""
    requests: SimpleQueue[tuple[str, bytes, SimpleQueue[tuple[int, bytes]]] | None] = SimpleQueue()
    episode = {"client": None}

    def answer(path: str, given: Mapping[str, Any]) -> dict[str, Any]:
        client = given.get("client")
        if path == "/act":
            if client and episode["client"] not in (None, client):
                return {"busy": "another client has begun an episode; start a server for each"}
            return {"action": policy(given["observation"], given["instruction"])}
        if path != "/reset":
            raise ValueError(f"there are /reset and /act here, not {path}")
        if hasattr(policy, "reset"):
            episode["client"] = client
            policy.reset(given["seed"])
        return {}

    class PolicyServer(ThreadingHTTPServer):
        def serve_forever(self, poll_interval: float = 0.5) -> None:
            threading.Thread(target=super().serve_forever, args=(poll_interval,), daemon=True).start()
            for path, data, answered in iter(requests.get, None):
                try:
                    answered.put((200, encode(answer(path, decode(data)))))
                except Exception as error:
                    answered.put((500, encode({"error": f"{type(error).__name__}: {error}"})))

        def shutdown(self) -> None:
            super().shutdown()
            requests.put(None)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"  # one connection for a run
        disable_nagle_algorithm = True  # answers are two small packets: 40 ms a step otherwise

        def do_POST(self) -> None:
            answered: SimpleQueue[tuple[int, bytes]] = SimpleQueue()
            requests.put((self.path, self.rfile.read(int(self.headers["content-length"] or 0)), answered))
            status, body = answered.get()
            self.send_response(status)
            self.send_header("content-length", str(len(body)))
            self.end_headers()
            with contextlib.suppress(ConnectionError):  # the client has gone
                self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            """Nothing is said of each step."""

    return PolicyServer((host, port), Handler)
