"""JSON Lines: what stands in which line, and which line is damaged."""

import json

import numpy as np
import pytest

from scenegen.api.reading import read_scenes
from scenegen.errors import DataError
from scenegen.scenes.blocks import Block
from scenegen.scenes.formats.registry import write_scenes


@pytest.fixture
def path(scenes, tmp_path):
    return scenes.save(tmp_path / "x.jsonl")


def test_golden(scenes, tmp_path, golden):
    """Made by hand, so that the file does not follow the samplers' progress."""
    header = scenes.header.model_copy(update={"sampler": {"method": "by hand"}})
    rows = np.array([[0.25, 0.5], [1.0, 1e-05], [0.0, 6.25], [0.75, 0.125], [0.1, 0.2], [3.0, -0.0]])
    write_scenes(tmp_path / "x.jsonl", header, ("task",), [Block(rows, rows[3:4] - rows[:1])])
    golden("formats/scenes.jsonl", (tmp_path / "x.jsonl").read_text())


def test_lines(path, scenes):
    """Any JSON reader gets along with it; the first line is the JSON file without its scenes."""
    header, *lines = map(json.loads, path.read_text().splitlines())
    assert len(lines) == len(scenes)
    assert {**header, "scenes": lines} == scenes.file().model_dump(mode="json")


def test_lines_in_another_layout(path, scenes):
    """As other programs write them: other spaces, other order of keys, whole numbers as integers, other line breaks."""
    header, *lines = map(json.loads, path.read_text().splitlines())
    lines[1] = {"phi": lines[1]["phi"], "poses": dict(reversed(lines[1]["poses"].items()))}
    lines[2]["poses"]["mug"]["theta"] = 3
    path.write_text("\r\n".join(json.dumps(line, separators=(",", ":")) for line in [header, *lines]))
    again = read_scenes(path)
    assert np.array_equal(np.delete(again.poses, 2, 0), np.delete(scenes.poses, 2, 0))
    assert again.poses[2, again.objects.index("mug"), 2] == 3.0


@pytest.mark.parametrize(
    "number, change, said",
    [
        (1, lambda line: b"", "x.jsonl is not a scenes file: its first line is empty"),
        (1, lambda line: line.replace(b'"version": 1', b'"version": 3'), "line 1 of .* has version 3"),
        (1, lambda line: line.replace(b'"spec"', b'"scenes"'), "its header holds scenes"),
        (1, lambda line: line.replace(b"leftOf", b"rightOf"), "line 1 of .* is damaged at `spec`"),
        (1, lambda line: b"[]", 'line 1 of .* its "format" is not'),
        (2, lambda line: line[:-9], "line 2 of .* is not valid JSON"),
        (4, lambda line: line[:-9], "line 4 of .* is not valid JSON"),
        (4, lambda line: b"", "line 4 of .* is empty"),
        (4, lambda line: b"\xff" + line, "line 4 of .* byte 0 is not UTF-8"),
        (4, lambda line: line.replace(b'"mug"', b'"cup"'), "line 4 of .* does not place the file's objects: `cup`"),
        (4, lambda line: line.replace(b'"task"', b'"tusk"'), "line 4 of .* has other labels"),
        (4, lambda line: line.replace(b'"phi"', b'"psi"'), "line 4 of .* is damaged at `phi`"),
        (4, lambda line: line.replace(b'"x": ', b'"x": 1e999, "z": '), "line 4 of .* is damaged"),
        (4, lambda line: line.replace(b'"x": ', b'"x": 1.0, "x": '), "`x` stands twice"),
        (4, lambda line: line + b" " + line, "line 4 of .* is not valid JSON"),
        (5, lambda line: b'"x"', "line 5 of .* is damaged: "),
    ],
)
def test_damage(number, change, said, path):
    lines = path.read_bytes().splitlines()
    lines[number - 1] = change(lines[number - 1])
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(DataError, match=said) as caught:
        read_scenes(path)
    assert caught.value.diagnostics[0].help
