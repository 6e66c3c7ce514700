"""`hybridyn --robots` and `--completion`: list the shipped robots, and print scripts for shells."""

import json

import click
from click.shell_completion import get_completion_class

from ..description.shipped import shipped_robots, shown
from . import commands
from .common.text import aligned_rows

VARIABLE = "_HYBRIDYN_COMPLETE"
WHERE = {
    "bash": 'eval "$(hybridyn --completion bash)" in ~/.bashrc',
    "zsh": 'eval "$(hybridyn --completion zsh)" in ~/.zshrc, after compinit',
    "fish": "hybridyn --completion fish > ~/.config/fish/completions/hybridyn.fish",
}


def show_robots(form: str) -> None:
    """Print the shipped robots, as "text" or, with the paths of their files, as "json"."""
    robots = shipped_robots().values()
    if form == "json":
        facts = [
            {
                "name": robot.name,
                "what": robot.what,
                "benchmark": robot.is_benchmark,
                "modules": robot.modules,
                "motors": robot.motors,
                "source": robot.source,
                "file": shown(robot.file),
                "trajectory": robot.trajectory and shown(robot.trajectory),
                "scenes": [shown(scene) for scene in robot.scenes],
            }
            for robot in robots
        ]
        click.echo(json.dumps(facts, indent=2))
        return
    rows = [["name", "modules", "motors", "what", "source"]]
    rows += [
        [r.name, str(r.modules or ""), str(r.motors or ""), r.what, r.source]
        for r in robots
        if not r.is_benchmark
    ]
    lines = aligned_rows(rows, right=(1, 2))
    mechanisms = [[robot.name, robot.what] for robot in robots if robot.is_benchmark]
    if mechanisms:
        lines += ["", "benchmark mechanisms:", *aligned_rows(mechanisms)]
    click.echo("\n".join(lines))


def show_completion(shell: str) -> None:
    """Print the completion script of a shell."""
    script = get_completion_class(shell)
    assert script is not None
    click.echo(f"# {WHERE[shell]}")
    click.echo(script(commands, {}, "hybridyn", VARIABLE).source())
