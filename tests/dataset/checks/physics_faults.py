"""Faults of the mechanics, each with the array in which steps of plain MuJoCo must find it."""

import numpy as np

from kine2go_warp.robots import GO2
from tests.dataset.checks.spoiling import added, no_pushes, scaled, several, sunk, values

POSE = np.float32(GO2.default_joint_position)
FORCES = ("foot_contact_force", "foot_contact_force_mean", "foot_contact_force_peak")
TORQUES = ("joint_torque", "joint_torque_mean", "joint_torque_peak")


def larger_targets(path):
    """Scale actions by 1.1, and the targets with them."""
    scaled("action", "action_mean", by=1.1)(path)
    for name in ("joint_target", "applied_target"):
        values(name, lambda one: POSE + 1.1 * (one - POSE))(path)


PHYSICS_FAULTS = {
    "a base of 2 kg more": (added("initial_state/base_mass", "randomization/base_mass", what=2.0), "joint_velocity"),
    "a base of 8 kg more": (added("initial_state/base_mass", "randomization/base_mass", what=8.0), "joint_velocity"),
    "half of the damping": (scaled("initial_state/damping", "randomization/damping", by=0.5), "joint_torque"),
    "less friction": (scaled("initial_state/friction", "randomization/friction", by=0.5), "foot_contact_force"),
    "larger actions and targets": (larger_targets, "joint_torque"),
    "pushes forgotten": (no_pushes, "root_linear_velocity"),
    "larger torques": (scaled(*TORQUES, by=1.2), "joint_torque"),
    "smaller forces": (scaled(*FORCES, by=0.7), "foot_contact_force"),
    "mean torques of zero": (scaled("joint_torque_mean", by=0.0), "joint_torque_mean"),
    "half of the power": (scaled("joint_power_mean", "joint_power_peak", by=0.5), "joint_power_mean"),
    "joints that stand still at last": (scaled("final_state/joint_velocity", by=0.0), "joint_velocity"),
    "friction without a memory": (scaled("friction_anchor", by=0.99), "friction_anchor"),
    "a robot sunk into the ground": (sunk, "foot_contact_force"),
    "another state before the first row": (several(scaled("initial_state/target_queue", by=0.9)), "joint_torque"),
}
"""Name, what is done, and the array to blame."""
