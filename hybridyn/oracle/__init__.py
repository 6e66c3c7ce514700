"""The judge of the core: inverse and direct dynamics in maximal coordinates, from the `Description` alone.

Nothing is shared with the core but the records: no Pinocchio, no modules, no recursion, no spatial algebra.
Written to be read against its definitions, for small robots and single samples; never fast.

**Coordinates.** Every body (links merged over fixed joints) has six velocity coordinates, world axes:
velocity of its origin and angular velocity, `V = [p_dot; omega]`, and the classical acceleration `V_dot`.

**Rows** (`rows.py`). A joint or a closure is a set of scalar holonomic functions, "slides" and "turns",
whose second derivatives along the motion are written out. `translations` of a `Closure` are slides along
A's axes; rotation "perpendicular" is z_A . z_B, "parallel" x_A . z_B and y_A . z_B, "fixed" x_A . y_B, y_A
. z_B and z_A . x_B. A tree joint is a closure of its kind between parent and child, plus one row per
freedom that *defines* its velocity coordinate: a slide along z (prismatic), slides along B's axes (planar,
floating), turn rates about B's axes (all that turn).

**Elimination** (`tree.py`). The six rows of a tree joint are square in the child's V: solved joint by
joint, they give `V = G v` and `V_dot = G a + g`. The rows of closures and couplings times G are `K v = 0`,
`K a + k = 0`.

**Dynamics** (`bodies.py`, `models.py`). Newton-Euler of every link gives the wrenches `W` that the motion
needs, gravity and outer wrenches subtracted; virtual power makes them `Q = G^T W`, the effort of each tree
coordinate. What closures transmit does no work in `Z = null(K)`, so `Z^T Q = Z^T S^T tau` is all that is
left: the inverse model. The direct model solves the same equation for `a = a_p + Z y`, with `Z^T G^T M G Z
= C^T C` factored through C (square roots of the masses), so that a motion without mass is a null vector of
C.

**Scale and rank.** Sliding coordinates and slide rows are divided by a length of the robot (the longest
offset in it, rounded to a power of two), coupling rows by their norm; "least norm" is meant in these. Rank
is decided against the largest: by singular values in `Float64`, by the diagonal of a column-pivoted QR in
`Extended`.

A `planar` joint moves in the x-y plane of its frame, as in Pinocchio, whatever its axis says.
"""

from .arithmetic import Extended, Float64
from .models import Oracle
from .tree import Base

__all__ = ["Base", "Extended", "Float64", "Oracle"]
