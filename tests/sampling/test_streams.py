"""Random streams have a number each; those that share one did so before there was a table."""

from collections import Counter

from scenegen.sampling import streams

NUMBERS = Counter(number for name, number in vars(streams).items() if name.isupper() and isinstance(number, int))


def test_no_new_stream_has_the_number_of_another():
    assert {number for number, count in NUMBERS.items() if count > 1} == streams.SHARED_NUMBERS
    assert [NUMBERS[number] for number in sorted(streams.SHARED_NUMBERS)] == [3, 2, 2, 2, 4, 2, 2]
