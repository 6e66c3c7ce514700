"""`hybridyn compare`: what other engines make of a robot."""

from dataclasses import asdict

import click
import orjson

from ..studies.compare.compare import as_text, compare
from .common.options import RobotChoice

#: Exit status where an engine fails what --fail-on asks for.
FAILED = 1


def run(
    load: RobotChoice,
    engines: tuple[str, ...],
    samples: int,
    seed: int,
    tolerance: float,
    as_json: bool,
    fail_on: str,
) -> int:
    """Compare a robot in other engines, and return the exit status."""
    found = compare(
        load(),
        engines,
        samples=samples,
        seed=seed,
        tolerance=tolerance,
        xacro_args=load.xacro_args or None,
        package_dirs=load.package_dirs,
    )
    failed = {"ignored": found.ignored, "different": found.different}
    if as_json:  # infinite numbers become null
        facts = orjson.dumps(asdict(found) | failed, option=orjson.OPT_INDENT_2 | orjson.OPT_SERIALIZE_NUMPY)
    click.echo(facts.decode() if as_json else as_text(found))
    asked = {"never": (), "ignored": ("ignored",), "different": failed}[fail_on]
    return FAILED if any(failed[what] for what in asked) else 0
