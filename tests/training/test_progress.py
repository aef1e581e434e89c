import io

from rich.console import Console

from scenegen.learn.training.progress import TrainingProgress
from scenegen.learn.training.session import EpochReport


def report(epoch, epochs):
    return EpochReport(epoch, epochs, {"generator": 0.5, "discriminator": 0.25}, 0.5)


def test_plain_lines_where_there_is_no_terminal():
    text = io.StringIO()
    with TrainingProgress(50, "gan", Console(file=text)) as progress:
        for epoch in range(1, 51):
            progress(report(epoch, 50))
        progress.note("[bold]as it is[/bold]")
    lines = text.getvalue().splitlines()
    assert lines[0] == "gan: epoch 1/50  generator 0.5000  discriminator 0.2500  0.50 s/epoch, 24 s left"
    assert len(lines) == 12 and lines[-2].startswith("gan: epoch 50/50") and lines[-2].endswith(" 0 s left")
    assert lines[-1] == "gan: [bold]as it is[/bold]"
    assert "\x1b" not in text.getvalue()


def test_a_bar_in_a_terminal():
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=120)
    with TrainingProgress(4, "gan", console) as progress:
        progress(report(2, 4))
    assert "2/4" in text.getvalue() and "generator 0.5000" in text.getvalue()


def test_the_default_is_standard_error(capsys):
    with TrainingProgress(2, "aae") as progress:
        progress(report(1, 2))
    captured = capsys.readouterr()
    assert captured.out == "" and "epoch 1/2" in captured.err
