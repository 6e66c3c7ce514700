"""The tests: a folder for each room of the package, and what they share.

Helpers are imported as `from tests.x.y import z`. `support` says how tests run and compare, `robots` holds
what they run on, `judges` what they compare with, `oracle` the reference models, `tools` programs to be
started by hand. A helper of one room lies in that room.
"""

from pathlib import Path

#: The clone's folder.
ROOT = Path(__file__).parents[1]
