"""Run the command line: `python -m hybridyn`."""

import sys

from .cli import main

if __name__ == "__main__":  # worker processes import this module
    sys.exit(main())
