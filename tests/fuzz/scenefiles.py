"""Hostile scene files: the sizes and shapes that were found to take minutes or gigabytes, drawn at random.

The same random.Random gives the same bytes. Every file is read, or refused with one diagnostic, in a time that grows
with its size and no faster.
"""

from __future__ import annotations

import json
import random
import time
from collections.abc import Callable
from pathlib import Path

from scenegen.api.reading import read_scenes
from scenegen.api.sample import sample
from scenegen.api.spec import parse
from scenegen.errors import ScenegenError
from scenegen.scenes.formats.scenes_json import dump

from .judge import Fault

ENDINGS = (".json", ".jsonl")
SECONDS, EACH = 5.0, 20e-6  # of CPU time: for any file, and for each of its bytes; an idle machine needs a tenth
STRANGE = ["\ud800", "\0", "a" * 3000, "1_0", "é😀", "", "\u202e", "phi", "x"]


def good_file() -> bytes:
    """A file to begin with."""
    return dump(sample(parse("object mug, plate\ntask: leftOf(mug, plate)"), n=2, seed=1).file())


def hostile(rng: random.Random, good: bytes) -> bytes:
    """A file made from a good .json one."""
    data = json.loads(good)
    count = rng.choice([3, 100, 1000])
    scene = data["scenes"][0]
    ways: list[Callable[[], object]] = [
        lambda: data.update({f"k{number}": number for number in range(count)}),
        lambda: data["objects"].extend({**data["objects"][0], "name": f"o{number}"} for number in range(count)),
        lambda: data["objects"].extend([data["objects"][0]] * count),
        lambda: data["scenes"].extend([{"poses": {}, "phi": {}}] * count),
        lambda: data["scenes"].extend([scene] * count),
        lambda: scene["phi"].update({f"l{number}": 0.5 for number in range(count)}),
        lambda: scene["poses"].update({f"o{number}": scene["poses"]["mug"] for number in range(count)}),
        lambda: data["objects"][0].update(name=rng.choice(STRANGE)),
        lambda: data["spec"].update(title=rng.choice(STRANGE), source=rng.choice(STRANGE) * count),
        lambda: data.update(labels=[rng.choice(STRANGE)] * count),
        lambda: data["sampler"].update(x=[[]] * count),
        lambda: data.update(scenes=[], labels=[f"l{number}" for number in range(count)]),
        lambda: data["objects"][0]["shape"].update(footprint={"kind": "polygon", "vertices": [[0, 0]] * count}),
    ]
    rng.choice(ways)()
    if rng.random() < 0.3:
        count = 3  # two large things at once multiply
        rng.choice(ways)()
    text = json.dumps(data)
    if rng.random() < 0.3:  # keys that stand twice: one, or many
        keys = ", ".join(f'"k{number}": 0' for number in range(count))
        text = text.replace("{", "{" + keys + rng.choice([', "k0": 1, ', f", {keys}, "]), 1)
    if rng.random() < 0.2:
        opening = rng.choice(["[", '{"a":', "1", "-", '"', "\\u0000"])
        at = rng.randrange(len(text))
        text = text[:at] + opening * count + text[at:]
    return text.encode()


def as_lines(data: bytes) -> bytes:
    """The same as JSON Lines, where it is well-formed."""
    try:
        parsed = json.loads(data)
    except (ValueError, RecursionError):
        return data
    scenes = parsed.pop("scenes", [])
    return "\n".join(json.dumps(one) for one in [parsed, *scenes]).encode()


def judge_file(rng: random.Random, good: bytes, folder: Path) -> bool:
    """Whether it is read. Raises Fault, and what the reader should not raise."""
    ending = rng.choice(ENDINGS)
    data = hostile(rng, good)
    data = as_lines(data) if ending == ".jsonl" else data
    path = folder / f"x{ending}"
    path.write_bytes(data)
    began = time.process_time()
    try:
        scenes = read_scenes(path)
        again = read_scenes(scenes.save(folder / f"y{ending}"))
        if (again.header, list(again.phi), len(again)) != (scenes.header, list(scenes.phi), len(scenes)):
            raise Fault("a file that is written is not the one that was read")
        good_file = True
    except ScenegenError as error:
        if len(error.diagnostics) != 1 or not error.diagnostics[0].help or len(str(error)) > 5000:
            raise Fault(f"a poor diagnostic: {str(error)[:200]}") from error
        good_file = False
    took = time.process_time() - began
    if took > SECONDS + EACH * len(data):
        raise Fault(f"{len(data):,} bytes took {took:.1f} s")
    return good_file
