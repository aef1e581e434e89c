"""A sampler to stream from: uniform scenes of a mug and a plate, in 32 cells of leftOf, at no cost; and its program."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from scenegen.geometry import Circle
from scenegen.sampling.cells import Cells, cut
from scenegen.sampling.engine.engines import Local, ShardWriter
from scenegen.sampling.engine.writer import CHECKPOINT_SECONDS, write_file
from scenegen.sampling.plan import Piece
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.blocks import BLOCK
from scenegen.scenes.data import ObjectData, RequestData, SceneFile, ShapeData, SpecRef, WorkspaceData, footprint_data
from scenegen.scenes.sets import RAW, Manifest, header_data

SOURCE = "object mug, plate\ntask: leftOf(mug, plate)\n"
SHA = hashlib.sha256(SOURCE.encode()).hexdigest()


@dataclass(frozen=True)
class Made:
    """phi in -0.9:0.9, rare at its ends; `objects` times 3 coordinates; piece k has a size of its own."""

    scenes_wanted: int
    seed: int = 0
    objects: int = 2
    size: int = 1500
    spread: str = "flat"
    low: float = -0.9
    plan_digest: str = "plan"
    fewest: int = 1
    patience: int | None = None
    is_verified: bool = False
    cells: Cells = field(init=False)
    reached_cells: tuple[int, ...] = field(init=False)

    def __post_init__(self):
        cells = cut(SampleRequest({"task": Range(self.low, 0.9)}, spread=self.spread), ("task",))
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "reached_cells", tuple(range(cells.count)))

    @property
    def groups(self):
        return (self.reached_cells,)

    @property
    def weights(self):
        return (1,)

    @property
    def problem(self):
        return SimpleNamespace(rows=3 * self.objects)

    def draw(self, k):
        source = np.random.default_rng([self.seed, k])
        rows = source.random((3 * self.objects, self.size + k % 3))
        phi = rows[3:4] - rows[0:1]
        return Piece(rows, phi, self.cells.find(phi), np.array([rows.shape[1], 0.1 * k]))


def header_of(made, facts=None):
    shape = ShapeData(asset="block", footprint=footprint_data(Circle(0.05)), height=0.1)
    names = ["mug", "plate", *(f"block[{k}]" for k in range(1, made.objects - 1))]
    return SceneFile(
        spec=SpecRef(source=SOURCE, sha256=SHA),
        workspace=WorkspaceData(x=(0.0, 1.0), y=(0.0, 1.0)),
        objects=[ObjectData(name=name, shape=shape) for name in names],
        sampler={"method": "made", "seed": made.seed, **(facts or {})},
        request=RequestData(phi={"task": (made.low, 0.9)}, n=made.scenes_wanted, spread=made.spread),
        scenes=[],
    )


def request_of(made):
    request = {"spec": SHA, "low": made.low, "phi": {"task": [made.low, 0.9]}, "spread": made.spread}
    request |= {"seed": made.seed, "n": made.scenes_wanted, "plan": made.plan_digest}
    return {**request, "scenegen": "", "numpy": ""}


def stream(path, made, *, workers=1, size=BLOCK, checkpoint=CHECKPOINT_SECONDS, header=None, **options):
    """Stream to a file; the tally."""

    def usual(tally):
        facts = {"pieces": tally.pieces, "candidates": tally.candidates, "facts": list(tally.facts)}
        return header_of(made, {**facts, "strays": list(tally.strays)})

    first = header_of(made)
    manifest = Manifest(request=request_of(made), labels=["task"], shard_size=8 * size, header=header_data(first))
    writing = lambda store: ShardWriter(made, store, first, ("task",), ending=RAW)  # noqa: E731
    with Local(workers) as engine:
        return write_file(
            Path(path), made, engine, manifest, writing, header or usual, checkpoint=checkpoint, block=size, **options
        )


def run(words):
    """A run as `words` say, struck down at their `kill`; the number of file operations that it made."""
    from strike import strike_at

    operations = strike_at(words.pop("kill", None))
    asked, pieces = itertools.count(1), words.pop("pieces", 1000)
    spent = lambda: next(asked) >= pieces  # noqa: E731
    stream(words.pop("path"), Made(**words.pop("made")), spent=spent, **words)
    return operations()


if __name__ == "__main__":
    # Each line on standard input is a run in a process of its own, forked from this one, which has loaded everything.
    for line in sys.stdin:
        read_end, write_end = os.pipe()
        child = os.fork()
        if child == 0:
            os.write(write_end, str(run(json.loads(line))).encode())
            os._exit(0)
        os.close(write_end)
        with os.fdopen(read_end) as source:
            said = source.read()
        _, status = os.waitpid(child, 0)
        print(json.dumps([os.waitstatus_to_exitcode(status), int(said or -1)]), flush=True)
