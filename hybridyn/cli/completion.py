"""`hybridyn --completion`: print the script with which a shell completes commands, options and robots."""

from __future__ import annotations

import os

import click

VARIABLE = "_HYBRIDYN_COMPLETE"
SHELLS = ("bash", "zsh", "fish")
WHERE = {
    "bash": 'eval "$(hybridyn --completion bash)" in ~/.bashrc',
    "zsh": 'eval "$(hybridyn --completion zsh)" in ~/.zshrc, after compinit',
    "fish": "hybridyn --completion fish > ~/.config/fish/completions/hybridyn.fish",
}


def show_completion(shell: str) -> None:
    """Print the completion script of a shell, "" for that of $SHELL.

    Raises:
        click.UsageError: It has none.
    """
    from click.shell_completion import get_completion_class

    from . import commands

    shell = shell or os.path.basename(os.environ.get("SHELL", ""))
    script = get_completion_class(shell) if shell in SHELLS else None
    if script is None:
        raise click.UsageError(f"name a shell: {', '.join(SHELLS)}")
    click.echo(f"# {WHERE[shell]}")
    click.echo(script(commands, {}, "hybridyn", VARIABLE).source())
