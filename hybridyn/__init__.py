"""hybridyn: dynamics of hybrid robots, exact and linear in the number of modules.

    robot = hybridyn.load("lx4")                      a robot from its files, or a shipped one
    q, v, a = hybridyn.assemble(robot, motors={...})   postures that close the loops
    tau = hybridyn.idm(robot, q, v, a)                 motor efforts of a motion
    a = hybridyn.ddm(robot, q, v, tau)                 accelerations under motor efforts
    run = hybridyn.simulate(robot, ...)                motion over time

`dir(hybridyn)` lists the public names; `help(hybridyn.idm)` explains one. Arrays are one sample (n,) or a
batch (T, n), in SI units.

`__init__.pyi` lists the public names and the files they live in. A name is imported when it is first used, so
that the command line starts quickly.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"
__all__ = [*(name for name in __all__ if name != "effects"), "__version__"]  # `hybridyn.effects` is a room
