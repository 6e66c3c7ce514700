"""Physical effects of the models: only the effects that a call names are computed.

Read `terms` (gravity, inertia, the legs' inertia, velocity terms), `joints`, `joint_laws`, `springs` and
`tendons` (efforts of joints), `link_effect`, `links`, `bodies`, `bushings` (wrenches on links), `inputs`
(limits, a prescribed base), `load_friction` and `gears` (losses that grow with load), `dc_motors`, `others`
(laws of other packages), `words` (every effect by name), `catalogue` (their classes), `listing` (the effects
of names and objects), `choice` (the selection of effects for one call), `dry_friction` (joints that stick),
`rebuild` (`hybridyn.with_effects`).

`__init__.pyi` lists what is public. A class is imported when it is first used: most calls take four effects.

May import: `structure`, `tables` and below.
"""

import lazy_loader

from ..structure.bodies import Payload

__getattr__, _, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ = [*__all__, "Payload"]


def __dir__() -> list[str]:
    """Return what is public, also of other folders."""
    return [*__all__]
