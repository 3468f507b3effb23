"""Whether rows follow from one another by the laws of motion: plain MuJoCo takes single steps with the stored robot."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.checks.catalogue import PHYSICS, PHYSICS_LIMITS, PHYSICS_STRIDE
from kine2go_warp.dataset.checks.reading import StoredMotion
from kine2go_warp.dataset.checks.records import Finding
from kine2go_warp.dataset.resimulate import ROWS, StoredRobot, mujoco
from kine2go_warp.dataset.schema import FINAL_STATE_ARRAYS
from kine2go_warp.robots import RobotSpec

JUMPS = 10
"""Rows in which the base's velocity changes most; steps are taken from them, too, since pushes are rare."""
SHARE = 0.1
"""More of the steps than this must not be off."""
FAR = 100.0
"""No step may be off by more than so many limits."""

FINAL = tuple(f"final_state/{array.name}" for array in FINAL_STATE_ARRAYS if array.name in PHYSICS_LIMITS)
NEEDED = tuple({*ROWS, *PHYSICS_LIMITS, *FINAL})


def physics_findings(motion: StoredMotion, spec: RobotSpec) -> list[Finding] | None:
    """Return the trajectories whose rows do not follow from one another, None if the motion cannot be simulated."""
    names = [*NEEDED, *(name for name in motion.arrays if name.startswith("initial_state/"))]
    text = {name: motion.attributes.get(name) for name in ("simulation", "robot_xml")}
    if not isinstance(text["simulation"], dict) or not isinstance(text["robot_xml"], str):
        return None
    if text["simulation"].get("ground") != "flat" or not {*NEEDED, "length"} <= set(motion.arrays):
        return None
    findings: list[Finding] = []
    lengths = motion.read("length")
    for index, length in enumerate(lengths if lengths is not None else ()):
        stored = {name: motion.read(name, slice(index, index + 1)) for name in names}
        one = {name: values[0] for name, values in stored.items() if values is not None}
        start = {name.partition("/")[2]: values for name, values in one.items() if name.startswith("initial_state/")}
        try:
            robot = StoredRobot(motion.attributes, start, one)
            findings += trajectory_findings(robot, one, int(length), motion.name, index, spec)
        except Exception as error:  # noqa: BLE001 - damaged numbers make MuJoCo and NumPy fail in many ways
            what = f"cannot be simulated ({error.__class__.__name__})"
            findings.append(Finding(PHYSICS.name, motion.name, what, trajectory=index))
    return findings


def trajectory_findings(
    robot: StoredRobot, rows: dict[str, NDArray[Any]], length: int, motion: str, index: int, spec: RobotSpec
) -> Iterator[Finding]:
    """Yield the arrays of a trajectory that are not what steps from its rows give."""
    jumps = np.linalg.norm(np.diff(rows["root_linear_velocity"][:length], axis=0), axis=-1)
    jumpy = np.argsort(-np.nan_to_num(jumps))[:JUMPS].tolist()
    chosen = sorted({*range(0, length - 1, PHYSICS_STRIDE), *jumpy, length - 1})
    after = {name: rows[name][1:length] for name in PHYSICS_LIMITS}
    for name in set(PHYSICS_LIMITS) & {array.name for array in FINAL_STATE_ARRAYS}:
        after[name] = np.concatenate([after[name], rows[f"final_state/{name}"][None]])
    feet = foot_shapes(robot, spec)
    off = np.array([step_errors(robot, after, row, feet) for row in chosen]).reshape(-1, len(PHYSICS_LIMITS))
    for (name, (limit, unit)), errors in zip(PHYSICS_LIMITS.items(), off.T, strict=True):
        wrong = ~(errors <= limit)
        if len(errors) and (wrong.mean() > SHARE or not errors.max() <= FAR * limit):
            row = int(np.argmax(np.where(np.isnan(errors), np.inf, errors)))
            value = float(np.nan_to_num(errors[row], nan=np.inf, posinf=np.finfo(float).max))
            yield Finding(
                PHYSICS.name, motion, "not where a step of plain MuJoCo from the row before leads: off", name, index,
                chosen[row] + 1, value, limit, unit, int(wrong.sum()),
            )  # fmt: skip


def step_errors(robot: StoredRobot, after: dict[str, NDArray[Any]], row: int, feet: list[int]) -> list[float]:
    """Return how far the next row is from where a step from this one leads, in the order of ``PHYSICS_LIMITS``.

    ``after`` has what follows each row, of the last one the final state alone.
    """
    robot.place(row)
    robot.step(row)
    data, rotation = robot.data, np.zeros(9)
    mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
    found = {
        "joint_position": data.qpos[7:], "joint_velocity": data.qvel[6:], "root_linear_velocity": data.qvel[:3],
        "root_angular_velocity": rotation.reshape(3, 3) @ data.qvel[3:6],
        "joint_torque": robot.torques[-1], "foot_contact_force": foot_forces(robot, feet),
        "joint_torque_mean": robot.torques.mean(axis=0), "joint_torque_peak": np.abs(robot.torques).max(axis=0),
        "joint_power_mean": robot.powers.mean(axis=0), "joint_power_peak": np.abs(robot.powers).max(axis=0),
        "friction_anchor": robot.anchor,
    }  # fmt: skip
    return [
        float(np.abs(found[name] - after[name][row]).max()) if row < len(after[name]) else 0.0
        for name in PHYSICS_LIMITS
    ]


def foot_shapes(robot: StoredRobot, spec: RobotSpec) -> list[int]:
    """Return the number of each foot's shape: the sphere on the calf."""
    model = robot.model
    calves = [model.body(name).id for name in spec.leg_links[2::3]]
    spheres = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_SPHERE)
    return [next(int(geom) for geom in spheres if model.geom_bodyid[geom] == calf) for calf in calves]


def foot_forces(robot: StoredRobot, feet: list[int]) -> NDArray[np.float64]:
    """Return the force of the ground on each foot in the world frame [N], shape [4, 3]."""
    forces, wrench = np.zeros((4, 3)), np.zeros(6)
    for number in range(robot.data.ncon):
        contact = robot.data.contact[number]
        for shape, sign in ((contact.geom1, -1.0), (contact.geom2, 1.0)):
            if shape in feet:
                mujoco.mj_contactForce(robot.model, robot.data, number, wrench)
                forces[feet.index(shape)] += sign * np.reshape(contact.frame, (3, 3)).T @ wrench[:3]
    return forces
