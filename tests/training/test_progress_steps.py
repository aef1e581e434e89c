import io
import re

from rich.console import Console

from scenegen.learn.training.progress import TrainingProgress
from scenegen.learn.training.session import EpochReport, Validation

GOOD = Validation({"task": 0.01, "safe": 0.03}, 0.4)


def test_a_line_tells_the_error_of_phi():
    text = io.StringIO()
    with TrainingProgress(2, "gan", Console(file=text)) as progress:
        progress.step(3, 10)  # says nothing where there is no terminal
        progress(EpochReport(1, 2, {"generator": 0.5}, 0.25, GOOD, 5))
    line = "gan: epoch 1/2  generator 0.5000  phi off by 0.0200  0.25 s/epoch, 0 s left\n"
    assert text.getvalue() == line


def test_the_bar_moves_within_an_epoch():
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=160)
    with TrainingProgress(4, "gan", console) as progress:
        assert "gathering scenes" in str(progress._bar.tasks[0].description)
        progress.step(21, 40)  # resumed in the third epoch
        (task,) = progress._bar.tasks
        assert (task.completed, task.total, task.description) == (21, 40, "gan: epoch 3/4")
        assert task.time_remaining is None  # nothing is known of its pace yet
        progress(EpochReport(3, 4, {"generator": 0.5}, 0.25, GOOD, 30))
        assert (task.completed, task.description) == (30, "gan: epoch 3/4")
        progress.step(40, 40)
        assert task.description == "gan: epoch 4/4"
    plain = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", text.getvalue())
    assert "phi off by 0.0200" in plain and "100%" in plain
