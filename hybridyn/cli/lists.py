"""`hybridyn --robots` and `--completion`: list the shipped robots, and print scripts for shells."""

import json

import click
from click.shell_completion import shell_complete

from ..description.shipped import shipped_robots, shown
from .common.options import refuse
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
    refuse((not robots, "this installation has no robots: urdf/ and models/ are missing"))
    rows = [["name", "modules", "motors", "what", "source"]]
    rows += [
        [r.name, str(r.modules or ""), str(r.motors or ""), r.what, r.source or "benchmark mechanism"]
        for r in robots
    ]
    click.echo("\n".join(aligned_rows(rows, right=(1, 2))))


def show_completion(commands: click.Command, shell: str) -> None:
    """Print the script with which a shell completes the commands."""
    click.echo(f"# {WHERE[shell]}")
    shell_complete(commands, {}, "hybridyn", VARIABLE, f"{shell}_source")
