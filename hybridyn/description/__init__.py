"""Everything that reads or writes files; each robot format has one reader that returns the plain `Description`."""
