"""The directive `commands`: a section per command of the command line, from the commands themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click
from docutils import nodes
from sphinx.util.docutils import SphinxDirective

from hybridyn.cli import COMMANDS, commands

if TYPE_CHECKING:
    from sphinx.application import Sphinx

WIDTH = 90  # of the lines of help


def help_of(name: str) -> str:
    """Return what `hybridyn NAME --help` prints."""
    command = commands.get_command(click.Context(commands), name)
    assert command is not None, name
    parent = click.Context(commands, info_name="hybridyn", terminal_width=WIDTH, max_content_width=WIDTH)
    return command.get_help(click.Context(command, info_name=name, parent=parent))


class Commands(SphinxDirective):
    """All commands in the order of `hybridyn --help`."""

    def run(self) -> list[nodes.Node]:
        """Return a section per command."""
        sections: list[nodes.Node] = []
        for name in COMMANDS:
            command = commands.get_command(click.Context(commands), name)
            section = nodes.section(ids=[name], names=[name])
            title = nodes.title()
            title += nodes.literal(text=f"hybridyn {name}")
            section += title
            section += nodes.paragraph(text=command.get_short_help_str(WIDTH) if command else "")
            block = nodes.literal_block(text=help_of(name))
            block["language"] = "text"
            section += block
            self.state.document.note_explicit_target(section)
            sections.append(section)
        return sections


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
