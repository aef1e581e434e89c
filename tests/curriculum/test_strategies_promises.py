"""What each strategy promises beyond the contract."""

import numpy as np
import pytest

from scenegen.learn.curriculum.strategies import strategy
from scenegen.learn.curriculum.tasks import Outcome, PhiBox

from .learners import draw, reach

SURE = {"share": 0.0}


def made(name, labels=1, seed=0, **settings):
    return strategy(name, reach(labels), np.random.default_rng(seed), **settings)


def tell(teacher, phi, success, total=None):
    total = (10.0 if success else 0.0) if total is None else total
    teacher.report(Outcome(PhiBox((-9.0,), (9.0,)), (phi,), success, total, 1))


def asked(teacher, count):
    """How often each tenth of the difficulties was asked for; wide boxes are left out."""
    middles = [-(task.low[0] + task.high[0]) / 2 for task in (teacher.next_task() for _ in range(count))
               if task.high[0] - task.low[0] < 0.2]  # fmt: skip
    return np.histogram(middles, bins=10, range=(0.0, 1.0))[0]


def schedule(teacher, count):
    """The tasks of a strategy that nobody reports to, as lines."""
    lines = []
    for episode in range(count):
        task = teacher.next_task()
        box = " x ".join(f"[{low:+.3f}, {high:+.3f}]" for low, high in zip(task.low, task.high, strict=True))
        lines.append(f"{episode:3} {box}")
    return lines


def test_schedules(golden):
    cases = {
        "ordered, 5 scenes a pass": made("ordered", scenes=5),
        "linear, 3 levels in 6 episodes": made("linear", levels=3, episodes=6),
        "linear, the same, growing": made("linear", levels=3, episodes=6, grow=True),
        "linear, two labels: shells around the easy corner": made("linear", labels=2, levels=3, episodes=6),
        "linear, two labels, growing": made("linear", labels=2, levels=3, episodes=6, grow=True),
    }
    blocks = ["\n".join([f"== {title}", *schedule(teacher, 8)]) for title, teacher in cases.items()]
    golden("curriculum/schedules.txt", "\n\n".join(blocks) + "\n")


def test_uniform_levels_are_even():
    counts = asked(made("uniform", levels=10), 2000)
    assert counts.min() > 150 and counts.max() < 250


@pytest.mark.parametrize("labels", [1, 2])
def test_self_paced_asks_for_the_newest_levels_and_moves_on(labels):
    teacher, rng = made("self_paced", labels, levels=5, window=10, rate=1.0, **SURE), np.random.default_rng(0)
    for level in range(5):
        seen = set()
        for _ in range(10):
            assert teacher.log()["level"] == level
            task = teacher.next_task()
            hardest = max(-low for low in task.low)
            seen.add(round(hardest * 5) - 1)
            teacher.report(Outcome(task, draw(task, rng), True, 10.0, 1))
        assert level in seen and seen <= {level - 1, level}
    assert teacher.next_task() == teacher.space


def test_self_paced_loses_patience_with_a_learner_that_never_succeeds():
    teacher, rng = made("self_paced", levels=5, patience=30, **SURE), np.random.default_rng(0)
    for count in range(150):
        assert teacher.log()["level"] == count // 30
        task = teacher.next_task()
        teacher.report(Outcome(task, draw(task, rng), False, 0.0, 1))
    assert teacher.next_task() == teacher.space


def test_self_paced_hears_only_of_its_newest_levels():
    teacher = made("self_paced", levels=5, window=10, rate=1.0)
    for _ in range(50):
        tell(teacher, -0.9, True)  # by luck, far out
    assert teacher.log()["level"] == 0
    for _ in range(9):
        tell(teacher, -0.1, True)
    tell(teacher, -0.1, False)
    assert teacher.log()["level"] == 0
    for _ in range(10):
        tell(teacher, -0.1, True)
    assert teacher.log()["level"] == 1


def test_reverse_stays_at_the_goal_until_that_is_learnt_and_goes_outwards_from_there():
    teacher = made("reverse", levels=10, **SURE)
    for _ in range(50):
        tell(teacher, -0.05, False)
    assert asked(teacher, 200)[:5].sum() == 200
    for level in range(4):
        for _ in range(60):
            tell(teacher, -0.05 - level / 10, True)
    for success in [True, False] * 20:
        tell(teacher, -0.45, success)
    counts = asked(teacher, 400)
    assert teacher.log() == {"good": 1, "old": 4, "furthest": 4}
    assert counts[3:6].sum() > 200 and counts[9] == 0  # around the one good level
    assert 40 < counts[:3].sum() < 200  # replayed


@pytest.mark.parametrize("name", ["learnability", "replay", "alp_gmm", "teacher"])
def test_what_is_a_toss_up_is_asked_for(name):
    """Success at 0.5 alternates, nearer to the goal it is sure, further out it is out of the question."""
    teacher, rng = made(name), np.random.default_rng(0)
    for _ in range(1500):
        phi = -float(rng.random())
        tell(teacher, phi, bool(rng.random() < 0.5) if -0.6 < phi < -0.4 else phi > -0.5)
    counts = asked(teacher, 500)
    assert counts[4:6].sum() > 0.55 * counts.sum()


def test_replay_sees_everything_first_and_forgets_nothing():
    teacher = made("replay", cells=10, worth="total")
    assert asked(teacher, 60).min() > 0
    for turn in range(100):
        for cell in range(10):
            tell(teacher, -0.05 - cell / 10, True, 7.0 if cell else float(turn % 2))
    counts = asked(teacher, 1000)
    assert counts.argmax() == 0 and counts.min() > 5


def test_replay_does_not_care_about_the_scale_of_rewards():
    small, large = made("replay", worth="total"), made("replay", worth="total")
    rng = np.random.default_rng(1)
    for _ in range(500):
        phi, total = -float(rng.random()), float(rng.integers(3))
        tell(small, phi, False, total)
        tell(large, phi, False, total * 1024.0)
    assert [small.next_task() for _ in range(100)] == [large.next_task() for _ in range(100)]


@pytest.mark.parametrize("up", [True, False])
def test_teacher_asks_for_what_changes(up):
    """Cell 7 of 10 goes from never to always, or back; the others stand still."""
    teacher = made("teacher", cells=10)
    for turn in range(30):
        for cell in range(10):
            tell(teacher, -0.05 - cell / 10, cell < 5 if cell != 7 else (turn >= 20) == up)
    counts = asked(teacher, 500)
    assert counts.argmax() == 7 and counts.min() > 0


def test_exp3s_is_drawn_to_what_changes():
    """Cell 7 of 10 is learnt and forgotten all the time, in runs of 20 of its own episodes; the others stand still."""
    teacher, counts = made("exp3s", cells=10), np.zeros(10, dtype=int)
    for _ in range(3000):
        task = teacher.next_task()
        cell = int(-(task.low[0] + task.high[0]) / 2 * 10)
        teacher.report(Outcome(task, task.low, counts[7] // 20 % 2 == 0 if cell == 7 else cell < 5, 0.0, 1))
        counts[cell] += 1
    assert counts[7] > 0.4 * counts.sum() and counts.min() > 20


@pytest.mark.parametrize("name", ["learnability", "replay", "teacher", "exp3s"])
def test_cells_out_of_reach_are_left_alone(name):
    """No scene fails both labels badly: a source hands out what is nearest."""
    teacher, rng = made(name, labels=2, cells=4), np.random.default_rng(0)
    vain = []
    for _ in range(600):
        task = teacher.next_task()
        phi = draw(task, rng)
        there = max(phi) > -0.5
        vain.append(not there)
        teacher.report(Outcome(task, phi if there else (phi[0], -0.45), bool(rng.random() < 0.3), 0.0, 1))
    assert 10 <= sum(vain) <= 12  # a quarter of the 16 cells, three times each
    assert not any(vain[300:])


def test_alp_gmm_knows_progress_from_standing_still():
    """Success comes and goes in the easy corner of two labels, a quarter of the square, and only there."""
    inside = []
    for seed in range(4):
        teacher, rng = made("alp_gmm", 2, seed, width=0.02), np.random.default_rng(seed)
        for _ in range(500):
            phi = tuple((-rng.random(2)).tolist())
            success = min(phi) > -0.5 and rng.random() < 0.5
            teacher.report(Outcome(teacher.space, phi, bool(success), 0.0, 1))
        tasks = [task for task in (teacher.next_task() for _ in range(200)) if task != teacher.space]
        inside.append(np.mean([min(task.low) > -0.5 for task in tasks]))
    assert np.mean(inside) > 0.6
