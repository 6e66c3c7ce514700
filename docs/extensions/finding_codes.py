"""The directive `codes`: a table of the codes of findings, from the codes themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from hybridyn.studies.check.finding import CODES

if TYPE_CHECKING:
    from sphinx.application import Sphinx


class Codes(SphinxDirective):
    """All codes in the order of the checks."""

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        rows = [f"| `{code}` | {severity} | {title} |" for code, (severity, title) in CODES.items()]
        return self.parse_text_to_nodes("\n".join(["| code | severity | meaning |", "|---|---|---|", *rows]))


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("codes", Codes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
