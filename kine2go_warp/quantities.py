"""What is recorded of the worlds' parameters; dimensions, and what a mirror does to them.

It imports nothing of the package.
"""

from dataclasses import dataclass
from typing import Literal

LEG_NAMES = ("FL", "FR", "RL", "RR")
JOINTS_OF_A_LEG = ("hip", "thigh", "calf")

DIMENSION_SIZES = {"axis": 3, "joint": len(LEG_NAMES) * len(JOINTS_OF_A_LEG), "foot": len(LEG_NAMES)}
"""Values along each dimension."""

Mirror = Literal["scalar", "vector", "rotation", "angle"]
"""``scalar``: as it is. ``vector``: a direction, force or velocity; y points left. ``rotation``: angular velocity, or
the left axis of a frame. ``angle``: joint positions or velocities; hips turn about x, so their sign changes."""

MIRRORED_SIGNS: dict[Mirror, tuple[float, ...]] = {
    "scalar": (1.0,),
    "vector": (1.0, -1.0, 1.0),
    "rotation": (-1.0, 1.0, -1.0),
    "angle": (-1.0, 1.0, 1.0),
}
"""Signs in a mirror, repeated over the values of a quantity."""

MIRRORED_LEGS = (1, 0, 3, 2)
"""Each leg's mirror image."""


def size_of(dims: tuple[str, ...]) -> int:
    """Return the number of values of a quantity."""
    size = 1
    for dimension in dims:
        size *= DIMENSION_SIZES[dimension]
    return size


def mirrored(dims: tuple[str, ...], mirror: Mirror) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return for each value of a quantity the place of its mirror image, and the sign that it takes."""
    size, signs = size_of(dims), MIRRORED_SIGNS[mirror]
    places = tuple(range(size))
    if dims[:1] in (("joint",), ("foot",)):
        part = size // len(LEG_NAMES)
        places = tuple(part * leg + offset for leg in MIRRORED_LEGS for offset in range(part))
    return places, tuple(signs[index % len(signs)] for index in range(size))


@dataclass(frozen=True)
class Quantity:
    """A quantity with one value for each world, or for each trajectory of a dataset."""

    name: str
    unit: str
    dims: tuple[str, ...]
    """Besides the world."""
    meaning: str
    dtype: str = "float32"


@dataclass(frozen=True)
class RandomizedParameter(Quantity):
    """A parameter of the simulation that may differ between worlds, as it is recorded."""

    array: str = ""
    """Where the environment holds it: ``motors``, ``base`` or ``bodies``, and the name of an array there."""
    operation: Literal["scale", "add", "set"] = "scale"
    """What a draw does to the nominal value or to an earlier draw's. Only what is added may be negative."""
    when: Literal["world", "episode", "push"] = "episode"
    """Drawn when the worlds are made, for each episode, or for each push."""
    held_as: Quantity | None = None
    """What the simulation holds, where it is another quantity than the recorded one."""

    @property
    def state(self) -> Quantity:
        """What the simulation holds, and a trajectory's initial state with it."""
        return self.held_as or Quantity(self.name, self.unit, self.dims, self.meaning)


_JOINT, _AXIS = ("joint",), ("axis",)
_MASS = Quantity("base_mass", "kg", (), "mass of the base")
_COM = Quantity("base_com", "m", _AXIS, "centre of mass of the base, base frame")
_DELAY = Quantity("delay", "1", (), "latency in physics substeps", "int32")

RANDOMIZED_PARAMETERS = (
    RandomizedParameter(
        "base_mass", "kg", (), "mass added to the base",
        array="base.mass", operation="add", when="world", held_as=_MASS,
    ),
    RandomizedParameter(
        "base_com", "m", _AXIS, "shift of the base's centre of mass, base frame",
        array="base.com", operation="add", when="world", held_as=_COM,
    ),
    RandomizedParameter(
        "friction", "1", (), "coefficient of friction between robot and ground",
        array="bodies.friction", operation="set",
    ),
    RandomizedParameter("stiffness", "N m/rad", _JOINT, "stiffness of the motors", array="motors.stiffness"),
    RandomizedParameter("damping", "N m s/rad", _JOINT, "damping of the motors", array="motors.damping"),
    RandomizedParameter("strength", "1", _JOINT, "factor on the torque of the motors", array="motors.strength"),
    RandomizedParameter(
        "motor_offset", "rad", _JOINT, "error of the motors' zero angle", array="motors.offset", operation="add"
    ),
    RandomizedParameter("joint_friction", "N m", _JOINT, "Coulomb friction of the joints", array="motors.friction"),
    RandomizedParameter(
        "latency", "s", (), "time from an action to its effect at the motors",
        array="motors.delay", operation="set", held_as=_DELAY,
    ),
)  # fmt: skip
"""What is recorded of a world, drawn or not. Pushes are recorded where they happen."""

PUSH_PARAMETERS = (
    RandomizedParameter("push_interval", "s", (), "time between two pushes", operation="set", when="push"),
    RandomizedParameter(
        "push_speed", "m/s", (), "horizontal velocity added to the base, in a random direction",
        operation="set", when="push",
    ),
)  # fmt: skip
"""What is drawn for each push."""
