"""`scenegen range`: what it says, and that what it advises can be asked for."""

import io
import json
import math
import re

import pytest
from PIL import Image

RARE = "object peg, hole\ntask: dist(peg, hole) <= 0.2 mm & abs(wrap(theta(peg) - theta(hole))) <= 0.001 rad\n"
FAST = "object mug, plate\ntask: leftOf(mug, plate)\n"


@pytest.fixture
def report(scenegen, here):
    def call(*words):
        outcome = scenegen("range", *words)
        assert outcome.status == 0
        return outcome

    return call


def test_what_is_printed(report, golden):
    """The numbers are those of one seed on one kind of machine: the golden file has `#` in their place."""
    outcome = report("good.spec")
    assert outcome.err == ""
    lines = outcome.out.splitlines()
    assert lines[2].startswith("task: phi in [-1, 1]; reached -0.99") and lines[3].startswith(
        "  satisfied (phi >= 0) by "
    )
    golden("cli/range/good.txt", "\n".join(_shape(line) for line in lines if "evaluations" not in line) + "\n")


def _shape(line):
    """A line without its numbers and without the space between columns; of a plot, none."""
    if "|" in line or "+---" in line:
        return "  (plot)"
    numbers = re.sub(r"-?\d[\d,]*(\.\d+)?", "#", line.replace("log10", "log"))
    return re.sub(r"(?<=\S) +", " ", numbers)


def test_a_time_limit_that_is_over_at_once(scenegen, here):
    (here / "fast.spec").write_text(FAST)
    outcome = scenegen("range", "fast.spec", "--timeout", "0.000001")
    assert outcome.status == 1 and "no-time-to-check" in outcome.err
    assert "--timeout" in scenegen("range", "fast.spec", "--timeout", "-1").err


def test_plain_text_fits_the_terminal(report, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    lines = report("good.spec").out.splitlines()
    plot = [line for line in lines if "|" in line or "+--" in line]
    assert len(plot) == 10 and max(map(len, plot)) <= 60
    assert "\n".join(lines).isascii()


def test_the_numbers_are_right(report):
    found = json.loads(report("good.spec", "--json").out)["labels"]["task"]
    assert found["bounds"] == [-1.0, 1.0] and found["whole"] == [True, True]
    assert [level["phi"] for level in found["levels"]].count(0.0) == 1 and len(found["levels"]) == 13
    for level in found["levels"]:
        t = level["phi"]
        above = (1 - t) ** 2 / 2 if t >= 0 else 1 - (1 + t) ** 2 / 2
        for side, truth in (("above", above), ("below", 1 - above)):
            estimate = level[side]
            assert abs(estimate["log10"] - math.log10(truth)) < 4 * estimate["error"] + 1e-9


@pytest.mark.long
def test_the_same_seed_says_the_same(report):
    first, again = (report("good.spec", "--json").out for _ in range(2))
    assert first == again != report("good.spec", "--json", "--seed", "1").out


def test_one_label(report, here):
    (here / "both.spec").write_text("object mug\none: x(mug) <= 0.5\nother: y(mug) <= 0.5\n")
    whole, one = (json.loads(report("both.spec", "--json", *words).out) for words in ([], ["--label", "other"]))
    assert list(whole["labels"]) == ["one", "other"] and list(one["labels"]) == ["other"]


def test_a_requirement_is_reported(report, here):
    (here / "required.spec").write_text("require leftOf(a, b)\ntask: aboveOf(a, b)\n")
    line = report("required.spec").out.splitlines()[1]
    found = re.fullmatch(r"  what the spec requires is met by 5\d % of scenes \(log10 P = (.*) \+- (.*)\); .*", line)
    assert found and abs(float(found[1]) - math.log10(0.5)) < 4 * float(found[2])


@pytest.mark.long
def test_what_is_advised_can_be_sampled(report, scenegen, here):
    bands = json.loads(report("two.spec", "--label", "task", "--json").out)["labels"]["task"]["bands"]
    assert [band["name"] for band in bands] == ["hard", "medium", "easy", "satisfied"]
    for band in bands:
        outcome = scenegen("sample", "two.spec", "--phi", band["phi_option"], "-n", "32", "--out", "s.json")
        assert outcome.status == 0, outcome.err
        phi = [scene["phi"]["task"] for scene in json.loads((here / "s.json").read_text())["scenes"]]
        assert band["phi"][0] <= min(phi) <= max(phi) <= band["phi"][1]


@pytest.mark.long
@pytest.mark.parametrize("told", [True, False])
def test_what_is_very_rare_is_offered_even_where_it_cannot_be_counted(told, report, scenegen, here, monkeypatch):
    """And what violates the task is not called easy, be it the best that occurs."""
    if not told:
        monkeypatch.setattr("scenegen.sampling.growth.rarity.TAIL_EFFORT", 0.0)
        monkeypatch.setattr("scenegen.sampling.growth.rarity.MIN_RUNS", -1)
        monkeypatch.setattr("scenegen.sampling.growth.rarity.SATISFIED_EFFORT", 0.0)
    (here / "rare.spec").write_text(RARE)
    out = report("rare.spec").out
    share = "1 scene in 10^10" if told else "so few scenes that their share cannot be told"
    assert f"satisfied (phi >= 0) by {share}" in out and "easy" not in out
    easier, satisfied = out.splitlines()[-2:]
    assert easier.split()[0] == "easier" and re.search(r"task=-0\.\d+:-0\.\d+$", easier)
    assert satisfied.lstrip().startswith("satisfied  1 scene in 10^10" if told else "satisfied  too rare to tell  ")
    assert scenegen(*satisfied.split("scenegen ")[1].split(), "-n", "2", "--out", "s.json").status == 0


def test_the_commands_are_printed_for_the_shell(report, here):
    (here / "my spec.spec").write_text(FAST)
    out = report("my spec.spec").out
    assert "scenegen sample 'my spec.spec' --phi task=" in out


@pytest.mark.long
def test_a_label_that_no_scene_satisfies_is_said_to_clash(report, here):
    (here / "hopeless.spec").write_text("task: closeTo(mug, plate, 5 cm) & x(mug) >= x(plate) + 0.1\n")
    outcome = report("hopeless.spec")
    assert "no scene that satisfies it was found" in outcome.out and "satisfied " not in outcome.out
    assert (
        outcome.err.startswith("warning[cannot-be-satisfied]: `task` can never be satisfied")
        and "bounds prove it" in outcome.err
    )


@pytest.mark.long
def test_a_requirement_that_no_scene_meets(refused, here):
    (here / "bad.spec").write_text("require leftOf(a, b) & x(a) >= x(b) + 0.1\ntask: aboveOf(a, b)\n")
    assert "what the spec requires can never be met" in refused("range", "bad.spec")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--label", "tsk"], "did you mean `task`"),
        (["--seed", "-1"], "--seed is -1\n = help: it must be from 0"),
        (["--png", "rarity.jpg"], "does not end in .png"),
        (["--png", "nowhere/rarity.png"], "cannot write"),
    ],
)
def test_what_is_refused(refused, words, said):
    assert said in refused("range", "good.spec", *words)


def test_a_picture(report, here):
    outcome = report("good.spec", "--png", "rarity.png")
    assert outcome.err == "curves in rarity.png\n"
    picture = Image.open(io.BytesIO((here / "rarity.png").read_bytes()))
    assert (picture.format, picture.size) == ("PNG", (900, 360))
    colors = {color for _, color in picture.getcolors(1 << 20)}
    assert {(178, 58, 44), (43, 96, 158)} <= colors, "both curves are drawn"


@pytest.mark.long
def test_it_loads_neither_torch_nor_pillow(process, here):
    import subprocess
    import sys

    program = (
        "import sys; from scenegen.cli.app import run; status = run(sys.argv[1:]);"
        "sys.exit(status or ','.join(m for m in ('torch', 'pybullet', 'PIL') if m in sys.modules) or None)"
    )
    done = subprocess.run([sys.executable, "-c", program, "range", "good.spec"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("low", "high"), [(-1.0, 1.0), (-2.9416, 0.09997), (0.2, 0.7), (-1.4, -0.03)])
def test_tabled_values_lie_within_what_was_reached(low, high):
    from scenegen.api.rarity import spread

    values = spread(low, high)
    assert values == sorted(set(values)) and 10 <= len(values) <= 13
    assert low <= values[0] and values[-1] <= high
    assert (0.0 in values) == (low < 0.0 < high)


@pytest.mark.parametrize(
    ("log10", "words"),
    [(0.0, "nearly every scene"), (-0.301, "50 % of scenes"), (-2.0, "1 scene in 100"), (-5.01, "1 scene in 100,000")],
)
def test_shares_in_words(log10, words):
    from scenegen.cli.range import one_in

    assert one_in(log10) == words


def test_a_plot_of_a_straight_line():
    from scenegen.cli.range import curves

    lines = curves([[(0.0, 0.0), (1.0, -8.0)]], ">", ends=(0.0, 1.0), floor=-8.0, columns=40, fancy=False, color=False)
    marks = [[column for column, char in enumerate(line) if char == ">"] for line in lines[:9]]
    assert all(marks) and [min(row) for row in marks] == sorted(min(row) for row in marks)
    assert lines[0].split("|")[0].strip() == "0" and lines[8].split("|")[0].strip() == "-8"
    braille = curves([[(0.0, 0.0), (1.0, -8.0)]], ">", ends=(0.0, 1.0), floor=-8.0, columns=40, fancy=True, color=False)
    assert any("\u2801" <= char <= "\u28ff" for char in braille[0]) and max(map(len, braille)) <= 40


def test_ticks_are_round():
    from scenegen.looks.chart_style import ticks

    assert ticks(-1.0, 1.0) == [-1.0, -0.5, 0.0, 0.5, 1.0]
    assert 0.0 in ticks(-2.94, 0.2) and all(-2.94 <= tick <= 0.2 for tick in ticks(-2.94, 0.2))
