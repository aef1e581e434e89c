"""Files of outcomes: read, held against their suite, and what is wrong with some."""

import pytest

from scenegen.errors import DataError, RequestError
from scenegen.worlds.suites.outcomes import EpisodeOutcome, OutcomesHeader, dump_outcomes, read_outcomes, same_run
from scenegen.worlds.suites.suite import Suite


def header(suite, **changes):
    facts = {"suite": suite.name, "digest": suite.digest, "world": "w:make", "policy": "p:act", "episodes": len(suite)}
    return OutcomesHeader(**{**facts, **changes})


def episodes(suite, success):
    return [
        EpisodeOutcome(
            episode=start.number, task=start.task.name, band=start.band, success=one, steps=7,
            error=None if one else "ValueError: no",
        )
        for start, one in zip(suite, success, strict=False)
    ]  # fmt: skip


def test_read_as_written(small, tmp_path, golden):
    suite = Suite.load(small)
    made = episodes(suite, [True, False, True])
    data = dump_outcomes(header(suite), reversed(made))
    golden("worlds/suites/outcomes.jsonl", data.decode())
    path = tmp_path / "outcomes.jsonl"
    path.write_bytes(data + b'{"episode": 3, "ta')  # a run that was killed
    found = read_outcomes(path, suite)
    assert list(found.episodes) == made and found.success == {0: True, 1: False, 2: True}
    assert dump_outcomes(found.header, found.episodes) == data


@pytest.mark.parametrize(
    "changes, edit",
    [
        ({"digest": "0" * 64}, lambda text: text),
        ({}, lambda text: text.replace("level1", "level2", 1)),
        ({}, lambda text: text + text.splitlines()[-1] + "\n"),
        ({}, lambda text: text.replace('"success": true', '"success": 1')),
        ({"episodes": 2}, lambda text: text),
    ],
)
def test_what_is_wrong(small, tmp_path, changes, edit):
    suite, path = Suite.load(small), tmp_path / "outcomes.jsonl"
    path.write_text(edit(dump_outcomes(header(suite, **changes), episodes(suite, [True] * 3)).decode()))
    with pytest.raises(DataError):
        read_outcomes(path, suite)


def test_another_run_is_not_continued(small, tmp_path):
    suite = Suite.load(small)
    same_run(tmp_path, header(suite), header(suite))
    with pytest.raises(RequestError) as caught:
        same_run(tmp_path, header(suite), header(suite, policy="other:act"))
    assert caught.value.diagnostics[0].facts["key"] == "policy"
