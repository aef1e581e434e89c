"""What a suite saves: `python -m experiments.suites.power`."""
