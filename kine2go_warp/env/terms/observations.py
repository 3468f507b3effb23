"""Observation terms: what the policy sees of itself and of the coming reference, and what only the critic sees."""

from dataclasses import dataclass

from kine2go_warp.env.terms.base import Term
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.quantities import DIMENSION_SIZES, Mirror, size_of

_KERNELS = "kine2go_warp.kernels.observations"


@dataclass(frozen=True)
class ObservationTerm(Term):
    """One field of an observation. Its kernel writes ``size`` values from ``column`` on."""

    dims: tuple[str, ...] = ()
    """Its dimensions, such as ``("joint",)``; without any it is one number."""
    unit: str = "-"
    description: str = ""
    mirror: Mirror = "scalar"
    """How it is mirrored, left for right."""
    enabled: bool = True
    """Whether it is observed at all."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "dims", tuple(self.dims))
        for dimension in self.dims:
            if dimension not in DIMENSION_SIZES:
                known = ", ".join(DIMENSION_SIZES)
                raise Kine2GoError(f"observation {self.name}: unknown dimension '{dimension}'; known are: {known}")

    @property
    def size(self) -> int:
        """Number of values."""
        return size_of(self.dims)


def _term(
    name: str, dims: tuple[str, ...], unit: str, description: str, mirror: Mirror, kernel: str = ""
) -> ObservationTerm:
    """Return a term of the package's own kernels, by default the one of its name."""
    reference = f"{_KERNELS}:{kernel or name}"
    return ObservationTerm(name, reference, dims=dims, unit=unit, description=description, mirror=mirror)


_AXIS, _JOINT, _FOOT = ("axis",), ("joint",), ("foot", "axis")

OBSERVATIONS = (
    _term("down_b", _AXIS, "-", "direction of gravity, base frame", "vector"),
    _term("linear_velocity_b", _AXIS, "m/s", "velocity of the base origin, base frame", "vector"),
    _term("angular_velocity_b", _AXIS, "rad/s", "angular velocity, base frame", "rotation"),
    _term("joint_position", _JOINT, "rad", "joint positions less the default pose", "angle", "joint_positions"),
    _term("joint_velocity", _JOINT, "rad/s", "joint velocities", "angle", "joint_velocities"),
    _term("last_action", _JOINT, "-", "last action of the policy", "angle"),
)
"""What the robot knows of itself, at the present and at past control steps."""

REFERENCE_OBSERVATIONS = (
    _term("reference_position_h", _AXIS, "m", "reference root less own root, own heading frame", "vector"),
    _term("reference_forward_h", _AXIS, "-", "forward axis of the reference root, own heading frame", "vector"),
    # The left axis is that of the mirrored root's own frame, not the mirror image of an arrow.
    _term("reference_left_h", _AXIS, "-", "left axis of the reference root, own heading frame", "rotation"),
    _term(
        "reference_joint_position",
        _JOINT,
        "rad",
        "reference joint positions less the default pose",
        "angle",
        "reference_joint_positions",
    ),
)
"""What it knows of the reference, at each of some coming control steps; their kernels read ``view.ahead``."""

PRIVILEGED_OBSERVATIONS = (
    _term("root_height", (), "m", "height of the root above the ground", "scalar"),
    _term("linear_velocity_h", _AXIS, "m/s", "velocity of the base origin, heading frame", "vector"),
    _term("angular_velocity_h", _AXIS, "rad/s", "angular velocity, heading frame", "rotation"),
    _term("foot_force_h", _FOOT, "robot weights", "forces on the feet FL, FR, RL, RR, heading frame", "vector"),
    _term("base_mass", (), "kg", "mass added to the base", "scalar"),
    _term("base_com", _AXIS, "m", "shift of the base's centre of mass, base frame", "vector"),
    _term("friction", (), "-", "coefficient of friction", "scalar"),
    _term("stiffness", _JOINT, "-", "factor on the stiffness less 1", "scalar"),
    _term("damping", _JOINT, "-", "factor on the damping less 1", "scalar"),
    _term("strength", _JOINT, "-", "factor on the torque less 1", "scalar"),
    _term("motor_offset", _JOINT, "rad", "error of the motors' zero angle", "angle"),
    _term("joint_friction", _JOINT, "N m", "Coulomb friction of the joints", "scalar"),
    _term("latency", (), "substeps", "time from an action to its effect", "scalar"),
)
"""What only the critic sees, if anything."""
