"""The layout of the observation: one table for the environment, the policy's users and the documentation."""

from collections.abc import Sequence
from dataclasses import dataclass

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.kernels.observations import PRIVILEGED_SIZE, STATE_SIZE, TARGET_SIZE

STATE_FIELDS = (
    ("down_b", 3, "-", "direction of gravity, base frame"),
    ("linear_velocity_b", 3, "m/s", "velocity of the base origin, base frame"),
    ("angular_velocity_b", 3, "rad/s", "angular velocity, base frame"),
    ("joint_position", 12, "rad", "joint positions less the default pose"),
    ("joint_velocity", 12, "rad/s", "joint velocities"),
    ("last_output", 12, "-", "last output of the policy"),
)
TARGET_FIELDS = (
    ("target_position_h", 3, "m", "reference root less own root, own heading frame"),
    ("target_forward_h", 3, "-", "forward axis of the reference root, own heading frame"),
    ("target_left_h", 3, "-", "left axis of the reference root, own heading frame"),
    ("target_joint_position", 12, "rad", "reference joint positions less the default pose"),
)
PRIVILEGED_FIELDS = (
    ("root_height", 1, "m", "height of the root above the ground"),
    ("linear_velocity_h", 3, "m/s", "velocity of the base origin, heading frame"),
    ("angular_velocity_h", 3, "rad/s", "angular velocity, heading frame"),
    ("foot_force_h", 12, "robot weights", "forces on the feet FL, FR, RL, RR, heading frame"),
    ("base_mass", 1, "kg", "mass added to the base"),
    ("base_com", 3, "m", "shift of the base's centre of mass, base frame"),
    ("friction", 1, "-", "coefficient of friction"),
    ("stiffness", 12, "-", "factor on the stiffness less 1"),
    ("damping", 12, "-", "factor on the damping less 1"),
    ("strength", 12, "-", "factor on the torque less 1"),
    ("motor_offset", 12, "rad", "error of the motors' zero angle"),
    ("latency", 1, "substeps", "time from an action to its effect"),
)
"""What only the critic sees, if anything."""


@dataclass(frozen=True)
class ObservationField:
    """One row of the observation table."""

    name: str
    start: int
    stop: int
    unit: str
    description: str


def observation_size(config: EnvConfig) -> int:
    """Return the number of values in an observation."""
    return config.history_length * STATE_SIZE + len(config.steps_ahead) * TARGET_SIZE


def observation_layout(config: EnvConfig) -> tuple[ObservationField, ...]:
    """Return what stands where: the states from new to old, then the targets from near to far."""
    blocks = [(f"[t-{age}]" if age else "[t]", STATE_FIELDS) for age in range(config.history_length)]
    blocks += [(f"[t+{ahead}]", TARGET_FIELDS) for ahead in config.steps_ahead]
    return laid_out(
        [
            (name + suffix, size, unit, description)
            for suffix, table in blocks
            for name, size, unit, description in table
        ]
    )


def privileged_layout() -> tuple[ObservationField, ...]:
    """Return what stands where in the critic's own observation."""
    layout = laid_out(PRIVILEGED_FIELDS)
    assert layout[-1].stop == PRIVILEGED_SIZE
    return layout


def laid_out(table: Sequence[tuple[str, int, str, str]]) -> tuple[ObservationField, ...]:
    """Return fields of the given sizes side by side."""
    layout, start = [], 0
    for name, size, unit, description in table:
        layout.append(ObservationField(name, start, start + size, unit, description))
        start += size
    return tuple(layout)
