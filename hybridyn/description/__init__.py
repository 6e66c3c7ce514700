"""Everything that reads or writes files; each robot format has one reader that returns a `Description`."""

from hybridyn.description.reading import read
from hybridyn.description.records import Closure, Coupling, Description, Joint, Link

__all__ = ["Closure", "Coupling", "Description", "Joint", "Link", "read"]
