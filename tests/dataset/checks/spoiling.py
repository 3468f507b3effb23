"""Ways to spoil a copy of a dataset."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zarr
from scipy.spatial.transform import Rotation

from kine2go_warp.robots import GO2

MOTION = "dog_trot"
TARGET = 1
"""The trajectory that is spoiled."""
ROW = 60
"""The row that is spoiled, where it is a single one."""
SHORTER = 2
"""A trajectory that ends earlier than the arrays."""

SDK = [GO2.joint_names.index(name) for name in GO2.sdk_motor_order]
COM = np.array([0.021112, 0.0, -0.005366])
"""Centre of mass of the base link in its own frame [m], from the URDF."""

Spoil = Callable[[Path], None]


@dataclass(frozen=True)
class Fault:
    """A fault and what must be said of it."""

    spoil: Spoil
    check: str
    array: str | None
    touches: tuple[str, ...] = ()
    """Arrays that are spoiled; only checks that read one of them may complain. Empty: the store itself is spoiled."""
    trajectories: tuple[int, ...] = (TARGET,)
    diagnosis: str = ""
    """Text that one of the diagnoses must hold."""
    others: tuple[str, ...] = ()
    """Checks that complain with good reason of a fault of the store, too."""


def group(path):
    return zarr.open_group(path / MOTION, mode="r+", use_consolidated=False)


def read(path, name):
    return np.asarray(group(path)[name][...])


def values(name, function, trajectory=TARGET):
    """Change a trajectory's rows of an array, shape [rows, ...], in place or by returning others."""

    def spoil(path):
        whole = read(path, name)
        result = function(whole[trajectory])
        if result is not None:
            whole[trajectory] = result
        group(path)[name][...] = whole

    return spoil


def fault(name, function, check, array=None, **options):
    return Fault(values(name, function), check, array or name, (name,), **options)


def at(row, value):
    def function(one):
        one[row] = value

    return function


def late(one):
    """Move rows one back, as a writer does that stores a state with the next row's others."""
    return np.concatenate([one[:1], one[:-1]])


def three_late(one):
    """Move rows three back."""
    return np.concatenate([one[:1], one[:1], one[:1], one[:-3]])


def left_out(path):
    """Leave one row out of all arrays of a trajectory, which is a row shorter then."""
    for name, array in by_trajectory(path):
        if array.metadata.dimension_names[1:2] == ("frame",):
            values(name, lambda one: np.r_[one[:ROW], one[ROW + 1 :], np.nan * one[-1:]])(path)
    values("length", lambda one: one - 1)(path)


def rotation(path, trajectory=TARGET):
    return Rotation.from_quat(read(path, "root_orientation")[trajectory][:, [1, 2, 3, 0]])


def seen_from_the_base(name, trajectory=TARGET):
    def spoil(path):
        whole = read(path, name)
        whole[trajectory] = rotation(path, trajectory).inv().apply(whole[trajectory])
        group(path)[name][...] = whole

    return spoil


def jump_in_orientation(one):
    """Turn one row by 0.3 rad about its own x axis."""
    turned = Rotation.from_quat(one[ROW, [1, 2, 3, 0]]) * Rotation.from_rotvec([0.3, 0.0, 0.0])
    one[ROW] = np.sign(one[ROW, 0]) * turned.as_quat(canonical=True)[[3, 0, 1, 2]]


def centre_of_mass_velocity(path):
    whole = read(path, "root_linear_velocity")
    arm = rotation(path).apply(COM)
    whole[TARGET] += np.cross(read(path, "root_angular_velocity")[TARGET], arm)
    group(path)["root_linear_velocity"][...] = whole


def reference_of_another_heading(path):
    """Turn the whole reference about the z axis, as if ``heading`` were another."""
    turn = Rotation.from_euler("z", 0.3)
    for name in ("reference_root_position", "reference_foot_position"):
        values(name, lambda one: turn.apply(one.reshape(-1, 3)).reshape(one.shape))(path)

    def turned(one):
        return (turn * Rotation.from_quat(one[:, [1, 2, 3, 0]])).as_quat()[:, [3, 0, 1, 2]]

    values("reference_root_orientation", turned)(path)


def several(*spoils):
    def spoil(path):
        for one in spoils:
            one(path)

    return spoil


def attribute(name, value, motion=False):
    def spoil(path):
        zarr.open_group(path / MOTION if motion else path, mode="r+", use_consolidated=False).attrs[name] = value

    return spoil


def stricter_limits(path):
    """Say in the attributes that accepted rollouts track their joints within a thousandth of a radian."""
    attributes = group(path).attrs
    settings = {**json.loads(attributes["gather_settings"]), "max_joint_rmse": 1e-3}
    attributes["gather_settings"] = json.dumps(settings)


def metadata(name, **changes):
    def spoil(path):
        file = path / MOTION / name / "zarr.json"
        file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))

    return spoil


def shard(path, name):
    return next(one for one in (path / MOTION / name / "c").rglob("*") if one.is_file())


def truncate(path):
    file = shard(path, "joint_torque")
    file.write_bytes(file.read_bytes()[:-100])


def garble(part):
    def spoil(path):
        file = shard(path, "joint_torque")
        content = bytearray(file.read_bytes())
        content[part] = bytes(len(content[part]))
        file.write_bytes(content)

    return spoil


def stale_index(path):
    """Add an array to the motion, after the indices were written."""
    group(path).create_array("mass", shape=(5,), dtype="f4")


def rewritten(name, function):
    """Write an array anew with other metadata."""

    def spoil(path):
        old = group(path)[name]
        names, attributes, content = old.metadata.dimension_names, dict(old.attrs), function(old[...])
        shutil.rmtree(path / MOTION / name)
        new = group(path).create_array(
            name, shape=content.shape, dtype=content.dtype, dimension_names=names, fill_value=old.fill_value,
            attributes=attributes,
        )  # fmt: skip
        new[...] = content

    return spoil


def by_trajectory(path):
    """Names and arrays of the motion with an entry a trajectory, those of sub-groups, too."""
    for name, array in group(path).members(max_depth=None):
        if isinstance(array, zarr.Array) and array.metadata.dimension_names[0] == "trajectory":
            yield name, array


def copied_trajectory(path):
    """Store the first trajectory in the spoiled one's place, too, under a seed of its own."""
    for name, array in by_trajectory(path):
        if name not in ("trajectory", "seed"):
            whole = array[...]
            whole[TARGET] = whole[0]
            array[...] = whole


def push_along_the_floor(one):
    standing = one[:, 0, 2] > 20.0
    assert standing.any()
    one[standing, 0, 0] = 2.0 * one[standing, 0, 2]


def swapped_joints(one):
    return one[:, SDK]


def the_noise_of_another(path):
    """Give the spoiled trajectory the action noise of the first one."""
    mean, scale = read(path, "action_mean"), GO2.action_scale
    action = mean[TARGET] + read(path, "action")[0] - mean[0]
    values("action", lambda _: action)(path)
    values("joint_target", lambda _: action * scale + np.float32(GO2.default_joint_position))(path)


def scaled(*names, by, trajectory=TARGET):
    """Multiply arrays of the spoiled trajectory."""
    return several(*(values(name, lambda one: by * one, trajectory) for name in names))


def added(*names, what, trajectory=TARGET):
    """Add a number to arrays of the spoiled trajectory."""
    return several(*(values(name, lambda one: one + np.float32(what), trajectory) for name in names))


def sunk(path):
    """Lower the whole robot by two centimetres."""
    down = np.float32([0.0, 0.0, -0.02])
    for name in ("root_position", "link_position"):
        values(name, lambda one: one + down)(path)
    values("initial_state/joint_q", lambda one: one + np.float32([0.0, 0.0, -0.02] + 16 * [0.0]))(path)


def no_pushes(path):
    """Forget the pushes of all trajectories."""
    assert (np.nan_to_num(read(path, "push")) != 0.0).any()
    group(path)["push"][...] = 0.0 * read(path, "push")


def turned_copy(path):
    """Store the first trajectory in the spoiled one's place, too, turned by 1 rad about the z axis."""
    copied_trajectory(path)
    turn = Rotation.from_euler("z", 1.0)
    values("heading", lambda one: np.arctan2(np.sin(one + 1.0), np.cos(one + 1.0)))(path)
    for name, array in by_trajectory(path):
        if name.startswith(("randomization/", "initial_state/")):
            continue
        if array.metadata.dimension_names[-1] == "axis":
            values(name, lambda one: turn.apply(one.reshape(-1, 3)).reshape(one.shape))(path)
        elif array.metadata.dimension_names[-1] == "quaternion":
            values(name, turned_quaternions)(path)


def turned_quaternions(one):
    """Turn orientations (w, x, y, z) by 1 rad about the z axis, with one sign for all of them."""
    flat = (Rotation.from_euler("z", 1.0) * Rotation.from_quat(one.reshape(-1, 4)[:, [1, 2, 3, 0]])).as_quat()
    flat = flat[:, [3, 0, 1, 2]]
    for row in range(1, len(flat)):
        flat[row] *= np.sign(flat[row] @ flat[row - 1])
    return flat.reshape(one.shape)
