"""The fixture of every hard case."""

from tests.hard.claims import claim

__all__ = ["claim"]
