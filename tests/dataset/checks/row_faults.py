"""Faults of one trajectory's rows, each with the check that must find it and the array that it must name."""

import numpy as np

from kine2go_warp.dataset.schema import OPTIONAL_ROW_ARRAYS, ROW_ARRAYS
from tests.dataset.checks.spoiling import (
    ROW,
    SHORTER,
    TARGET,
    Fault,
    added,
    at,
    centre_of_mass_velocity,
    fault,
    group,
    jump_in_orientation,
    late,
    left_out,
    push_along_the_floor,
    read,
    reference_of_another_heading,
    scaled,
    seen_from_the_base,
    several,
    sunk,
    swapped_joints,
    the_noise_of_another,
    three_late,
    values,
)

AWAY = 0
"""A trajectory whose heading is far from 0, so that base frame and world differ much."""
REFERENCE = ("reference_root_position", "reference_root_orientation", "reference_foot_position")
COMMANDS = ("action", "action_mean", "joint_target")
EVERY_ROW = (*(array.name for array in (*ROW_ARRAYS, *OPTIONAL_ROW_ARRAYS)), "length")
JOINT_ARRAYS = tuple(array.name for array in ROW_ARRAYS if "joint" in array.dims)

ROW_FAULTS = {
    "a hole": fault("action", at(ROW, np.nan), "finite"),
    "an infinite number": fault("joint_velocity", at(ROW, np.inf), "finite"),
    "rows beyond the length": Fault(
        values("joint_torque", at(slice(-5, None), 0.0), SHORTER), "padding", "joint_torque", ("joint_torque",),
        trajectories=(SHORTER,),
    ),
    "a length beyond the array": fault("length", lambda _: 999, "length"),
    "a length of none": fault("length", lambda _: 0, "length"),
    "a quaternion that is not unit": fault("root_orientation", lambda one: 1.01 * one, "unit quaternions"),
    "a sign that flips": fault("root_orientation", lambda one: np.r_[one[:ROW], -one[ROW:]], "quaternion signs"),
    "time of another rate": Fault(
        lambda path: group(path)["time"].__setitem__(..., np.arange(150) / 50.0), "time", "time", ("time",)
    ),
    "a phase of 1": fault("phase", at(ROW, 1.0), "phase range"),
    "a phase that goes backwards": fault("phase", lambda one: one[::-1], "forward phase", "phase"),
    "a cycle that is not counted": fault("cycle", lambda one: 0.0 * one, "forward phase", "phase"),
    "a fraction of a cycle": fault("cycle", lambda one: one + 0.5, "whole cycles"),
    "a phase that stands still": Fault(
        several(values("phase", lambda one: np.r_[one[:ROW], one[ROW - 1 : -1]]),
                values("cycle", lambda one: np.r_[one[:ROW], one[ROW - 1 : -1]])),
        "even phase", "phase", ("phase", "cycle"),
    ),
    "another start phase": fault("start_phase", lambda one: (one + 0.3) % 1.0, "start phase"),
    "an impossible heading": fault("heading", lambda one: one + 7.0, "draws"),
    "another noise": fault("noise", lambda _: 1.5, "draws"),
    "linear velocity in the base frame": Fault(
        seen_from_the_base("root_linear_velocity"), "link kinematics", "link_linear_velocity",
        ("root_linear_velocity",), diagnosis="root_linear_velocity is in the base frame",
    ),
    "angular velocity in the base frame": Fault(
        seen_from_the_base("root_angular_velocity", AWAY), "root angular velocity, overall", "root_angular_velocity",
        ("root_angular_velocity",), (AWAY,), diagnosis="root_angular_velocity is in the base frame",
    ),
    "velocity of the centre of mass": Fault(
        centre_of_mass_velocity, "link kinematics", "link_linear_velocity", ("root_linear_velocity",),
        diagnosis="root_linear_velocity is that of the centre of mass",
    ),
    "velocities of zero": fault("joint_velocity", lambda one: 0.0 * one, "joint velocity, overall"),
    "a row that jumps": fault("root_position", lambda one: at(ROW, one[ROW] + 0.05)(one),
                              "root linear velocity, each row", "root_linear_velocity"),
    "an orientation that jumps": fault(
        "root_orientation", jump_in_orientation, "root angular velocity, each row", "root_angular_velocity"
    ),
    "a joint that jumps": fault(
        "joint_position", lambda one: at((ROW, 1), one[ROW, 1] + 0.5)(one), "joint velocity, each row", "joint_velocity"
    ),
    "a link that jumps": fault(
        "link_position", lambda one: at((ROW, 14), one[ROW, 14] + 0.1)(one),
        "link linear velocity, each row", "link_linear_velocity",
    ),
    "link velocities one row late": fault(
        "link_linear_velocity", late, "link linear velocity, overall",
        diagnosis="link_linear_velocity is one row late",
    ),
    "root position one row late": fault(
        "root_position", late, "root linear velocity, overall", "root_linear_velocity",
        diagnosis="root_position is one row late",
    ),
    "joint velocity one row late": fault(
        "joint_velocity", late, "joint velocity, overall", diagnosis="joint_velocity is one row late"
    ),
    "joints in degrees": fault(
        "joint_position", np.degrees, "joint limits", diagnosis="joint_position is in degrees"
    ),
    "joint velocities in degrees": fault(
        "joint_velocity", np.degrees, "joint velocity, overall", diagnosis="joint_velocity is in degrees"
    ),
    "joints in the motors' order": fault(
        "joint_position", swapped_joints, "forward kinematics", "link_position",
        diagnosis="joint_position has its joints in the motors' order",
    ),
    "all joints in the motors' order": Fault(
        several(*(values(name, swapped_joints) for name in JOINT_ARRAYS)),
        "forward kinematics", "link_position", JOINT_ARRAYS,
        diagnosis="all arrays have their joints in the motors' order",
    ),
    "quaternions (x, y, z, w)": fault(
        "root_orientation", lambda one: one[:, [1, 2, 3, 0]], "forward kinematics", "link_position",
        diagnosis="root_orientation is (x, y, z, w)",
    ),
    "quaternions the wrong way round": fault(
        "root_orientation", lambda one: one * [1.0, -1.0, -1.0, -1.0], "forward kinematics", "link_position",
        diagnosis="root_orientation is inverted",
    ),
    "links in millimetres": fault(
        "link_position", lambda one: 1e3 * one, "forward kinematics", diagnosis="link_position is in millimetres"
    ),
    "link velocities relative to the root": Fault(
        lambda path: values(
            "link_linear_velocity", lambda one: one - read(path, "root_linear_velocity")[TARGET][:, None]
        )(path),
        "link kinematics", "link_linear_velocity", ("link_linear_velocity",),
    ),
    "feet of the reference permuted": fault(
        "reference_foot_position", lambda one: one[:, [1, 0, 3, 2]], "reference kinematics",
        diagnosis="reference_foot_position has its feet in the motors' order",
    ),
    "a joint beyond its limits": fault("joint_position", at((ROW, 2), 0.5), "joint limits"),
    "feet of the forces permuted": fault(
        "foot_contact_force", lambda one: one[:, [1, 0, 3, 2]], "contact in the air",
        diagnosis="foot_contact_force has its feet in the motors' order",
    ),
    "forces of the feet on the floor": fault("foot_contact_force", lambda one: -one, "contact direction"),
    "forces in kilonewtons": fault("foot_contact_force", lambda one: 1e-3 * one, "weight"),
    "a foot that is glued": fault("foot_contact_force", push_along_the_floor, "friction"),
    "actions of another scale": fault("action", lambda one: 0.25 * one, "action"),
    "means in another order": fault("action_mean", swapped_joints, "action noise"),
    "means one row late": fault(
        "action_mean", late, "action mean's row", diagnosis="action_mean is one row late"
    ),
    "actions and targets one row late": Fault(
        several(*(values(name, late) for name in COMMANDS)), "motor law", "joint_torque", COMMANDS,
        diagnosis="actions and targets are one row late",
    ),
    "torques beyond the motors": fault("joint_torque", at((ROW, 3), 40.0), "torque limits"),
    "torques beyond what the motors give at that speed": Fault(
        several(values("joint_velocity", at((slice(ROW - 1, ROW + 1), 3), 25.0)),
                values("joint_torque", at((ROW, 3), 15.0))),
        "torque limits", "joint_torque", ("joint_velocity", "joint_torque"),
    ),
    "a joint faster than its motor": fault("joint_velocity", at((ROW, 2), 21.0), "joint speed"),
    "torques in the motors' order": fault(
        "joint_torque", swapped_joints, "motor law",
        diagnosis="joint_torque has its joints in the motors' order",
    ),
    "another heading": fault("heading", lambda one: -one, "reference heading", "reference_root_orientation"),
    "a reference of another heading": Fault(
        reference_of_another_heading, "reference path", "reference_root_position", REFERENCE
    ),
    "a reference one row late": Fault(
        several(*(values(name, late) for name in (*REFERENCE, "reference_joint_position"))),
        "joint position reward", "reward", (*REFERENCE, "reference_joint_position"),
    ),
    "rewards above the largest": fault("reward", at((ROW, 1), 1.0), "reward range"),
    "rewards one row late": fault("reward", late, "joint position reward", diagnosis="reward is one row late"),
    "rewards of the pose alone off": fault(
        "reward", lambda one: at((slice(None), 3), 0.5 * one[:, 3])(one), "root pose reward"
    ),
    "rewards of the feet alone off": fault(
        "reward", lambda one: at((slice(None), 2), 0.5 * one[:, 2])(one), "foot position reward"
    ),
    "a figure of quality off": fault("quality/root_error", lambda one: 1.1 * one, "quality"),
    "the seed of another trajectory": Fault(
        lambda path: group(path)["seed"].__setitem__(TARGET, read(path, "seed")[0]),
        "independent draws", "seed", ("seed",),
    ),
    "the noise of another trajectory": Fault(
        the_noise_of_another, "independent draws", "action", ("action", "joint_target"),
    ),
    "an initial state of zeros": Fault(
        several(scaled("initial_state/joint_q", by=0.0), scaled("initial_state/joint_qd", by=0.0)),
        "initial state", "initial_state/joint_q", ("initial_state/joint_q", "initial_state/joint_qd"),
    ),
    "the initial state of another trajectory": Fault(
        lambda path: group(path)["initial_state/joint_q"].__setitem__(TARGET, read(path, "initial_state/joint_q")[0]),
        "initial state", "initial_state/joint_q", ("initial_state/joint_q",),
    ),
    "the final state of another trajectory": Fault(
        lambda path: group(path)["final_state/joint_position"].__setitem__(
            TARGET, read(path, "final_state/joint_position")[0]
        ),
        "final state", "final_state/joint_position", ("final_state/joint_position",),
    ),
    "a base heavier than was drawn": fault(
        "initial_state/base_mass", lambda one: one + 2.0, "initial state"
    ),
    "a base heavier than the settings allow": Fault(
        added("initial_state/base_mass", "randomization/base_mass", what=2.0),
        "drawn parameters", "randomization/base_mass", ("initial_state/base_mass", "randomization/base_mass"),
    ),
    "half of the damping": Fault(
        scaled("initial_state/damping", "randomization/damping", by=0.5),
        "drawn parameters", "randomization/damping", ("initial_state/damping", "randomization/damping"),
    ),
    "noise levels permuted": Fault(
        lambda path: group(path)["noise"].__setitem__(..., read(path, "noise")[::-1]),
        "noise level", "noise", ("noise",), trajectories=(0, 1, 3, 4),
    ),
    "means that are the actions": Fault(
        lambda path: values("action_mean", lambda _: read(path, "action")[TARGET])(path),
        "noise level", "noise", ("action_mean",),
    ),
    "targets that were not applied": fault("applied_target", lambda one: one + 0.01, "applied target"),
    "torques of the last substeps 1.2 times too large": Fault(
        scaled("joint_torque", by=1.2), "peaks", "joint_torque", ("joint_torque",),
    ),
    "forces of the last substeps 0.7 times as large": Fault(
        scaled("foot_contact_force", by=0.7), "mean force", "foot_contact_force", ("foot_contact_force",),
    ),
    "all forces 0.7 times as large": Fault(
        scaled("foot_contact_force", "foot_contact_force_mean", "foot_contact_force_peak", by=0.7),
        "mean force", "foot_contact_force_mean",
        ("foot_contact_force", "foot_contact_force_mean", "foot_contact_force_peak"),
    ),
    "a robot that is sunk into the ground": Fault(
        sunk, "foot depth", "link_position", ("root_position", "link_position", "initial_state/joint_q"),
    ),
    "legs that always touch the ground": fault("leg_contact", lambda one: 0.0 * one + 1.0, "leg contact"),
    "links turned the wrong way round": fault(
        "link_orientation", lambda one: one * [1.0, -1.0, -1.0, -1.0], "link orientation",
        diagnosis="link_orientation is inverted",
    ),
    "links that turn too fast": fault("link_angular_velocity", lambda one: 1.01 * one, "link turning"),
    "reference velocities one row late": fault(
        "reference_joint_velocity", late, "reference velocity", diagnosis="reference_joint_velocity is one row late"
    ),
    "rewards of the joint velocities alone off": fault(
        "reward", lambda one: at((slice(None), 1), 0.5 * one[:, 1])(one), "joint velocity reward"
    ),
    "rewards of the root velocity alone off": fault(
        "reward", lambda one: at((slice(None), 4), 0.5 * one[:, 4])(one), "root velocity reward"
    ),
    "observations one row late": fault("observation", late, "observation", diagnosis="observation is one row late"),
    "an accepted rollout that ended early": fault("terminated", lambda _: 1, "terminated"),
    "contacts where there is no force": fault("foot_contact", lambda one: 1.0 - one, "foot contact"),
    "motors that are always at their limit": fault("torque_at_limit", lambda one: 0.0 * one + 1.0, "torque usage"),
    "motors that use half of what they give": fault("torque_usage", lambda one: 0.5 * one, "torque usage"),
    "mean forces on the wrong feet": fault("foot_contact_force_mean", lambda one: one[:, [1, 0, 3, 2]], "mean force"),
    "peaks beyond the motors": fault("joint_torque_peak", lambda one: 4.0 * one, "torque limits"),
    "a figure of jerk off": fault("quality/joint_jerk", lambda one: 1.1 * one, "quality"),
    "another final orientation": fault(
        "final_state/root_orientation", lambda one: one[[0, 3, 2, 1]], "final state"
    ),
    "a step too many": fault("initial_state/reference_step", lambda one: one + 1, "initial state"),
    "feet of the forces swapped crosswise": fault(
        "foot_contact_force", lambda one: one[:, [3, 2, 1, 0]], "foot contact", "foot_contact",
        diagnosis="foot_contact_force has its feet swapped crosswise",
    ),
    "a row left out": Fault(
        left_out, "even phase", "phase", EVERY_ROW, diagnosis="a row was left out of all arrays"
    ),
    "a latency of three substeps": Fault(
        several(values("initial_state/delay", lambda _: 3), values("randomization/latency", lambda _: 3 / 240)),
        "drawn parameters", "randomization/latency", ("initial_state/delay", "randomization/latency"),
        diagnosis="randomization/latency and initial_state/delay are not the latency of the settings, 5 substeps",
    ),
    "commands three rows late": Fault(
        several(*(values(name, three_late) for name in COMMANDS)), "motor law", "joint_torque", COMMANDS,
        diagnosis="actions and targets are three rows late",
    ),
    "trajectories swapped in one array": Fault(
        lambda path: group(path)["joint_position"].__setitem__(
            ..., read(path, "joint_position")[[0, 3, 2, 1, 4]]
        ),
        "forward kinematics", "link_position", ("joint_position",), trajectories=(1, 3),
    ),
}  # fmt: skip
"""Faults of the rows of one trajectory."""
