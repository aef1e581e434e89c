"""A program with a pseudo-terminal of its own, and a person who answers what it asks."""

import os
import pty
import select
import signal
import sys
import time

SECONDS = 120.0  # at most, until an answer comes


class Terminal:
    """`scenegen` with some words, in a folder; `said` is all that it wrote."""

    def __init__(self, words, folder):
        self.said = ""
        self._seen = 0
        self.pid, self._keys = pty.fork()
        if not self.pid:  # pragma: no cover - the program
            os.chdir(folder)
            os.execv(sys.executable, [sys.executable, "-m", "scenegen", *words])

    def wait_for(self, *texts):
        """Which of some texts comes first, in what was not yet waited for; None where the program ends before."""
        until = time.monotonic() + SECONDS
        while time.monotonic() < until:
            new = self.said[self._seen :]
            found = sorted((new.index(one), one) for one in texts if one in new)
            if found:
                place, text = found[0]
                self._seen += place + len(text)
                return text
            if select.select([self._keys], [], [], 0.5)[0]:
                try:
                    data = os.read(self._keys, 1 << 16)
                except OSError:  # the program has ended
                    return None
                self.said += data.decode()
        raise AssertionError(f"none of {texts} came in {SECONDS:.0f} s:\n{self.said}")

    def type(self, text):
        os.write(self._keys, text.encode())

    def end(self):
        """The exit status."""
        if self.wait_for("\0") is None:
            _, status = os.waitpid(self.pid, 0)
            os.close(self._keys)
            return os.waitstatus_to_exitcode(status)
        os.kill(self.pid, signal.SIGKILL)
        raise AssertionError("it does not end")
