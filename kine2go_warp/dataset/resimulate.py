"""Simulates a trajectory of a dataset anew from what the store says: resimulate.py DATASET MOTION [TRAJECTORY [ROWS]].

It needs zarr, numpy and mujoco and nothing else of this package, so that it can be copied and changed.
"""

import json
import sys
from typing import Any

import mujoco as mujoco_package
import numpy as np
import zarr

mujoco: Any = mujoco_package
ROWS = ("root_position", "root_orientation", "root_linear_velocity", "root_angular_velocity", "joint_position",
        "joint_velocity", "joint_target", "friction_anchor", "push", "joint_torque")  # fmt: skip
"""Row arrays that a simulation needs; torques are for comparison."""
CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE
STEEP = 0.75**0.5
"""Cosine of the angle to the vertical above which a capsule is steep: less than half of its axis is seen from above."""


class StoredRobot:
    """The robot of one trajectory; ``data`` is MuJoCo's state, torques [N m] and powers [W] are of each substep."""

    def __init__(self, attributes: dict[str, Any], start: dict[str, np.ndarray], rows: dict[str, np.ndarray]) -> None:
        """Compile the model of a motion's attributes and give it what was drawn for the trajectory."""
        record = attributes["simulation"]
        self.record = json.loads(record) if isinstance(record, str) else record
        self.start, self.rows, self.torques = start, rows, np.zeros((self.record["substeps"], 12))
        self.powers = np.zeros_like(self.torques)
        model = self.model = mujoco.MjModel.from_xml_string(attributes["robot_xml"])
        model.opt.timestep = self.record["timestep"]
        base = model.body(self.record["base_link"]).id
        model.body_inertia[base] *= start["base_mass"] / model.body_mass[base]
        model.body_mass[base], model.body_ipos[base] = start["base_mass"], start["base_com"]
        model.geom_friction[model.geom_bodyid > 0, 0] = start["friction"]
        self.data = mujoco.MjData(model)
        mujoco.mj_setConst(model, self.data)

    def place(self, row: int) -> None:
        """Put the robot into the state of a row."""
        state, data, rotation = {name: self.rows[name][row] for name in ROWS}, self.data, np.zeros(9)
        mujoco.mj_resetData(self.model, data)
        mujoco.mju_quat2Mat(rotation, state["root_orientation"].astype(float))
        data.qpos[:] = np.concatenate([state["root_position"], state["root_orientation"], state["joint_position"]])
        turn = rotation.reshape(3, 3).T @ state["root_angular_velocity"]
        data.qvel[:] = np.concatenate([state["root_linear_velocity"], turn, state["joint_velocity"]])
        self.anchor = state["friction_anchor"].astype(float)

    def step(self, row: int) -> None:
        """Take the control step from a row to the next."""
        start, record, data = self.start, self.record, self.data
        limits = {name: np.array(values) for name, values in record["motor_limits"].items()}
        spring, damping, strength = record["friction_stiffness"], record["friction_damping"], start["joint_friction"]
        data.qvel[:3] += self.rows["push"][row]
        for substep in range(record["substeps"]):
            target = self.target(row + (substep - int(start["delay"])) // record["substeps"])
            position, velocity = data.qpos[7:].copy(), data.qvel[6:].copy()
            law = start["stiffness"] * (target + start["motor_offset"] - position) - start["damping"] * velocity
            demand, free, full = start["strength"] * law, limits["no_load_speed"], limits["full_torque_speed"]
            driving = limits["driving"] * np.clip((free - np.abs(velocity)) / (free - full), 0.0, 1.0)
            limit = np.where(demand * velocity < 0.0, limits["braking"], driving)
            torque = self.torques[substep] = np.clip(demand, -limit, limit)
            self.anchor = position - np.clip(position - self.anchor, -strength / spring, strength / spring)
            friction = -spring * (position - self.anchor) - damping * velocity
            data.qfrc_applied[6:] = torque + np.clip(friction, -strength, strength)
            self.substep()
            self.powers[substep] = torque * data.qvel[6:]

    def substep(self) -> None:
        """Take one physics substep, with the contact frames of MuJoCo Warp.

        MuJoCo lays the first tangent of a capsule on the ground along its axis as seen from above. MuJoCo Warp does so
        for capsules within 60 degrees of the ground, and lays it along the world's y axis for steeper ones. As
        friction is a pyramid, the directions matter.
        """
        model, data = self.model, self.data
        mujoco.mj_fwdPosition(model, data)
        for contact in data.contact:
            ground, leg = sorted(contact.geom)
            is_leg = model.geom_type[ground] == mujoco.mjtGeom.mjGEOM_PLANE and model.geom_type[leg] == CAPSULE
            if is_leg and abs(data.geom_xmat[leg, 8]) > STEEP:
                contact.frame[3:] = (0.0, 1.0, 0.0, *np.cross(contact.frame[:3], (0.0, 1.0, 0.0)))
        mujoco.mj_makeConstraint(model, data)
        mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        mujoco.mj_fwdConstraint(model, data)
        mujoco.mj_Euler(model, data)

    def target(self, row: int) -> np.ndarray:
        """Return the joint target that was commanded in a row, also in one before the first."""
        if row >= 0:
            return self.rows["joint_target"][row]
        queue = self.start["target_queue"]
        return queue[(int(self.start["reference_step"]) + row) % len(queue)]


def trajectory(dataset: str, motion: str, index: int) -> StoredRobot:
    """Return the robot of a trajectory of a dataset."""
    group: Any = zarr.open_group(dataset, path=motion, mode="r")
    start = {name: np.asarray(array[index]) for name, array in group["initial_state"].arrays()}
    return StoredRobot(dict(group.attrs), start, {name: np.asarray(group[name][index]) for name in ROWS})


def joint_differences(robot: StoredRobot, rows: int) -> np.ndarray:
    """Return the largest difference of a joint from its record in each of the first rows [rad], shape [rows]."""
    robot.place(0)
    found = np.zeros(rows)
    for row in range(rows):
        found[row] = np.abs(robot.data.qpos[7:] - robot.rows["joint_position"][row]).max()
        robot.step(row)
    return found


if __name__ == "__main__":
    number, length = (int(text) for text in (*sys.argv[3:], *("0", "120")[len(sys.argv) - 3 :]))
    worst = joint_differences(trajectory(sys.argv[1], sys.argv[2], number), length).max()
    print(f"largest difference of a joint over {length} rows: {worst:.2g} rad")
