"""One module in the backward sweep of the direct model: its equation of motion, A_t u_dot = Q_0 - E V_dot."""

from dataclasses import dataclass, field

from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.module import ModuleState
from .inertia_solve import InertiaFactor
from .loads import LegTerms


@dataclass(eq=False)
class ArticulatedModule:
    """One module in the backward sweep: its equation of motion, and what it was made of.

    Attributes:
        state: The module's state.
        basis: Basis of its motions and drift.
        legs: Inertia and forces of its legs.
        I_star: Articulated inertias of its outputs, shape (T, outputs, 6, 6).
        beta_star: Biases of its outputs, shape (T, outputs, 6).
        tau: Efforts of its motors, shape (T, motors).
        a_maps: Maps a_o of the outputs, shape (T, outputs, 6, N), Eq. (2).
        X: Motion matrices from the base to the outputs, shape (T, outputs, 6, 6), Eq. (26).
        c: v_dot_0 + crm(V) v of the outputs (`ModuleState.convective`), shape (T, outputs, 6).
        b: Wrenches that the outputs need at u_dot = 0 and V_dot = 0, shape (T, outputs, 6).
        f: Generalised force along x at x_ddot = drift, shape (T, n).
        A_t, E, Q_0: Shapes (T, N, N), (T, N, 6), (T, N).
        inertia: Principal motions of A_t.
        G, y: A_t^-1 E and A_t^-1 Q_0, shapes (T, N, 6), (T, N).
    """

    state: ModuleState
    basis: Basis
    legs: LegTerms
    I_star: Array
    beta_star: Array
    tau: Array
    a_maps: Array
    X: Array
    c: Array
    b: Array
    f: Array
    A_t: Array
    E: Array
    Q_0: Array
    inertia: InertiaFactor = field(init=False)
    G: Array = field(init=False)
    y: Array = field(init=False)
