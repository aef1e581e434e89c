"""moto's S3 server with faults: while a file has a number in it, matching requests are answered with that status, or
with nothing for 0. Called as: bucket_server.py PORT FAULTS"""

import sys
from pathlib import Path

from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import run_simple


class Faulty:
    """FAULTS has lines `STATUS METHOD PART`: of requests of a method (* for all) to a path with that part in it."""

    def __init__(self, inner, faults):
        self.inner, self.faults = inner, Path(faults)

    def __call__(self, environ, start):
        lines = self.faults.read_text().splitlines() if self.faults.exists() else []
        for status, method, part in map(str.split, lines):
            if method in ("*", environ["REQUEST_METHOD"]) and part in environ["PATH_INFO"]:
                with self.faults.with_suffix(".seen").open("a") as seen:
                    seen.write(f"{environ['REQUEST_METHOD']} {environ['PATH_INFO']}\n")
                if status == "0":
                    raise ConnectionResetError
                start(f"{status} Fault", [("Content-Length", "0")])
                return [b""]
        return self.inner(environ, start)


if __name__ == "__main__":
    app = Faulty(DomainDispatcherApplication(create_backend_app), sys.argv[2])
    run_simple("127.0.0.1", int(sys.argv[1]), app, threaded=True)
