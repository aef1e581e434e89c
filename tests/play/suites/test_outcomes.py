"""Files of outcomes: read, held against their suite, and what is wrong with some."""

import pytest

from scenegen.errors import DataError, RequestError
from scenegen.play.suites.outcomes import (
    EpisodeOutcome,
    OutcomesHeader,
    check_same_run,
    dump_line,
    dump_outcomes,
    read_outcomes,
)
from scenegen.play.suites.suite import Suite


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
    golden("play/suites/outcomes.jsonl", data.decode())
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
        ({"episodes": 7}, lambda text: text),  # the suite has six
        ({}, lambda text: text.replace('"episode": 2', '"episode": 8')),
        ({}, lambda text: text[:-3] + "}\n" + text[-3:]),
        ({}, lambda text: ""),
    ],
)
def test_what_is_wrong(small, tmp_path, changes, edit):
    suite, path = Suite.load(small), tmp_path / "outcomes.jsonl"
    path.write_text(edit(dump_outcomes(header(suite, **changes), episodes(suite, [True] * 3)).decode()))
    with pytest.raises(DataError):
        read_outcomes(path, suite)


def test_another_run_is_not_continued(small, tmp_path):
    suite = Suite.load(small)
    check_same_run(tmp_path, header(suite), header(suite))
    with pytest.raises(RequestError) as caught:
        check_same_run(tmp_path, header(suite), header(suite, policy="other:act"))
    assert caught.value.diagnostics[0].facts["key"] == "policy"


@pytest.mark.parametrize(
    "edit",
    [
        lambda text: text.rstrip("\n"),
        lambda text: "\ufeff" + text,
        lambda text: text.replace("\n", "\n\n") + " \n\n",
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("}", ', "wall_s": [1.5, {"of": "me"}]}') + '{"episode": 3, "success": true',
    ],
)
def test_what_other_programs_make_of_a_file(small, tmp_path, edit):
    """Its last line has no end, it begins with a mark, has blank lines, or more than it should: all outcomes count."""
    suite, path = Suite.load(small), tmp_path / "outcomes.jsonl"
    path.write_bytes(edit(dump_outcomes(header(suite), episodes(suite, [True, False, True])).decode()).encode())
    assert read_outcomes(path, suite).success == {0: True, 1: False, 2: True}


def test_what_a_program_has_added_stays(small, tmp_path):
    suite, path = Suite.load(small), tmp_path / "outcomes.jsonl"
    text = dump_outcomes(header(suite), episodes(suite, [True])).decode().replace("}", ', "wall_s": 1.5}')
    path.write_text(text)
    found = read_outcomes(path, suite)
    assert dump_outcomes(found.header, found.episodes).decode() == text


def test_half_of_a_character_in_an_error_is_written(small):
    (one,) = episodes(Suite.load(small), [False])
    assert b"no ?" in dump_line(one.model_copy(update={"error": "no \udcff"}))


@pytest.mark.parametrize(
    "changes, key",
    [
        ({"steps": 100}, "steps"),
        ({"timeout": 9.0}, "timeout"),
        ({"world": "v:make"}, "world"),
        ({"versions": {"scenegen": "9"}}, "versions"),
    ],
)
def test_a_run_in_another_way_is_not_continued(small, tmp_path, changes, key):
    """Nor is one whose file says less refused: an old one does not know."""
    suite, how = Suite.load(small), {"steps": 20, "timeout": 600.0, "versions": {"scenegen": "1"}}
    before, now = header(suite, **how), header(suite, **{**how, **changes})
    with pytest.raises(RequestError) as caught:
        check_same_run(tmp_path, before, now)
    assert caught.value.diagnostics[0].facts["key"] == key and "name another file" in str(caught.value)
    if key != "world":
        check_same_run(tmp_path, header(suite), now)
