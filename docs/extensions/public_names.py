"""The directive `public-names`: every public name of hybridyn, from its docstring."""

from __future__ import annotations

import inspect
import re
from typing import TYPE_CHECKING, Any

from sphinx.util.docutils import SphinxDirective

import hybridyn

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

VERBS, RECORDS, ERRORS = "Functions", "Classes", "Errors"


def public_names() -> dict[str, list[str]]:
    """Return the public names of hybridyn by kind."""
    found: dict[str, list[str]] = {VERBS: [], RECORDS: [], ERRORS: []}
    for name in hybridyn.__all__:
        value = getattr(hybridyn, name)
        if inspect.isclass(value):
            found[ERRORS if issubclass(value, Exception) else RECORDS].append(name)
        elif callable(value):
            found[VERBS].append(name)
    return found


class PublicNames(SphinxDirective):
    """All public names, functions first."""

    def run(self) -> list[nodes.Node]:
        """Return a section per kind, each name by autodoc."""
        lines: list[str] = []
        for kind, names in public_names().items():
            lines += [kind, "-" * len(kind), ""]
            for name in names:
                directive = "autofunction" if kind == VERBS else "autoclass"
                lines += [f".. {directive}:: hybridyn.{name}", ""]
                if kind == RECORDS:
                    lines[-1:] = ["   :members:", "   :inherited-members: tuple", ""]
        return self.parse_text_to_nodes("\n".join(lines), allow_section_headings=True)


def plain_names(*event: Any) -> tuple[str | None, str | None]:
    """Return a signature in which types that have a name (`Array`) go by it, inside other types too."""
    arguments, result = (
        text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text) for text in event[-2:]
    )
    return arguments, result


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("public-names", PublicNames)
    app.connect("autodoc-process-signature", plain_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
