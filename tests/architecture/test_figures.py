"""The architecture gets no worse: `python -m tests.architecture.measure --record` after it got better."""

import pytest

from tests.architecture.measure import figures, recorded


@pytest.mark.long
def test_no_figure_gets_worse_than_recorded():
    found, before = figures(), recorded()
    table = "\n".join(f"{name:45} {value:>7,} {before[name]:>7,} recorded" for name, value in found.items())
    print(table)
    assert found.keys() == before.keys()
    worse = {name: value for name, value in found.items() if value > before[name]}
    assert not worse, table
