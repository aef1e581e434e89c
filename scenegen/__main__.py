"""`python -m scenegen`."""

import os
import sys

import scenegen

# Python looks for modules in the working folder first, which may have been downloaded: from here on it does not.
if not sys.flags.safe_path and sys.path[0] != os.path.dirname(scenegen.__path__[0]):  # noqa: PTH120 - may be planted
    del sys.path[0]

from scenegen.cli import main

if __name__ == "__main__":
    main()
