"""Run the command line: `python -m hybridyn`."""

import sys

from .cli import main

sys.exit(main())
