"""Machine code for core formulas: a formula becomes a function in C, which the machine's own C compiler turns into a
library. No torch here; without a compiler, everything else works as before."""

from scenegen.native.build import NativeError
from scenegen.native.kernel import Kernel, make_kernel
from scenegen.native.numbers import TooLargeError
from scenegen.native.source import MOST_LINES

__all__ = ["MOST_LINES", "Kernel", "NativeError", "TooLargeError", "make_kernel"]
