"""Checks of links and contacts against forward kinematics and the floor."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.block import Block
from kine2go_warp.dataset.checks.records import RowCheck
from kine2go_warp.dataset.checks.statistics import largest, mean
from kine2go_warp.robots.kinematics import foot_positions, link_positions, link_rotations, link_turning
from kine2go_warp.rotations import rotate_by_matrices, to_matrices

Array = NDArray[np.float64]

CLEARANCE = 0.02
"""A foot whose lowest point is higher than this is in the air [m]: nothing moves that far in a physics substep."""

MOMENT = 1e-6
"""Half the time between the two poses whose difference gives the links' velocities [s]."""

GRAVITY = 9.81
"""[m/s^2]"""

SHORTEST_WEIGHING = 120
"""Rows over which the forces of a trajectory must average to the robot's weight."""


def link_error(block: Block) -> Array:
    """Return the farthest that a link is from where root pose and joints put it [m], shape [n, num_rows]."""
    arms = rotate_by_matrices(
        to_matrices(block["root_orientation"]), link_positions(block.spec, block["joint_position"])
    )
    expected = block["root_position"][:, :, None] + arms
    return largest(np.linalg.norm(block["link_position"] - expected, axis=-1), 2)


def link_velocity_error(block: Block) -> Array:
    """Return the farthest that a link's velocity is from that of root and joints [m/s], shape [n, num_rows]."""
    rotation, joints = to_matrices(block["root_orientation"]), block["joint_position"]
    change = MOMENT * block["joint_velocity"]
    relative_b = (link_positions(block.spec, joints + change) - link_positions(block.spec, joints - change)) / (
        2.0 * MOMENT
    )
    arms = rotate_by_matrices(rotation, link_positions(block.spec, joints))
    expected = (
        block["root_linear_velocity"][:, :, None]
        + np.cross(block["root_angular_velocity"][:, :, None], arms)
        + rotate_by_matrices(rotation, relative_b)
    )
    return largest(np.linalg.norm(block["link_linear_velocity"] - expected, axis=-1), 2)


def link_orientation_error(block: Block) -> Array:
    """Return the furthest that a link is turned from where root and joints turn it [rad], shape [n, num_rows]."""
    root = to_matrices(block["root_orientation"])[:, :, None]
    expected = root @ link_rotations(block.spec, block["joint_position"])
    # |A - B| of rotation matrices is sqrt(8) times the sine of half the angle between them.
    apart = np.linalg.norm(to_matrices(block["link_orientation"]) - expected, axis=(-2, -1))
    return largest(2.0 * np.arcsin(np.minimum(apart / np.sqrt(8.0), 1.0)), 2)


def link_turning_error(block: Block) -> Array:
    """Return how far a link's angular velocity is from that of root and joints [rad/s], shape [n, num_rows]."""
    turning_b = link_turning(block.spec, block["joint_position"], block["joint_velocity"])
    turning = rotate_by_matrices(to_matrices(block["root_orientation"]), turning_b)
    expected = block["root_angular_velocity"][:, :, None] + turning
    return largest(np.linalg.norm(block["link_angular_velocity"] - expected, axis=-1), 2)


def reference_foot_error(block: Block) -> Array:
    """Return the farthest that a reference foot is from where the reference's pose puts it [m], shape [n, num_rows]."""
    feet_b = foot_positions(block.spec, block["reference_joint_position"])
    feet = rotate_by_matrices(to_matrices(block["reference_root_orientation"]), feet_b)
    expected = block["reference_root_position"][:, :, None] + feet
    return largest(np.linalg.norm(block["reference_foot_position"] - expected, axis=-1), 2)


def beyond_limits(name: str) -> Callable[[Block], Array]:
    """Return a measure of how far joints are beyond their limits [rad]."""

    def measure(block: Block) -> Array:
        low = np.array(block.spec.joint_lower) - block[name]
        high = block[name] - np.array(block.spec.joint_upper)
        return np.maximum(largest(np.maximum(low, high), 2), 0.0)

    return measure


def pull(block: Block) -> Array:
    """Return by how much the floor pulls a foot downwards [N], shape [n, num_rows]."""
    return np.maximum(largest(-block["foot_contact_force"][..., 2], 2), 0.0)


def force_in_the_air(block: Block) -> Array:
    """Return the largest force on a foot that is clear of the floor [N], shape [n, num_rows]."""
    height = block["link_position"][..., -len(block.spec.foot_links) :, 2] - block.spec.foot_radius
    force = np.linalg.norm(block["foot_contact_force"], axis=-1)
    return largest(np.where(height > CLEARANCE, force, 0.0), 2)


def beyond_friction(block: Block) -> Array | None:
    """Return by how much a force along the floor is more than friction can give [N], shape [n, num_rows]."""
    if "randomization/friction" not in block:
        return None
    force, friction = block["foot_contact_force"], block["randomization/friction"][:, None, None]
    return largest(np.linalg.norm(force[..., :2], axis=-1) - friction * force[..., 2], 2)


def weight_error(block: Block) -> Array:
    """Return how far the mean vertical force is from the robot's weight, in weights, shape [n].

    Over a trajectory the robot neither rises nor falls. Short trajectories say nothing.
    """
    vertical = block["foot_contact_force"][..., 2].sum(axis=-1)
    rows = (~np.isnan(vertical)).sum(axis=-1)
    error = np.abs(mean(vertical, 1) / (block.spec.mass * GRAVITY) - 1.0)
    return np.where(rows >= SHORTEST_WEIGHING, error, np.nan)


FORCE = ("foot_contact_force",)

CHECKS = (
    RowCheck(
        "forward kinematics", "link_position",
        ("link_position", "root_position", "root_orientation", "joint_position"),
        "links are where root pose and joint positions put them", "not where root pose and joints put it: off",
        link_error, 2e-5, "m",
    ),
    RowCheck(
        "link kinematics", "link_linear_velocity",
        ("link_linear_velocity", "root_linear_velocity", "root_angular_velocity", "root_orientation",
         "joint_position", "joint_velocity"),
        "links move as root and joint velocities, of the same instant, make them",
        "not what root and joint velocities give: off", link_velocity_error, 2e-4, "m/s",
    ),
    RowCheck(
        "link orientation", "link_orientation", ("link_orientation", "root_orientation", "joint_position"),
        "links are turned as root and joint positions turn them", "not turned as root and joints turn it: off",
        link_orientation_error, 2e-5, "rad",
    ),
    RowCheck(
        "link turning", "link_angular_velocity",
        ("link_angular_velocity", "root_angular_velocity", "root_orientation", "joint_position", "joint_velocity"),
        "links turn as root and joint velocities, of the same instant, make them",
        "not what root and joint velocities give: off", link_turning_error, 2e-4, "rad/s",
    ),
    RowCheck(
        "reference kinematics", "reference_foot_position",
        ("reference_foot_position", "reference_root_position", "reference_root_orientation",
         "reference_joint_position"),
        "the reference's feet are where its root pose and joint positions put them",
        "not where the reference's root pose and joints put it: off", reference_foot_error, 2e-5, "m",
    ),
    RowCheck(
        "joint limits", "joint_position", ("joint_position",),
        "joints, and those of the reference, keep within their limits", "beyond the joint limits",
        beyond_limits("joint_position"), 0.1, "rad",
    ),
    RowCheck(
        "joint limits", "reference_joint_position", ("reference_joint_position",), "", "beyond the joint limits",
        beyond_limits("reference_joint_position"), 0.1, "rad",
    ),
    RowCheck(
        "contact direction", "foot_contact_force", FORCE,
        "the floor never pulls at a foot", "the floor pulls a foot downwards", pull, 1e-3, "N",
    ),
    RowCheck(
        "contact in the air", "foot_contact_force", (*FORCE, "link_position"),
        f"no force on a foot whose lowest point is higher than {CLEARANCE} m (flat floor)",
        "a force on a foot in the air", force_in_the_air, 1e-3, "N",
    ),
    RowCheck(
        "friction", "foot_contact_force", FORCE,
        "the force along the floor is at most friction times the normal force",
        "more force along the floor than friction can give", beyond_friction, 0.1, "N",
    ),
    RowCheck(
        "weight", "foot_contact_force", FORCE,
        f"the floor carries the robot's weight on average, over {SHORTEST_WEIGHING} rows or more",
        "the mean vertical force is off", weight_error, 0.35, "of the robot's weight",
    ),
)  # fmt: skip
"""All of them."""
