"""The report's texts, tables and numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

HEAD = """\
# Benchmarks

`python -m benchmarks --full` generates this report from the tables in [results](results); do not edit it.
It compares hybridyn with other libraries (the *peers*): computing time against error, on the same states of
the same robots, each method over a range of its settings. An error is the difference from a reference whose
own error is smaller and stated. A model that is wrong is not timed.

- *hybridyn, general*: `hybridyn.ddm`, `idm`. *hybridyn, compiled*: `hybridyn.compile(robot)`, C for one
  robot; *float32*: in single precision.
- *pin.constraintDynamics*, *pin.lcaba*: Pinocchio's solvers of loops, over mu and iterations.
- *pin.rnea + projection*: efforts of the spanning tree, projected through the closures of all modules at once
  (*dense*) or of each. *pin.rnea, loops open* computes another robot; its time is a floor.
- *MuJoCo*: equality constraints, over impedance and iterations. *dense null space*: hybridyn's oracle.

Times are those of a Python caller on one thread; arrays are converted within them. "In a batch" is the time
per sample of a call with many. Ratios are hybridyn's time over the peer's; **bold: hybridyn is slower**.
"""

AGAINST = """\
Each robot with the fastest peer that is good to 1e-10, else with the most exact one. Times in us, and ratios.
"""

LOSSES = """\
Each engine against the fastest peer, which takes one sample per call. The general path is made for arrays: a
call with one sample spends milliseconds in Python. `hybridyn.compile` takes seconds, once for each robot.
"""

GOALS = """\
What the project wants of its times and of the programs around its models; only what is missed has a line.
"""

EFFECTS = """\
Along the robot's own motion: the largest change of any motor's effort without the effect, relative to the
motor's largest effort, and the part of the compiled model's operations that the effect takes. The same as
`hybridyn cost` states for a robot of your own. Effects with small changes and large shares can be left out.
"""

GROWN = """\
Compiled models of which every joint with a motor rubs in proportion to its load, or has a gear that loses a
tenth, over models without: operations, and times of batches in one run. Iterations are steps of Newton's
method in each sample, of `ddm` over several modules sweeps; `idm` needs none where the motor of each joint
balances its friction. Errors are those against the general path.
"""

SINGULAR = """\
Relative error by distance from the singular posture [rad], each method at its best setting there. The
reference has 60 digits.
"""

COLD = """\
A controller calls once a millisecond, and other programs use the caches in between. 40 MB are touched before
each of some hundred calls; "cold" is the median of their times, "hot" the least time of calls in a row. Code
is the size of the file that was compiled for the robot.
"""

BATCHES = """\
The most samples a second on a GPU, of how many: models of `hybridyn.warp` by the type of their numbers, and
steps of MuJoCo Warp, whose samples are worlds and whose numbers have single precision, with the largest
opening of a loop after them. Beside them compiled models on the 16 cores of that machine in double precision
(`step`: one core), and how long NVRTC builds a model for sm_80 and sm_90, which needs no GPU. `python -m
benchmarks.batches` measures them. The time on the card ended early: MuJoCo Warp was measured on five_bar
alone; `close` was measured when one thread closed all modules of a sample.

Rows in full: [batches.csv](results/batches.csv).
"""

DERIVATIVES = """\
Processor time of a sample [us], with ratios to Pinocchio's. `computeConstraintDynamicsDerivatives` needs
`constraintDynamics`, which is not counted. In Pinocchio 4.1.0 one column of its derivatives over q is wrong
where a loop is closed by points between moving bodies and the robot's first coordinate is a rotation, as in
all robots with loops here: hence their errors. The passes that spoil it are part of its time. Loops closed by
welds, and derivatives over v, are right (`tests/benchmarks/test_pinocchio_derivatives.py`).
"Over motors" are derivatives along which the loops stay closed, 24 by 72 numbers of the LX4 instead of 84 by
192; Pinocchio has none.
"""

SWEEPS = """\
Sweeps of the five-bar by the general path (`--engine general`). Processor times are those of all child
processes. With one process, loky computes in the program itself.
"""

SEARCHES = """\
A five-bar leg pushes itself off, and the objective is the energy that this takes: work of the motors, and
heat of their windings. Seven parameters: lengths, stance, and the ratios of the gears, whose mass the leg
lifts. Bounds, masses of links and of actuators by their ratio, the motor (one of six there) and the settings
of CMA-ES (`cma` 4.5) are those of a published case, [arXiv 2604.06025](https://arxiv.org/abs/2604.06025),
which searches by CMA-ES for a jump in a simulation with contacts. Ours are the push, that no design changes,
this energy, the rotors' inertia, and how far ahead the foot stands. SciPy's SLSQP has the study's gradients,
from the same starts. A design with gradients counts as six without: it has four times the operations, and
its processor time stands below.
"""

SHOOTING = """\
A leg moves its hip, its knee and the two motors of its parallel ankle in half a second with small efforts,
by differential dynamic programming in 25 steps over the motors, the loops closed inside: iterations until
the efforts are within 1e-6 (of 20 N m, in the ankle 8) of those that exact DDP ends with, from five first
guesses. First derivatives are exact in all. *Gauss-Newton* leaves out the second ones of the dynamics, as
FDDP of Crocoddyl 3.2.1 does, whose steps are the same to three digits; *exact* has them. It ends
quadratically, in fewer iterations, of which each takes longer: the dynamics of a leg are that cheap.
Processor time counts all iterations, those beyond 1e-6, too. The solver is `benchmarks/ddp.py`; the robot is
ours.
"""

MODULES = """\
Time per sample [us] of stacks of 6-UPS modules, in a process of its own for each number; "growth" is fitted
from 4 modules on. Snakes are in the figure and in the file.
"""

TOOLS = """\
The pose of the outermost platform of a stack in its root, six numbers for six freedoms a module: the general
path closes all loops by the rule of least motion. Processor time of rows of 1 mm, one after the other. The
same in C, for the LX4, is in programs.csv.
"""

SIMULATION = """\
The fastest run whose final state has at most the given error; wall time, for scenes with controllers
processor time per simulated second. Motors push with constant efforts. Peers are RK4 in Python, and MuJoCo.
The excavator follows a reference by computed torque; MuJoCo has no inverse model of it and receives the
efforts of the reference, prepared before, with proportional-derivative control about it.
"""

THROUGHPUT = """\
Time per sample [us] of the LX4 by number of samples per call; peers are called in a loop. What remains to one
core's rate of multiplications and additions is in peak.csv.
"""

PROGRAMS = """\
Processor times, the least of several; of a cold start, which builds in two processes, by the clock. A control
step takes the motors' motion and the last posture, and gives efforts. Controllers follow a small motion of
all motors; a law in Python is asked in each stage of a step.
"""

LIMITS = """\
## Machine and limits

- The machines are virtual and shared. Times differ by 10 to 20 % from run to run, and by up to a factor of
  two from hour to hour: compare times of one section. Calls are interleaved, so that ratios differ by less.
- Errors are the largest over two to four states of a smooth motion near home, relative to the largest entry.
- Caches and branch predictors are warm, but for cold calls.
- A call from C or C++ takes one to a few microseconds less, whoever is called.
- A peer's one number is that of its best setting, which a user does not know beforehand. Where modules are
  counted and in simulations, peers have one setting.
- MuJoCo's closures are soft by design, and it leaves out J_dot v. Its error here does not say how good it is
  for contacts. It has no inverse model with passive joints.
- Pinocchio knows closures at points and welds. The five-bar's hinge is given to it, and to MuJoCo, as a
  point, which is equivalent in the plane. Robots with other closures only hybridyn could compute.
- Pinocchio's Data holds nv^3 numbers: not tried above 400 velocities, 19 stacked modules.
- A compiled model closes the loops in every stage of a step; runs that leave them open take the general path.
- Models and references are compared before any time is measured, and a wrong one is not timed: rows "check".
- Instructions are counted by valgrind's callgrind, for four lanes of AVX2; those of Python vary by 0.1 %.
"""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Write a Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    escaped = ([cell.replace("|", "\\|") for cell in line] for line in lines)
    return "\n".join(f"|{'|'.join(line)}|" for line in escaped) + "\n"


def number(value: float) -> str:
    """Write a number with three digits, empty for NaN."""
    if math.isnan(value):
        return ""
    if value == 0:
        return "0"
    return f"{value:.1e}" if abs(value) < 1e-3 else f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
