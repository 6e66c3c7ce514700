"""How little force can move an LX4 from one posture to another in half a second?

Direct collocation with CasADi and IPOPT: positions, rates and forces of the 24 motors at the nodes are
unknown, the direct model holds between them (trapezoidal rule), and the sum of squared forces is least. The
accelerations and their derivatives along the loops come from compiled code, all nodes at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import casadi as ca
import numpy as np
from lx4_motor_sizing import PLATFORMS
from pictures import COLOURS, INK, figure, options, plain, row, save, snapshots
from scipy.interpolate import CubicHermiteSpline

import hybridyn
from hybridyn.compiled.derivatives import Derivatives
from hybridyn.errors import HybridynError

DURATION, NODES = 0.5, 9
LEAN = (0.12, -0.06, -0.12, 0.1)  # roll of each platform at the end [rad]
TWIST = 0.2  # yaw of each [rad]
POSITION, RATE, FORCE = 0.05, 0.2, 300.0  # units of the unknowns [m, m/s, N]
ROOM, FASTEST = 0.03, 0.3  # how far from the guess the motors may be [m, m/s]
SLOW = 0.02  # weight of squared rates, so that none is free
KP, KD = 2500.0, 100.0  # of the controller that follows the plan: errors decay with 50 1/s
DAMPING = 0.1  # what stands in the Hessian of the Lagrangian for the curvature of the dynamics
TOLERANCE = 5e-3  # of IPOPT
STEPS = np.repeat([1e-6, 1e-6, 1.0], 24)  # of finite differences [m, m/s, N]


class Dynamics:
    """Accelerations of the motors from x, their positions, rates and forces side by side, shape (T, 72)."""

    def __init__(self, robot: hybridyn.HybridRobot) -> None:
        self.robot, self.compiled = robot, hybridyn.compile(robot)
        self.derivatives = Derivatives(
            robot, "ddm", coordinates="motors"
        )  # as hybridyn.ddm_jacobian prepares

    def states(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Close the loops: q, v and the forces."""
        m, u, tau = np.split(x, 3, axis=1)
        if len(x) > NODES:
            return *self.compiled.close(m, u)[:2], tau
        q, v, last = np.empty((len(x), self.robot.nq)), np.empty((len(x), self.robot.nv)), None
        for t in range(len(x)):  # quicker for a few rows
            q[t], v[t], _ = self.compiled.close(m[t], u[t], last=last)
            last = q[t]
        return q, v, tau

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Compute accelerations, shape (T, 24)."""
        return self.compiled.ddm(*self.states(x))[:, self.robot.motor_v]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Compute their derivatives, shape (T, 24, 72), along motions that keep the loops closed."""
        return np.concatenate(list(self.derivatives(*self.states(x)).values()), axis=2)

    def differences(self, x: np.ndarray) -> np.ndarray:
        """Compute the same by central differences of the compiled model, all in one batch."""
        return self._differences(x, self)

    def one_by_one(self, x: np.ndarray) -> np.ndarray:
        """Compute them by central differences of single calls, each closed from the node's posture."""
        near = np.repeat(self.states(x)[0], 2 * 72, axis=0)

        def model(moved: np.ndarray) -> np.ndarray:
            return np.array([self._one(row, last) for row, last in zip(moved, near, strict=True)])

        return self._differences(x, model)

    def _one(self, x: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Compute accelerations of one state near another posture, shape (24,)."""
        m, u, tau = np.split(x, 3)
        q, v, _ = self.compiled.close(m, u, last=last)
        return self.compiled.ddm(q, v, tau)[self.robot.motor_v]

    def _differences(self, x: np.ndarray, model: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Compute central differences of accelerations, shape (T, 24, 72)."""
        moved = x[:, None] + np.concatenate([np.diag(STEPS), -np.diag(STEPS)])
        values = model(moved.reshape(-1, 72)).reshape(len(x), 2, 72, 24)
        return np.swapaxes((values[:, 0] - values[:, 1]) / (2 * STEPS[:, None]), 1, 2)


class Nodes(ca.Callback):
    """The dynamics at all nodes as a function of CasADi, with its block-diagonal Jacobian."""

    def __init__(self, dynamics: Dynamics, nodes: int, unit: np.ndarray, *, jacobian: bool = False) -> None:
        ca.Callback.__init__(self)
        self.dynamics, self.nodes, self.unit, self.gives = dynamics, nodes, unit, jacobian
        self.kept: list[Nodes] = []  # CasADi does not keep its callbacks
        rows, columns = np.meshgrid(np.arange(24), np.arange(72), indexing="ij")
        places = [(rows + 24 * t, columns + 72 * t) for t in range(nodes)]
        self.pattern = ca.Sparsity.triplet(
            24 * nodes, 72 * nodes, *(np.concatenate([p[i].ravel() for p in places]).tolist() for i in (0, 1))
        )
        self.construct("jacobian" if jacobian else "nodes", {})

    def get_n_in(self) -> int:
        """Return the number of inputs: the unknowns, and for the Jacobian the accelerations, too."""
        return 2 if self.gives else 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Return the shape of an input."""
        return ca.Sparsity.dense((24 if i else 72) * self.nodes, 1)

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        """Return the pattern of the output."""
        return self.pattern if self.gives else ca.Sparsity.dense(24 * self.nodes, 1)

    def eval(self, given: list[ca.DM]) -> list[ca.DM]:
        """Evaluate; postures that the motors cannot reach are not a number, so that IPOPT steps back."""
        x = np.array(given[0]).reshape(self.nodes, 72) * self.unit
        try:
            if not self.gives:
                return [ca.DM(self.dynamics(x).ravel())]
            blocks = self.dynamics.jacobian(x) * self.unit
            return [ca.DM(self.pattern, np.swapaxes(blocks, 1, 2).ravel())]
        except HybridynError:
            return [ca.DM(self.get_sparsity_out(0), np.full(self.get_sparsity_out(0).nnz(), np.nan))]

    def has_jacobian(self) -> bool:
        """Return whether there is a Jacobian."""
        return not self.gives

    def get_jacobian(self, *_: object) -> ca.Function:
        """Return the Jacobian."""
        self.kept.append(Nodes(self.dynamics, self.nodes, self.unit, jacobian=True))
        return self.kept[-1]


def guess(dynamics: Dynamics, goal: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the unknowns of the motion along polynomials of the fifth order, shape (T, 72)."""
    s = t / DURATION
    shape = 10 * s**3 - 15 * s**4 + 6 * s**5
    rate = (30 * s**2 - 60 * s**3 + 30 * s**4) / DURATION
    change = (60 * s - 180 * s**2 + 120 * s**3) / DURATION**2
    start = dynamics.robot.home[dynamics.robot.motor_q]
    m = start + shape[:, None] * (goal - start)
    u, a = rate[:, None] * (goal - start), change[:, None] * (goal - start)
    return np.hstack([m, u, dynamics.compiled.idm(*dynamics.compiled.close(m, u, a))])


def solve(
    dynamics: Dynamics, first: np.ndarray, step: float, most: int
) -> tuple[np.ndarray, dict[str, object]]:
    """Minimise the squared forces; the first and the last state are those of the guess."""
    nodes, unit = len(first), np.repeat([POSITION, RATE, FORCE], 24)
    model = Nodes(dynamics, nodes, unit)
    X = ca.MX.sym("x", 72 * nodes)
    each = ca.reshape(X, 72, nodes)
    m, u, tau = each[:24, :], each[24:48, :], each[48:, :]
    a = ca.reshape(model(X), 24, nodes) / RATE
    weights = np.full(nodes, step)
    weights[[0, -1]] /= 2
    cost = ca.dot(ca.sum1(tau**2 + SLOW / 2 * u**2).T, ca.DM(weights))
    defects = [
        m[:, 1:] - m[:, :-1] - step / 2 * (u[:, 1:] + u[:, :-1]) * RATE / POSITION,
        u[:, 1:] - u[:, :-1] - step / 2 * (a[:, 1:] + a[:, :-1]),
    ]
    g = ca.vertcat(*(ca.vec(part) for part in defects))
    low, high = np.full((nodes, 72), -np.inf), np.full((nodes, 72), np.inf)
    room = np.repeat([ROOM, FASTEST], 24)
    low[:, :48], high[:, :48] = ((first[:, :48] + sign * room) / unit[:48] for sign in (-1, 1))
    low[[0, -1], :48] = high[[0, -1], :48] = (first / unit)[[0, -1], :48]
    weighing = np.repeat([DAMPING, DAMPING, 2.0], 24)[:, None] * weights
    curvature = ca.diag(ca.vec(ca.DM(weighing)))
    symbols = [X, ca.MX.sym("p", 0), ca.MX.sym("s"), ca.MX.sym("l", g.numel())]
    hessian = ca.Function("curvature", symbols, [ca.triu(curvature) * symbols[2]])
    solver = ca.nlpsol(
        "least", "ipopt", {"x": X, "f": cost, "g": g},
        {"hess_lag": hessian, "print_time": False, "show_eval_warnings": False, "ipopt.print_level": 0,
         "ipopt.sb": "yes", "ipopt.max_iter": most, "ipopt.tol": TOLERANCE, "ipopt.constr_viol_tol": 1e-5,
         "ipopt.compl_inf_tol": 1e-2},
    )  # fmt: skip
    found = solver(x0=(first / unit).ravel(), lbx=low.ravel(), ubx=high.ravel(), lbg=0, ubg=0)
    return np.array(found["x"]).reshape(nodes, 72) * unit, solver.stats()


def seconds(call: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> float:
    """Return the least time of a call."""
    times = []
    for _ in range(4):
        start = time.perf_counter()  # clocks of processor time may stand still so long
        call(x)
        times.append(time.perf_counter() - start)
    return min(times)


def main(words: list[str] | None = None) -> None:
    """Optimise, check against a simulation, and draw."""
    asked = options(__doc__, words)
    robot = hybridyn.load("lx4")
    dynamics = Dynamics(robot)
    poses = hybridyn.kinematics(robot, robot.home, np.zeros(robot.nv))
    heights = np.diff([0.0, *(poses[f"m{k}_platform"].pose[2] for k in range(1, 5))])
    still = dict.fromkeys(("x", "y", "z", "roll", "pitch", "yaw"), 0.0)
    ends = {
        name: (still | {"z": height, "roll": roll, "yaw": TWIST}, still)
        for name, height, roll in zip(PLATFORMS, heights, LEAN, strict=True)
    }
    goal = hybridyn.assemble(robot, platforms=ends)[0][dynamics.robot.motor_q]
    t = np.linspace(0.0, DURATION, 5 if asked.short else NODES)
    first = guess(dynamics, goal, t)

    exact, rough = dynamics.jacobian(first), dynamics.differences(first)
    pairs = zip(np.split(exact, 3, axis=2), np.split(rough, 3, axis=2), strict=True)
    off = max(np.abs(right - found).max() / np.abs(right).max() for right, found in pairs)
    spent = seconds(dynamics.jacobian, first)
    batch, single = (seconds(call, first) / spent for call in (dynamics.differences, dynamics.one_by_one))
    print(f"central differences differ from the derivatives by {off:.1g}, and take {batch:.1f} times as long")
    print(f"in one batch, {single:.0f} times as long call by call")
    assert off < 1e-5

    start = time.process_time()
    best, stats = solve(dynamics, first, t[1], 4 if asked.short else 60)
    spent = time.process_time() - start
    print(f"IPOPT: {stats['return_status']} after {stats['iter_count']} iterations, {spent:.1f} s")
    rms = [np.sqrt(np.trapezoid((x[:, 48:] ** 2).sum(axis=1), t) / DURATION / 24) for x in (first, best)]
    print(f"RMS force: {rms[0]:.1f} N along polynomials, {rms[1]:.1f} N at best")
    assert asked.short or (stats["success"] and rms[1] < 0.95 * rms[0])

    reference = CubicHermiteSpline(t, best[:, :24], best[:, 24:48])
    M = dynamics.compiled.mass_matrix(robot.home)

    def law(now: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        planned = np.array([np.interp(now, t, x) for x in best[:, 48:].T])
        late, slow = reference(now) - q[dynamics.robot.motor_q], reference(now, 1) - v[dynamics.robot.motor_v]
        return planned + M @ (KP * late + KD * slow)

    run = hybridyn.simulate(
        robot, robot.home, np.zeros(robot.nv), (0.0, DURATION), effort=law, compiled=dynamics.compiled,
        output_times=np.linspace(0.0, DURATION, 101),
    )  # fmt: skip
    missed = 1e3 * np.abs(run.q[:, dynamics.robot.motor_q] - reference(run.t)).max()
    print(f"simulated with these forces and feedback, the motors stay within {missed:.2g} mm of the plan")
    assert asked.short or missed < 10.0

    picture = figure(8.4, 5.2)
    views = row(picture, 3, 0.46, 0.48, views=True)
    moments = [0, len(t) // 2, len(t) - 1]
    snapshots(views, robot, list(dynamics.states(best[moments])[0]), turn=0.25, lift=0.15)
    for axis, i in zip(views, moments, strict=True):
        axis.set_title(f"{t[i]:.2f} s", fontsize=9, color=INK)
    axes, both = row(picture, 3, 0.09, 0.3), np.vstack([first, best])[:, 48:]
    names = (f"forces, polynomials: {rms[0]:.0f} N RMS", f"forces, least: {rms[1]:.0f} N RMS")
    for axis, x, name in zip(axes[:2], (first, best), names, strict=True):
        for k in range(24):
            axis.plot(t, x[:, 48 + k], color=COLOURS[k // 6], lw=0.9)
        plain(axis, name, "[N]")
        axis.set_ylim(both.min() - 20, both.max() + 20)
    for k in range(24):
        axes[2].plot(t, best[:, 24 + k], color=COLOURS[k // 6], lw=0.9)
    plain(axes[2], "speeds of the legs", "[m/s]")
    print(save(picture, asked, "lx4_collocation"))


if __name__ == "__main__":
    main()
