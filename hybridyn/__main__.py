"""`python -m hybridyn`: the command line."""

import sys

from hybridyn.cli import main

sys.exit(main())
