"""What a dataset holds: every array with its dimensions, unit and meaning."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from kine2go_warp.metrics import CONTACT_FORCE, METRICS
from kine2go_warp.quantities import RANDOMIZED_PARAMETERS, Quantity
from kine2go_warp.robots import RobotSpec

FORMAT_VERSION = "0.3"

FRAMES_NOTE = (
    "World frame: z up, metres, seconds, radians. Quaternions are (w, x, y, z), unit and continuous in time. Row t "
    "holds the state that the policy saw at control step t and the action that it chose from it. Forces and torques of "
    "row t are those of the physics substep that ended in state[t], means and peaks those of the control step that "
    "did; reward[t] is what state[t+1] earned."
)

ACTION_RULE = (
    "From state[t] to state[t+1] the robot takes n physics substeps, s = 0 to n - 1. In substep s the joint target of "
    "row t + floor((s - d) / n) is in force, d being the trajectory's initial_state/delay, the latency in substeps. "
    "So action[t] moves state[t + 1 + floor(d / n)] first, and with a latency of n substeps or more it leaves "
    "state[t+1] as it is. State[t+1] follows from state[t] (root pose and velocities, joint positions and velocities, "
    "friction_anchor), push[t], joint_target of the rows t - ceil(d / n) to t, and what is drawn for the "
    "trajectory (randomization). These make the rows Markov; initial_state/target_queue has the targets from before "
    "the first row. "
    "applied_target[t] is the target in force in the substep that ended in state[t]."
)
"""Which action acts when, and what of a row and its predecessors decides the next row."""

COPIED = (
    "conventions", "action_rule", "joint_names", "foot_names", "link_names", "default_joint_position", "action_scale",
    "sdk_motor_order", "control_frequency", "physics_substeps", "stiffness", "damping",
)  # fmt: skip
"""Attributes of the root that every motion repeats, for readers that open a motion alone."""


@dataclass(frozen=True)
class ArraySpec:
    """One array of a motion group."""

    name: str
    dims: tuple[str, ...]
    unit: str
    description: str
    dtype: str = "float32"


def per_trajectory(quantity: Quantity) -> ArraySpec:
    """Return the array of a quantity that has one value for each trajectory."""
    dims = ("trajectory", *quantity.dims)
    return ArraySpec(quantity.name, dims, quantity.unit, quantity.meaning, quantity.dtype)


_FRAME = ("trajectory", "frame")
_STEP = "the physics substeps of the control step that ended in this row's state"

ROW_ARRAYS = (
    ArraySpec("root_position", (*_FRAME, "axis"), "m", "base link origin, world frame"),
    ArraySpec("root_orientation", (*_FRAME, "quaternion"), "1", "base link in the world, (w, x, y, z)"),
    ArraySpec("root_linear_velocity", (*_FRAME, "axis"), "m/s", "velocity of the base link origin, world frame"),
    ArraySpec("root_angular_velocity", (*_FRAME, "axis"), "rad/s", "angular velocity of the base, world frame"),
    ArraySpec("joint_position", (*_FRAME, "joint"), "rad", "relative to the parent link"),
    ArraySpec("joint_velocity", (*_FRAME, "joint"), "rad/s", "relative to the parent link"),
    ArraySpec("link_position", (*_FRAME, "link", "axis"), "m", "joint centres and feet, world frame"),
    ArraySpec("link_orientation", (*_FRAME, "link", "quaternion"), "1", "of links in the world, (w, x, y, z)"),
    ArraySpec("link_linear_velocity", (*_FRAME, "link", "axis"), "m/s", "of joint centres and feet, world frame"),
    ArraySpec("link_angular_velocity", (*_FRAME, "link", "axis"), "rad/s", "of links, world frame"),
    ArraySpec("foot_contact_force", (*_FRAME, "foot", "axis"), "N", "force of the floor on the foot, world frame"),
    ArraySpec("foot_contact_force_mean", (*_FRAME, "foot", "axis"), "N", f"the same, mean over {_STEP}"),
    ArraySpec("foot_contact_force_peak", (*_FRAME, "foot"), "N", f"its largest size in {_STEP}"),
    ArraySpec("foot_contact", (*_FRAME, "foot"), "1", f"1 where foot_contact_force exceeds {CONTACT_FORCE:g} N"),
    ArraySpec("action", (*_FRAME, "joint"), "1", "sampled command: (joint_target - default pose) / action scale"),
    ArraySpec("action_mean", (*_FRAME, "joint"), "1", "the same for the mean of the policy's distribution"),
    ArraySpec("joint_target", (*_FRAME, "joint"), "rad", "commanded joint position"),
    ArraySpec("applied_target", (*_FRAME, "joint"), "rad", "joint target in force in the last physics substep"),
    ArraySpec("joint_torque", (*_FRAME, "joint"), "N m", "torque applied in the last physics substep"),
    ArraySpec("joint_torque_mean", (*_FRAME, "joint"), "N m", f"torque, mean over {_STEP}"),
    ArraySpec("joint_torque_peak", (*_FRAME, "joint"), "N m", f"largest size of the torque in {_STEP}"),
    ArraySpec("torque_usage", (*_FRAME, "joint"), "1", f"largest share of the motor's torque at its speed in {_STEP}"),
    ArraySpec("torque_at_limit", (*_FRAME, "joint"), "1", f"share of {_STEP} with the motor at its limit"),
    ArraySpec("joint_power_mean", (*_FRAME, "joint"), "W", f"torque times velocity, mean over {_STEP}"),
    ArraySpec("joint_power_peak", (*_FRAME, "joint"), "W", f"largest size of torque times velocity in {_STEP}"),
    ArraySpec("friction_anchor", (*_FRAME, "joint"), "rad", "joint position where the friction's spring is slack"),
    ArraySpec("leg_contact", _FRAME, "1", "1 where a thigh or calf touches the ground, else 0"),
    ArraySpec("leg_distance", _FRAME, "m", "least distance of a leg from another, the trunk or the head; < 0: overlap"),
    ArraySpec("push", (*_FRAME, "axis"), "m/s", "velocity that a push adds to the base right after this row, world"),
    ArraySpec(
        "phase", _FRAME, "1", "place in the reference cycle, in [0, 1), or in a motion that is played once, up to 1"
    ),
    ArraySpec("cycle", _FRAME, "1", "whole reference cycles passed"),
    ArraySpec("reference_root_position", (*_FRAME, "axis"), "m", "reference at the row's instant, world frame"),
    ArraySpec("reference_root_orientation", (*_FRAME, "quaternion"), "1", "reference at the row's instant, wxyz"),
    ArraySpec("reference_joint_position", (*_FRAME, "joint"), "rad", "reference at the row's instant"),
    ArraySpec("reference_root_linear_velocity", (*_FRAME, "axis"), "m/s", "of the base link origin, world frame"),
    ArraySpec("reference_root_angular_velocity", (*_FRAME, "axis"), "rad/s", "of the base, world frame"),
    ArraySpec("reference_joint_velocity", (*_FRAME, "joint"), "rad/s", "reference at the row's instant"),
    ArraySpec("reference_foot_position", (*_FRAME, "foot", "axis"), "m", "reference at the row's instant, world"),
    ArraySpec("reference_body_rests", _FRAME, "1", "1 where the reference lets base and legs touch the ground, else 0"),
    ArraySpec("reward", (*_FRAME, "term"), "1", "weighted terms, which add up to the reward"),
)
"""Arrays with one entry a row, padded with NaN where a trajectory is shorter."""

DIVERSITY_ARRAYS = (
    ArraySpec("time_scale", ("trajectory",), "1", "duration of the reference over its clip's"),
    ArraySpec("mirrored", ("trajectory",), "1", "1 where the reference is the clip's mirror image, else 0", "int32"),
    ArraySpec("speed_offset", ("trajectory",), "m/s", "added to the reference's speed, along its heading"),
    ArraySpec("turn_offset", ("trajectory",), "rad/s", "added to the reference's yaw rate; heading is that of cycle 0"),
    ArraySpec("noise_time", ("trajectory",), "s", "correlation time of the noise on the actions; 0: new in every row"),
    ArraySpec("recovery", ("trajectory",), "1", "1 where the rows begin off the reference, without warm-up", "int32"),
    ArraySpec("reset_scale", ("trajectory",), "1", "spread of the rollout's first state over the usual one"),
)
"""What of a rollout the settings of diversity drew; without any, 1 for scales and 0 for the others."""

OPTIONAL_ROW_ARRAYS = (
    ArraySpec(
        "observation", (*_FRAME, "observed"), "1",
        "what the policy saw, in the units of the attribute observation_terms; the labels name each number",
    ),
)  # fmt: skip
"""Row arrays that are stored where gathering is asked for them."""

TRAJECTORY_ARRAYS = (
    ArraySpec("length", ("trajectory",), "1", "valid rows", "int32"),
    ArraySpec("heading", ("trajectory",), "rad", "turn of the whole reference about the z axis"),
    ArraySpec("seed", ("trajectory",), "1", "seed that the rollout was drawn from", "uint32"),
    ArraySpec(
        "start_phase",
        ("trajectory",),
        "1",
        "place in the cycle where the rollout began, before the trim",
    ),
    ArraySpec("noise", ("trajectory",), "1", "noise on the actions, in standard deviations of the policy"),
    ArraySpec("terminated", ("trajectory",), "1", "1 where it ended early, 0 where it was truncated", "int32"),
    *DIVERSITY_ARRAYS,
)
"""How each rollout was drawn."""

_QUALITY = (
    "joint_rmse", "root_error", "root_angle", "foot_error", "largest_root_error", "largest_root_angle", "leg_contact",
    "joint_limit", "torque_saturation", "action_saturation", "foot_slip", "joint_jerk", "joint_speed",
    "leg_overlap",
)  # fmt: skip

QUALITY_ARRAYS = (
    *(ArraySpec(name, ("trajectory",), METRICS[name].unit, METRICS[name].description) for name in _QUALITY),
    ArraySpec("worst_limit_ratio", ("trajectory",), "1", "largest of these metrics as a share of its limit"),
)
"""How good each rollout is, computed from its rows."""

RANDOMIZATION_ARRAYS = tuple(per_trajectory(parameter) for parameter in RANDOMIZED_PARAMETERS)
"""What holds for each rollout, whether it was drawn or not."""

INITIAL_STATE_ARRAYS = (
    ArraySpec("joint_q", ("trajectory", "coordinate"), "m, 1, rad", "base origin, orientation (x, y, z, w), joints"),
    ArraySpec(
        "joint_qd",
        ("trajectory", "velocity"),
        "m/s, rad/s",
        "velocity of the base's centre of mass and angular velocity, world frame, then joints",
    ),
    ArraySpec("warm_start", ("trajectory", "velocity"), "m/s^2, rad/s^2", "the solver's last accelerations"),
    ArraySpec("target_queue", ("trajectory", "slot", "joint"), "rad", "joint targets on their way to the motors"),
    ArraySpec("reference_step", ("trajectory",), "1", "control steps since the rollout began", "int32"),
    *(per_trajectory(parameter.state) for parameter in RANDOMIZED_PARAMETERS),
    ArraySpec("friction_anchor", ("trajectory", "joint"), "rad", "where the spring of a joint's friction is slack"),
)
"""Everything that simulator and motors need to go on from the first kept row."""

FINAL_STATE_ARRAYS = tuple(
    ArraySpec(one.name, ("trajectory", *one.dims[2:]), one.unit, f"{one.description}; after the last row's action")
    for one in ROW_ARRAYS[:6]
)
"""State that the last row's control step led to, so that T rows are T transitions; NaN where a rollout ended early."""

SUB_GROUPS = {
    "quality": QUALITY_ARRAYS,
    "randomization": RANDOMIZATION_ARRAYS,
    "initial_state": INITIAL_STATE_ARRAYS,
    "final_state": FINAL_STATE_ARRAYS,
}
"""Groups inside a motion's group, and their arrays."""

REJECTED = "rejected"
"""Group of the rollouts that were rejected, if they are kept; its trajectories are counted along ``rejected``."""

REASON = ArraySpec(
    "reason", ("trajectory",), "1", "why the rollout was rejected, a place in the attribute meanings", "int32"
)


@dataclass(frozen=True)
class RewardSettings:
    """A reward term as the settings of a motion's training describe it."""

    name: str
    kernel: str
    weight: float
    """Before the division by the control rate."""
    maximum: float | None
    """Largest value before the weight, where it is known."""
    params: Mapping[str, float]


def reward_settings(attributes: Mapping[str, Any]) -> tuple[RewardSettings, ...]:
    """Return the reward terms that a motion's attributes describe, in the order of the array ``reward``.

    None are returned where the attributes are incomplete or damaged.
    """
    try:
        described = [
            RewardSettings(
                name,
                str(term["kernel"]),
                float(term["weight"]),
                None if term["maximum"] is None else float(term["maximum"]),
                {param: float(value) for param, value in dict(term["params"]).items()},
            )
            for name, term in attributes["training_settings"]["env"]["rewards"].items()
        ]
    except (AttributeError, KeyError, TypeError, ValueError):
        return ()
    return tuple(term for term in described if term.weight != 0.0)


def reward_labels(attributes: Mapping[str, Any], count: int) -> tuple[str, ...]:
    """Return the names of a motion's reward terms, numbered ones where its attributes do not name as many."""
    names = tuple(term.name for term in reward_settings(attributes))
    return names if len(names) == count else tuple(f"term_{index}" for index in range(count))


def observation_labels(attributes: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the name of each number of a motion's observations, none where they are not stored."""
    try:
        return tuple(str(name) for term in attributes.get("observation_terms", ()) for name in term["columns"])
    except (KeyError, TypeError):
        return ()


def coordinates(
    spec: RobotSpec, reward_terms: Sequence[str], observed: Sequence[str] = ()
) -> dict[str, tuple[str, ...]]:
    """Return the labels along each labelled dimension.

    Args:
        spec: The robot.
        reward_terms: Names of the reward terms.
        observed: Names of the numbers of an observation, if observations are stored.
    """
    return {
        **({"observed": tuple(observed)} if observed else {}),
        "axis": ("x", "y", "z"),
        "quaternion": ("w", "x", "y", "z"),
        "joint": spec.joint_names,
        "link": spec.link_names,
        "foot": tuple(name.removesuffix("_foot") for name in spec.foot_links),
        "term": tuple(reward_terms),
    }
