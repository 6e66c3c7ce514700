"""The tests: helpers are imported as `from tests.x import y`, whatever the folder of the test."""

from pathlib import Path

#: The clone's folder.
ROOT = Path(__file__).parents[1]
