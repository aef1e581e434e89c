"""Random numbers for compiled code: xorshift64* (Marsaglia 2003; Vigna 2016), the state an array of one number.

numba's own generator is one for all calls of a thread; a run that carries its own gives the same numbers on any thread.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from experiments.tabular.jit import compiled

State = npt.NDArray[np.uint64]


def seeded(seed: int) -> State:
    """A state for every seed, mixed by numpy's SeedSequence; never 0, which xorshift does not leave."""
    return np.random.SeedSequence(seed).generate_state(1, np.uint64) | np.uint64(1)


@compiled
def bits(state: State) -> int:
    """64 random bits as an unsigned number; moves the state on."""
    x = state[0]
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    state[0] = x
    return x * np.uint64(0x2545F4914F6CDD1D)  # type: ignore[no-any-return]


@compiled
def below(state: State, count: int) -> int:
    """A number from 0 to count - 1; count below 2^31, so that the bias is below 2^-31 * count."""
    return (field(bits(state), 33, 31) * count) >> 31


@compiled
def field(draw: int, place: int, width: int) -> int:
    """Some of the bits that were drawn, as a number with a sign."""
    return np.int64((draw >> np.uint64(place)) & np.uint64((1 << width) - 1))  # type: ignore[return-value]


@compiled
def share(state: State) -> float:
    """A number in [0, 1), from 53 bits."""
    return float(bits(state) >> np.uint64(11)) * (1.0 / 9007199254740992.0)
