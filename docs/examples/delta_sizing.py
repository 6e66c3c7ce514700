"""Which arms and which height should a Delta have that picks and places 0.3 m apart in 0.6 s?

A sweep draws designs, lets each follow the path, and measures what its motors need. The study states
lengths as expressions, so that compiled models compute thousands of designs at once. The best designs trade
torque for speed: `hybridyn sweep` prints them with `--best "peak_effort, peak_speed"`.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from delta_pick_and_place import half
from pictures import COLOURS, INK, Options, figure, options, plain, row, save, snapshots

import hybridyn
from hybridyn.studies.sweep.best import find_best
from hybridyn.studies.sweep.shards import read_shards

HALF_CYCLE = 0.3  # [s]
ROWS = 31
PARAMETERS = {
    "base_radius": (0.14, 0.26), "platform_radius": (0.04, 0.10), "arm_length": (0.22, 0.38),
    "height": (0.55, 0.75),
}  # fmt: skip
MEASURES = ("peak_effort", "peak_speed", "rms_effort", "stroke_margin")
STUDY = """[robot]
file = "delta"
[designs]
method = "sobol"
count = {count}
check = 100
seed = 1
[parameters]
{parameters}
[numbers]
{numbers}
[tasks.pick]
trajectory = "path.csv"
measure = {measures}
"""
ARM_PITCH, ROD_SPACING = np.radians(20.0), 0.09  # at home; between the two rods of an arm [m]
ROD = (
    f"sqrt((base_radius + {float(np.cos(ARM_PITCH))!r} * arm_length - platform_radius)**2"
    f" + (height - {float(np.sin(ARM_PITCH))!r} * arm_length)**2)"
)


def cylinder(link: str, mass: float, radius: float, length: str) -> dict[str, str]:
    """Return the numbers of a cylinder along x."""
    across = f"{mass!r} * ({3 * radius**2!r} + ({length})**2) / 12"
    inertia = {f"inertia:{link}.{axis}": across for axis in ("yy", "zz")}
    return {f"centre:{link}.x": f"{length} / 2", **inertia}


def numbers() -> dict[str, str]:
    """Return the numbers of a Delta as expressions of the parameters, as in `urdf/modules/delta.xacro`."""
    out = {"position:m1_arm1_rod_a_wrist_mount.x": "-platform_radius"}
    for i in (1, 2, 3):
        arm, angle = f"m1_arm{i}", 2 * np.pi * (i - 1) / 3
        c, s = float(np.cos(angle)), float(np.sin(angle))
        out[f"position:{arm}_drive.x"] = f"{c!r} * base_radius"
        out[f"position:{arm}_drive.y"] = f"{s!r} * base_radius"
        out |= cylinder(f"{arm}_link", 0.8, 0.018, "arm_length")
        for side, letter in ((1, "a"), (-1, "b")):
            rod, aside = f"{arm}_rod_{letter}", side * ROD_SPACING / 2
            out[f"position:{rod}_cross_y.x"] = "arm_length"
            out |= cylinder(rod, 0.12, 0.006, ROD)
            if (i, letter) == (1, "a"):
                out[f"position:{rod}_wrist_y.x"] = ROD
                continue
            out[f"position:{rod}_ball/successor.x"] = ROD
            out[f"position:{rod}_ball/predecessor.x"] = f"{c!r} * platform_radius - {aside * s!r}"
            out[f"position:{rod}_ball/predecessor.y"] = f"{s!r} * platform_radius + {aside * c!r}"
    return out


def write_study(folder: Path, count: int) -> Path:
    """Write the path of the platform, there and back, and the study."""
    position, velocity, acceleration = half(ROWS, HALF_CYCLE, 1.0)
    t = np.linspace(0.0, HALF_CYCLE, ROWS)
    columns = {"time": np.concatenate([t, t[1:] + HALF_CYCLE])}
    back = half(ROWS, HALF_CYCLE, -1.0)
    for name, there, again in zip(
        ("pose", "velocity", "acceleration"), (position, velocity, acceleration), back, strict=True
    ):
        for axis in "xyz":
            columns[f"m1_platform/{name}/{axis}"] = np.concatenate([there[axis], again[axis][1:]])
    np.savetxt(folder / "path.csv", np.column_stack(list(columns.values())), "%.9f", ",",
               header=",".join(columns), comments="")  # fmt: skip
    ranges = "\n".join(f"{name} = {{ range = {list(bounds)} }}" for name, bounds in PARAMETERS.items())
    path = folder / "study.toml"
    lines = "\n".join(f'"{name}" = "{text}"' for name, text in numbers().items())
    path.write_text(STUDY.format(count=count, parameters=ranges, numbers=lines, measures=list(MEASURES)))
    return path


def main(words: list[str] | None = None) -> None:
    """Evaluate the designs, and draw the trade of torque for speed."""
    asked = options(__doc__, words, ("designs", 100_000, 2))
    with tempfile.TemporaryDirectory() as place:
        study, results = write_study(Path(place), asked.number), Path(place, "results")
        state = hybridyn.sweep(study, results, jobs=1 if asked.short else None)
        print(f"{state.checked} designs compared with robots built for them: {state.difference:.1e} apart")
        draw(results, asked)


def draw(results: Path, asked: Options) -> None:
    """Draw the designs of a folder of results; those on the Pareto front stand out."""
    frame = read_shards(results).fill_null(np.nan)
    found = find_best(results, "peak_effort, peak_speed", "stroke_margin > 0.05")
    rows = {name: frame[name].to_numpy() for name in (*PARAMETERS, *MEASURES)}
    ok = frame["status"].to_numpy() == "ok"
    front = {name: np.array([line[i] for line in found.front]) for i, name in enumerate(found.columns)}
    print(f"{len(ok)} designs: {int(ok.sum())} follow the path, {len(found.front)} are on the Pareto front")
    good = rows["stroke_margin"] > 0.05
    for effort, speed in zip(front["peak_effort"], front["peak_speed"], strict=True):
        assert not (good & (rows["peak_effort"] < effort) & (rows["peak_speed"] < speed)).any()

    picture = figure(8.4, 5.4)
    ends = (0, len(found.front) // 2, len(found.front) - 1)
    views = row(picture, 3, 0.5, 0.44, views=True)
    for axis, i in zip(views, ends, strict=True):
        arguments = {name: repr(float(front[name][i])) for name in PARAMETERS}
        robot = hybridyn.load("delta", xacro_args=arguments)
        snapshots([axis], robot, [robot.home], turn=-np.pi / 2 + 0.6, lift=0.35)
        axis.set_title(
            f"{front['peak_effort'][i]:.1f} N m, {front['peak_speed'][i]:.1f} rad/s", fontsize=9, color=INK
        )
    dot = 3 if len(ok) < 1000 else 0.5
    trade, arms, heights = row(picture, 3, 0.1, 0.33)
    trade.plot(
        rows["peak_effort"][good], rows["peak_speed"][good], ".", ms=dot, color="#b8bec6", rasterized=True
    )
    trade.plot(front["peak_effort"], front["peak_speed"], ".-", color=COLOURS[1], lw=1)
    plain(trade, "peak speed over peak torque", "[rad/s]", "[N m]")
    for axis, name in ((arms, "arm_length"), (heights, "height")):
        axis.plot(rows[name][ok], rows["peak_effort"][ok], ".", ms=dot, color="#b8bec6", rasterized=True)
        axis.plot(front[name], front["peak_effort"], ".", color=COLOURS[1])
        plain(axis, f"peak torque over {name.replace('_', ' ')}", "[N m]", "[m]")
    print(save(picture, asked, "delta_sizing"))


if __name__ == "__main__":
    main()
