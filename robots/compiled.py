"""The robot compiled by MuJoCo itself from URDF and specification, and hashes of the compiled numbers."""

import hashlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import mujoco as mujoco_package
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from kine2go_warp.robots.spec import RobotSpec


mujoco: Any = mujoco_package
"""The package without its types: it names its compiled classes in a way that type checkers do not see."""

DIGITS = 6
"""Significant digits of a number that count."""


def robot_tree(spec: "RobotSpec") -> Any:
    """Return the floating robot as MuJoCo's editable specification: capsules for legs, rotor inertia at the joints."""
    tree = mujoco.MjSpec.from_file(str(spec.urdf))
    tree.body(spec.base_link).add_freejoint()
    for name in spec.joint_names:
        tree.joint(name).armature = spec.armature
    for geom in tree.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER:
            geom.type = mujoco.mjtGeom.mjGEOM_CAPSULE
            # A capsule of the cylinder's outer length.
            geom.size[1] -= geom.size[0]
    return tree


def model_numbers(spec: "RobotSpec") -> dict[str, list[NDArray[Any]]]:
    """Return the numbers of the compiled robot that decide how it moves, by what they are."""
    model = robot_tree(spec).compile()
    limits = spec.motor_limits
    return {
        "masses": [model.body_mass],
        "centres of mass": [model.body_ipos],
        "inertias": [model.body_inertia, turned_up(model.body_iquat)],
        "joints": [model.body_pos, turned_up(model.body_quat), model.jnt_pos, model.jnt_axis],
        "joint limits": [model.jnt_range],
        "rotor inertia": [model.dof_armature],
        "joint friction": [np.array(spec.joint_friction)],
        "motor limits": [np.array(values) for values in vars(limits).values()],
        "shapes": [model.geom_type, model.geom_size, model.geom_pos, turned_up(model.geom_quat)],
    }


def turned_up(quaternions: NDArray[Any]) -> NDArray[Any]:
    """Return quaternions (w, x, y, z) with their signs chosen, for those of a rotation are two."""
    first = np.take_along_axis(quaternions, np.argmax(np.abs(quaternions) > 1e-6, axis=1)[:, None], axis=1)
    return quaternions * np.sign(first)


def model_parts(spec: "RobotSpec") -> dict[str, str]:
    """Return a short hash of each part of ``model_numbers``."""
    hashes = {}
    for name, arrays in model_numbers(spec).items():
        # Rounding makes compilers and processors agree; adding zero drops the sign of -0.
        text = ";".join(" ".join(f"{value + 0.0:.{DIGITS}g}" for value in tidy(array)) for array in arrays)
        hashes[name] = hashlib.sha256(text.encode()).hexdigest()[:12]
    return hashes


def tidy(array: NDArray[Any]) -> NDArray[Any]:
    """Return all values of an array with rounding about zero removed."""
    values = np.asarray(array, np.float64).ravel()
    return np.where(np.abs(values) < 1e-9, 0.0, values)


def model_difference(stored: Mapping[str, Any], spec: "RobotSpec") -> str:
    """Return in one line how the robot of a dataset differs from the present one, an empty text if it does not.

    Args:
        stored: Attributes of the motion, of which ``model_parts`` counts.
        spec: The present robot.
    """
    parts = stored.get("model_parts")
    if not isinstance(parts, Mapping):
        return "no hash of its model: calves had twice the inertia, stops were springs, motors knew no speed limit"
    changed = [name for name, value in model_parts(spec).items() if parts.get(name) != value]
    return f"changed since: {', '.join(changed)}" if changed else ""
