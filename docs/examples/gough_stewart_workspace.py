"""Which Gough-Stewart platform has the largest workspace, if its legs have a stroke of 0.4 m?

A sweep draws radii, angles and heights, and floods the workspace of each design over a lattice. The largest
ones are worth nothing near a singularity, so the best is searched among those that stay well conditioned.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from pictures import COLOURS, INK, figure, options, plain, row, save, snapshots

import hybridyn
from hybridyn.studies.sweep.best import find_best
from hybridyn.studies.sweep.shards import read_shards
from hybridyn.studies.workspace.workspace import Workspace, workspace

STEP, FINE = 0.1, 0.05  # of the lattice [m]
STROKE = 0.4  # of the legs [m]
LEAST = 0.1  # conditioning
PARAMETERS = {
    "base_radius": (0.35, 0.65), "base_half_angle": (5.0, 30.0), "platform_radius": (0.15, 0.45),
    "platform_half_angle": (30.0, 55.0), "height": (0.5, 0.9),
}  # fmt: skip
STUDY = """[robot]
file = "gough_stewart"
[designs]
method = "latin_hypercube"
count = {count}
seed = 1
[parameters]
{parameters}
[tasks.space]
workspace = {{ axes = ["x", "y", "z"], steps = {{ x = {step}, y = {step}, z = {step} }} }}
measure = ["size", "min_conditioning"]
"""


def flooded(arguments: dict[str, str], step: float) -> tuple[hybridyn.HybridRobot, Workspace]:
    """Return a robot and its workspace of translations."""
    robot = hybridyn.load("gough_stewart", xacro_args=arguments or None)
    return robot, workspace(robot, axes=["x", "y", "z"], steps=dict.fromkeys("xyz", step))


def highest(arguments: dict[str, float]) -> float:
    """Compute the height at which six legs are fully out, the platform above the centre [m]."""
    base, platform = arguments["base_radius"], arguments["platform_radius"]
    angle = np.radians(arguments["platform_half_angle"] - arguments["base_half_angle"])
    aside2 = base**2 + platform**2 - 2 * base * platform * np.cos(angle)
    longest = np.sqrt(arguments["height"] ** 2 + aside2) + STROKE / 2
    return float(np.sqrt(longest**2 - aside2))


def main(words: list[str] | None = None) -> None:
    """Flood the workspaces, and draw the largest one."""
    asked = options(__doc__, words, ("designs", 32, 3))
    ranges = "\n".join(f"{name} = {{ range = {list(bounds)} }}" for name, bounds in PARAMETERS.items())
    with tempfile.TemporaryDirectory() as place:
        study = Path(place, "study.toml")
        study.write_text(STUDY.format(count=asked.number, parameters=ranges, step=STEP))
        state = hybridyn.sweep(study, Path(place, "results"), jobs=1 if asked.short else None)
        frame = read_shards(Path(place, "results")).fill_null(np.nan)
        condition = f"min_conditioning > {0 if asked.short else LEAST}"
        found = find_best(Path(place, "results"), "-size", condition, top=1)
    best = dict(zip(found.columns, found.rows[0], strict=True))
    rows = {name: frame[name].to_numpy() for name in (*PARAMETERS, "size", "min_conditioning")}
    step = STEP if asked.short else FINE
    chosen = {name: best[name] for name in PARAMETERS}
    large, space = flooded({name: repr(value) for name, value in chosen.items()}, step)
    usual, before = flooded({}, step)
    pace = state.work / max(state.now, 1) * 1e3
    print(
        f"{state.done} designs, {pace:.0f} ms each; shipped {before.size:.3f} m^3, best {space.size:.3f} m^3"
    )
    print(", ".join(f"{name} {value:.3g}" for name, value in chosen.items()))
    top = space.coordinates[:, 2].max()
    assert top <= highest(chosen) + 1e-9
    assert asked.short or space.size > before.size

    picture = figure(8.4, 5.6)
    views = row(picture, 2, 0.5, 0.44, views=True)
    for axis, robot, name in ((views[0], usual, "shipped"), (views[1], large, "largest workspace")):
        snapshots([axis], robot, [robot.home], lift=0.25)
        axis.set_title(name, fontsize=9, color=INK)
    sizes, angles, slices = row(picture, 3, 0.1, 0.33)
    good = rows["min_conditioning"] > LEAST
    for axis, x, across in (
        (sizes, rows["base_radius"] - rows["platform_radius"], "base less platform radius [m]"),
        (angles, rows["height"], "height [m]"),
    ):
        axis.plot(x[~good], rows["size"][~good], ".", ms=3, color="#b8bec6")
        axis.plot(x[good], rows["size"][good], ".", ms=4, color=COLOURS[0])
        plain(axis, "volume; grey: badly conditioned", "[m^3]", across)
    for found_, colour, name in ((before, COLOURS[0], "shipped"), (space, COLOURS[1], "largest")):
        points = found_.coordinates[np.abs(found_.coordinates[:, 1]) < step / 2]
        slices.plot(
            points[:, 0], points[:, 2], "s", ms=4 if colour == COLOURS[1] else 2, color=colour, label=name
        )
    slices.legend(fontsize=7, frameon=False)
    slices.set_aspect("equal")
    plain(slices, "poses with y = 0", "z [m]", "x [m]")
    print(save(picture, asked, "gough_stewart_workspace"))


if __name__ == "__main__":
    main()
