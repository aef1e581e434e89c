"""Machine code for core formulas: a formula becomes a function in C, which the machine's own C compiler turns into a
library. No torch here; without a compiler, everything else works as before."""

from scenegen.learn.native.kernel import MOST_LINES, Kernel, NativeError, make_kernel
from scenegen.learn.native.numbers import TooLargeError

__all__ = ["MOST_LINES", "Kernel", "NativeError", "TooLargeError", "make_kernel"]
