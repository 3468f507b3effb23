"""Simulates a trajectory of a dataset anew: resimulate.py DATASET MOTION [TRAJECTORY [ROWS]]. Needs zarr, numpy, mujoco."""

import json
import sys

import mujoco
import numpy as np
import zarr


def resimulate(dataset: str, motion: str, trajectory: int, num_rows: int) -> np.ndarray:
    """Return the largest difference of a joint from the record in each row [rad], shape [num_rows]."""
    group = zarr.open_group(dataset, path=motion, mode="r")
    record = json.loads(group.attrs["simulation"])
    start = {name: np.asarray(array[trajectory], float) for name, array in group["initial_state"].arrays()}
    rows = {name: np.asarray(group[name][trajectory]) for name in ("joint_target", "push", "joint_position")}
    limits = {name: np.array(values) for name, values in record["motor_limits"].items()}
    model = mujoco.MjModel.from_xml_string(group.attrs["robot_xml"])
    model.opt.timestep = record["timestep"]
    base = model.body(record["base_link"]).id
    model.body_inertia[base] *= start["base_mass"] / model.body_mass[base]
    model.body_mass[base], model.body_ipos[base] = start["base_mass"], start["base_com"]
    model.geom_friction[model.geom_bodyid > 0, 0] = start["friction"]
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)

    turn, rotation = start["joint_q"][[6, 3, 4, 5]], np.zeros(9)
    mujoco.mju_quat2Mat(rotation, turn)
    rotation = rotation.reshape(3, 3)
    data.qpos[:] = np.concatenate([start["joint_q"][:3], turn, start["joint_q"][7:]])
    linear, angular = start["joint_qd"][:3], start["joint_qd"][3:6]
    data.qvel[:3] = linear - np.cross(angular, rotation @ start["base_com"])  # of the link's origin, not the centre of mass
    data.qvel[3:6], data.qvel[6:] = rotation.T @ angular, start["joint_qd"][6:]

    substeps, delay, first = record["substeps"], int(start["delay"]), int(start["reference_step"])
    queue, anchor = start["target_queue"], start["friction_anchor"]
    reach = start["joint_friction"] / record["friction_stiffness"]
    error = np.zeros(num_rows)
    for row in range(num_rows):
        error[row] = np.abs(data.qpos[7:] - rows["joint_position"][row]).max()
        queue[(first + row) % len(queue)] = rows["joint_target"][row]
        data.qvel[:3] += rows["push"][row]
        for substep in range(substeps):
            target = queue[((first + row) * substeps + substep - delay) // substeps % len(queue)]
            position, velocity = data.qpos[7:].copy(), data.qvel[6:].copy()
            law = start["stiffness"] * (target + start["motor_offset"] - position) - start["damping"] * velocity
            torque = start["strength"] * law
            free, full = limits["no_load_speed"], limits["full_torque_speed"]
            driving = limits["driving"] * np.clip((free - np.abs(velocity)) / (free - full), 0.0, 1.0)
            limit = np.where(torque * velocity < 0.0, limits["braking"], driving)
            anchor = position - np.clip(position - anchor, -reach, reach)
            friction = -record["friction_stiffness"] * (position - anchor) - record["friction_damping"] * velocity
            friction = np.clip(friction, -start["joint_friction"], start["joint_friction"])
            data.qfrc_applied[6:] = np.clip(torque, -limit, limit) + friction
            mujoco.mj_step(model, data)
    return error


if __name__ == "__main__":
    number, length = (int(text) for text in (*sys.argv[3:], "0", "120")[:2]) if len(sys.argv) < 5 else map(int, sys.argv[3:5])
    print(f"largest difference over {length} rows: {resimulate(sys.argv[1], sys.argv[2], number, length).max():.2g} rad")
