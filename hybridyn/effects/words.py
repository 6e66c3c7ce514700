"""The names of effects in their order, and the words for several: what can be told without their classes."""

#: Every effect of hybridyn, in the order in which they are told.
NAMES = (
    "gravity", "inertia", "leg_inertia", "massless_legs", "velocity", "rotor_inertia", "viscous_friction",
    "coulomb_friction", "stribeck_friction", "directed_friction",
    "spring", "damper", "stop", "polynomial_spring", "polynomial_damper",
    "ball_spring", "tendons", "wrench", "ground_contact", "gravity_compensation", "line_springs", "bushings",
    "load_friction", "gear_efficiency", "dc_motors", "payload", "base_motion", "limits",
)  # fmt: skip

#: Effects selected by `effects=None` and by the word "default".
DEFAULT = ("gravity", "inertia", "leg_inertia", "velocity")

#: Effects whose parameters are joint attributes in URDF or model.toml, with the attribute of `records.Joint`.
FROM_FILES = {"rotor_inertia": "armature", "viscous_friction": "damping", "coulomb_friction": "friction"}

#: Effects that bound what motors give, and change no model.
BOUNDS = ("limits", "dc_motors")

WORDS = ("default", "model", "none")
