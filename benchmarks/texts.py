"""The report's texts."""

from __future__ import annotations

HEAD = """\
# Benchmarks

`python -m benchmarks --full` generates this report from the tables in [results](results); do not edit it.
The report shows computing time against error for hybridyn and for other libraries (the *peers*). All methods
are measured in the same run, on the same states of the same robots, each over a range of its settings. Every
error is the difference from a reference whose own error is smaller and stated. hybridyn's errors are checked
before any time is measured. In every figure, results nearer the lower left corner are better.
"""

STANDING = """\
The table compares hybridyn's fastest engine with the fastest peer that computes the same quantity with an
error of at most 1e-10. If no peer reaches this error, the most exact peer is taken. The first ratio is for
one sample per call. The second ratio is for a batch, with one call per sample for the peer. hybridyn is
faster if the ratio is below 1; **ratios above 1, where hybridyn is slower, are bold**.
"""

LOSSES = """\
The table compares each engine with the fastest peer of the table above; the peer takes one sample per call.
The general path is made for arrays: with one sample per call it spends milliseconds in Python, for any
robot. The section on simulation names the fastest method for each simulation. `hybridyn.compile` itself
takes seconds, once for each robot.
"""

FLOWN = """\
The fastest run, over all steps and tolerances, whose final state has at most the given error:
"""

CONTROLLED = """\
Processor time per simulated second, with outputs at 100 Hz. The governor's stiff springs and dampers hold
explicit methods to steps below 0.7 ms; before steps were chosen in C (commit ca76b5c), its scene took 12
times as long, 0.36 s per second on the same machine. The excavator's four motors follow a reference by
computed torque, from a start on the reference. With the law in Python, the general path computes its
inverse model, as it did before controllers ran in C. MuJoCo has no inverse model of a closed robot: it
receives the efforts of the reference, prepared before the clock starts, and proportional-derivative control
about it, some 5 us a step in NumPy; the exact motion is the same.
"""

THROUGHPUT = """\
Time per sample [us]. Peers are called once for each sample. The shortest time of many rounds counts, for
every method.
"""

DERIVATIVES = """\
Processor time of one sample [us]: `idm_jacobian`, `ddm_jacobian`, and Pinocchio's derivatives. Times of
`computeConstraintDynamicsDerivatives` leave out `constraintDynamics`, which it needs. "Given arrays" are
filled again by each call, as Pinocchio's data are. Operations are those of one sample, beside the model's;
dense products grow with the square of the number of modules, as the result does. The error is that of
the change along a random motion that keeps the loops closed, against differences of the oracle in long
double. In Pinocchio 4.1.0 the derivatives over q of robots with loops differ from differences of its
own `constraintDynamics`, which agree with the oracle: for these robots the ratio compares times alone.
"""

OVER_MOTORS = """\
Rows "over motors" give fewer numbers: derivatives of the motors' accelerations (or efforts) over the motors'
positions, rates and efforts (or accelerations), along which the loops stay closed. Of the LX4 that is 24 by
72 numbers instead of 84 by 192, all that a controller or an optimiser in these coordinates reads. Pinocchio
has no such derivatives: its function computes those of all joints and of the loops' forces, which would have
to be projected afterwards.
"""

METHODS = """\
## What is compared

| method | what it is |
| --- | --- |
| hybridyn, general | `hybridyn.ddm`, `idm`: Pinocchio per module, NumPy over the batch |
| hybridyn, compiled | `hybridyn.compile(robot)`: straight-line C for one robot |
| hybridyn, compiled, float32 | the same in single precision |
| pin.constraintDynamics | Pinocchio's sparse KKT solver, for a range of mu and iterations |
| pin.lcaba | Pinocchio's loop-constrained articulated-body algorithm, for a range of mu and iterations |
| pin.rnea + projection, dense | `pin.rnea` of the spanning tree, one solve with all closure rows |
| pin.rnea + projection, per module | the same, with a small solve for each module |
| pin.rnea, loops open | `pin.rnea` of the tree without closures, a lower bound of the time: another robot |
| MuJoCo | the same robot as MJCF with equality constraints, for a range of impedance, iterations, solref |
| dense null space | hybridyn's oracle in double precision: maximal coordinates, singular values |
| pin.aba, pin.rnea | for the robot without loops |

Times are those of a Python caller. A call takes q, v and tau (or a) of the spanning tree and returns
accelerations (or efforts); the conversion of arrays is included. Peers take one sample per call. "One call"
is the time of a call with one sample; "batch" is the time per sample of a call with many. Calls are
interleaved in random order over several rounds. The shortest time counts; the medians are in the CSV files.
Every method uses one thread, unless a table says otherwise.
"""

SINGULAR = """\
Relative error against the distance from the singular posture, with the best setting of every method at each
distance. The reference has 60 digits. Closing the loops to the last of these digits changes the result by
less than 1e-15.
"""

JOB = """\
`hybridyn idm urdf/lx4.urdf.xacro TABLE -o efforts.csv` reads the poses of four platforms, assembles the
robot and writes 24 efforts per row. The time is that of the whole program. Goal: 10,000 rows in 5 s on two
cores.
"""

CALLGRIND = """\
Instructions per sample, counted by valgrind's callgrind (optional: `apt-get install valgrind`). The column
"instructions" includes those of Python, which vary by 0.1 % from run to run. The column "in its own library"
counts those in the library that was compiled for the robot, which are the same in every run. Valgrind does
not support AVX-512, so the compiled models use four lanes of AVX2 for these counts. The times are from the
sections above, with the vector width of this machine. Pinocchio's solvers have one setting here, the fastest
with an error of at most 1e-10 on the LX4.
"""

LIMITS = """\
## Limits of these measurements

- The machine is virtual and shared. Times differ by 10 to 20 % from run to run, and by up to a factor of two
  from hour to hour: compare times of one section only. Ratios differ by less, because calls are
  interleaved. "Load before" below is the load of the machine before each section.
- Errors are the largest over two to four states of a smooth motion near home, relative to the largest entry
  of the result. Other motions have other errors; the section on singular postures shows how large they can
  become.
- The same states are used again and again, so that caches and branch predictors are warm for every method.
- Every method is called from Python. A call from C or C++ takes one to a few microseconds less.
- One number for a peer with several settings is that of its fastest setting with an error of at most 1e-10
  on these states. A user does not know this setting beforehand.
- MuJoCo's closures are soft by design, and MuJoCo leaves out the term J_dot v. Its error here does not tell
  how good it is for contacts. It has no inverse model with passive joints.
- `pin.constraintDynamics` and `pin.lcaba` support closures at points and welds only. The five-bar's hinge
  is given to them as a point, which is equivalent in the plane. Robots with other closures are left out of
  this comparison, because only hybridyn could compute them.
- Pinocchio's Data contains tensors of nv^3 numbers. It is not measured above 400 velocities (19 stacked
  modules).
- In the section on the number of modules every point is measured in a process of its own. Its times are
  therefore not interleaved, and peers have one setting there. Memory is the growth of the process from the
  loaded robot to the end of the calls.
- Simulations of peers are RK4 in Python with one call per stage; hybridyn's simulations include its checks
  and outputs. Pinocchio's solvers have one setting there, the fastest with an error of at most 1e-10 on
  these robots.
- A compiled model closes the loops in every stage of a simulation. Simulations that leave the loops open
  use the general path, so the tables have no compiled row for them.
- The LX4 is the stack of four modules; it is not measured twice.
- The tail of the snakes is held, so that every peer can compute them.
"""

PEAK = """\
The number of operations of one sample (a fused multiply-add counts as two), divided by its time in a batch
on one thread, beside the highest rate of one core. That rate is measured in the same run, with independent
multiply-adds on full vectors. The rest of the time is spent on quotients, sines, loads and operations that
wait for the results of others. The rate of all cores of this machine together is {cores:.2f} times their
number times the rate of one core; threads cannot scale better than this.
"""

REACHED = """\
### Around the models

Goals of what a user's program waits for; the section "Around the models" says how it was measured.
"""

PROGRAMS = """\
What a user's program waits for around the models. Times are processor times, the least of several runs; the
time of a cold start is wall time, because it builds in two processes. Operations are those of one expression
with common terms computed once. `hybridyn idm` reads poses of the LX4's platforms, on one core, with a model
that was built before; importing Pinocchio alone is shown beside it. Controllers follow a small motion of all
motors; a law in Python is asked in each of the four stages of a step. A control step takes the motion of the
motors' encoders and the last posture, and gives their efforts.
"""
