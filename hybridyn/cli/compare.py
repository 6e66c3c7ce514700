"""`hybridyn compare`: what other engines make of a robot."""

import json
import math
from dataclasses import asdict

import click

from ..studies.compare.compare import Comparison, as_text, compare
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
    click.echo(json.dumps(_facts(found), indent=2) if as_json else as_text(found))
    failed = {"ignored": bool(found.ignored), "different": bool(found.ignored or found.different)}
    return FAILED if failed.get(fail_on) else 0


def _facts(found: Comparison) -> object:
    """Return the comparison as values of JSON; infinite numbers become None."""

    def plain(value: object) -> object:
        """Replace tuples by lists and numbers that are not finite by None, at any depth."""
        if isinstance(value, dict):
            return {key: plain(one) for key, one in value.items()}
        if isinstance(value, list | tuple):
            return [plain(one) for one in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return plain(asdict(found) | {"ignored": found.ignored, "different": found.different})
