"""Trajectories and clips as motions for other trackers: a file each, in whose program's form the table says."""

import json
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.exports.features import Field, stored
from kine2go_warp.exports.target import Output, Target, check_finite
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.rotations import conjugate, multiply, rotate, rotation_vector

Array = NDArray[np.float64]

BODY_ARRAYS = (
    "root_position", "root_orientation", "root_linear_velocity", "root_angular_velocity", "joint_position",
    "joint_velocity", "link_position", "link_orientation", "link_linear_velocity", "link_angular_velocity",
)  # fmt: skip
"""What a motion for a tracker is made of, by the names of the dataset."""

AMP_LEGS = ("FR", "FL", "RR", "RL")
"""Order of the legs in files of AMP."""

XYZW = (1, 2, 3, 0)
"""Places of x, y, z, w in our quaternions."""


@dataclass(frozen=True)
class BodyMotion:
    """A motion of base, joints and links."""

    rate: float
    """Rows a second [Hz]."""
    repeats: bool
    """Whether its end is where it begins, one cycle later."""
    rows: Mapping[str, NDArray[Any]]
    """The arrays of ``BODY_ARRAYS``, each of shape [num_rows, ...]."""
    joint_names: tuple[str, ...]
    """Leg by leg, each hip, thigh, calf."""
    link_names: tuple[str, ...]
    """Twelve links that joints move, then four feet."""
    sdk_motor_order: tuple[str, ...]

    def array(self, name: str) -> Array:
        """Return one of the arrays in double precision."""
        return np.asarray(self.rows[name], np.float64)

    def bodies(self, array: str) -> Array:
        """Return an array of base and of the links that joints move, in MuJoCo's order, shape [num_rows, 13, ...]."""
        base = {"position": "root_position", "orientation": "root_orientation"}
        of_base = base.get(array, f"root_{array}")
        return np.concatenate([self.array(of_base)[:, None], self.array(f"link_{array}")[:, :12]], axis=1)

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of those bodies."""
        return ("base", *self.link_names[:12])

    @property
    def orientation_xyzw(self) -> Array:
        """Orientation of the base, (x, y, z, w), shape [num_rows, 4]."""
        return self.array("root_orientation")[:, XYZW]


def write_mjlab(motion: BodyMotion, path: Path) -> None:
    """Write an ``.npz`` as mjlab and BeyondMimic read it; names of joints and bodies stand beside."""
    arrays = {
        "joint_pos": motion.array("joint_position"),
        "joint_vel": motion.array("joint_velocity"),
        "body_pos_w": motion.bodies("position"),
        "body_quat_w": motion.bodies("orientation"),
        "body_lin_vel_w": motion.bodies("linear_velocity"),
        "body_ang_vel_w": motion.bodies("angular_velocity"),
    }
    with path.open("wb") as file:
        np.savez(
            file,
            allow_pickle=False,
            fps=np.array([motion.rate]),
            joint_names=np.array(motion.joint_names),
            body_names=np.array(motion.body_names),
            **arrays,
        )


def write_mimickit(motion: BodyMotion, path: Path) -> None:
    """Write MimicKit's pickle, of lists and numbers alone: base, rotation vector, joints."""
    vector = rotation_vector(motion.array("root_orientation"))
    frames = np.concatenate([motion.array("root_position"), vector, motion.array("joint_position")], axis=1)
    content = {"loop_mode": int(motion.repeats), "fps": motion.rate, "frames": frames.tolist()}
    path.write_bytes(pickle.dumps(content))


def write_amp(motion: BodyMotion, path: Path) -> None:
    """Write the 61 columns of AMP as JSON: pose, joints, feet, and the velocities of them in the frame of the base."""
    turn = conjugate(motion.array("root_orientation"))
    places = np.array([3 * LEG_NAMES.index(leg) + joint for leg in AMP_LEGS for joint in range(3)])
    legs = [LEG_NAMES.index(leg) for leg in AMP_LEGS]
    linear = rotate(turn, motion.array("root_linear_velocity"))
    angular = rotate(turn, motion.array("root_angular_velocity"))
    each = turn[:, None]
    feet = rotate(each, motion.array("link_position")[:, 12:] - motion.array("root_position")[:, None])
    moving = rotate(each, motion.array("link_linear_velocity")[:, 12:]) - linear[:, None]
    moving -= np.cross(angular[:, None], feet)
    count = len(feet)
    columns = [
        motion.array("root_position"), motion.orientation_xyzw, motion.array("joint_position")[:, places],
        feet[:, legs].reshape(count, -1), linear, angular, motion.array("joint_velocity")[:, places],
        moving[:, legs].reshape(count, -1),
    ]  # fmt: skip
    content = {
        "LoopMode": "Wrap" if motion.repeats else "Clamp",
        "FrameDuration": 1.0 / motion.rate,
        "EnableCycleOffsetPosition": True,
        "EnableCycleOffsetRotation": True,
        "MotionWeight": 1.0,
        "Frames": np.concatenate(columns, axis=1).tolist(),
    }
    path.write_text(json.dumps(content))


def write_humanoidverse(motion: BodyMotion, path: Path) -> None:
    """Write the pickle of HumanoidVerse, PHC and ASAP: a dictionary with one motion, of arrays alone."""
    joints = motion.array("joint_position")
    axes = np.array([(1.0, 0.0, 0.0) if name.endswith("hip_joint") else (0.0, 1.0, 0.0) for name in motion.joint_names])
    root = rotation_vector(motion.array("root_orientation"))[:, None]
    content = {
        "root_trans_offset": motion.array("root_position"),
        "root_rot": motion.orientation_xyzw,
        "dof": joints,
        "pose_aa": np.concatenate([root, joints[:, :, None] * axes], axis=1),
        "fps": motion.rate,
    }
    path.write_bytes(pickle.dumps({path.stem: content}))


def write_protomotions(motion: BodyMotion, path: Path) -> None:
    """Write the ``.motion`` of ProtoMotions: torch tensors of joints and bodies, quaternions (x, y, z, w)."""
    import torch

    orientation = motion.bodies("orientation")
    before = np.concatenate([orientation[:, :1], orientation[:, [0 if k % 3 == 0 else k for k in range(12)]]], axis=1)
    local = multiply(conjugate(before), orientation)
    local[:, 0] = orientation[:, 0]
    content: dict[str, Any] = {
        "dof_pos": motion.array("joint_position"),
        "dof_vel": motion.array("joint_velocity"),
        "rigid_body_pos": motion.bodies("position"),
        "rigid_body_rot": orientation[..., XYZW],
        "rigid_body_vel": motion.bodies("linear_velocity"),
        "rigid_body_ang_vel": motion.bodies("angular_velocity"),
        "local_rigid_body_rot": local[..., XYZW],
    }
    tensors = {
        name: torch.tensor(np.ascontiguousarray(values), dtype=torch.float32) for name, values in content.items()
    }
    torch.save({**tensors, "fps": motion.rate}, path)


def write_unitree(motion: BodyMotion, path: Path) -> None:
    """Write a table with names: time, base, orientation (x, y, z, w), joints in the order of Unitree's SDK."""
    places = [motion.joint_names.index(name) for name in motion.sdk_motor_order]
    position = motion.array("root_position")
    time = np.arange(len(position))[:, None] / motion.rate
    values = np.concatenate(
        [time, position, motion.orientation_xyzw, motion.array("joint_position")[:, places]], axis=1
    )
    names = ("time", "x", "y", "z", "qx", "qy", "qz", "qw", *motion.sdk_motor_order)
    np.savetxt(path, values, fmt="%.9g", delimiter=",", header=",".join(names), comments="")


def body_fields(motion: Motion) -> list[Field]:
    """Return the arrays that a motion for a tracker is made of."""
    return [stored(motion, name) for name in BODY_ARRAYS]


def tracker(
    title: str, suffix: str, write: Callable[[BodyMotion, Path], None], loading: str, content: str
) -> "MotionTarget":
    """Return the description of a format with a file a motion.

    Args:
        title: What it is called.
        suffix: Of its files.
        write: Writes one.
        loading: Python lines that load it.
        content: What stands in a file, for the card.
    """

    def write_motion(output: Output, name: str, trajectories: Iterator[Trajectory]) -> None:
        for one in trajectories:
            check_finite(output, one)
            path = output.folder / name / f"trajectory-{one.index:04d}{suffix}"
            path.parent.mkdir(exist_ok=True)
            write(as_motion(output, one), path)

    rule = (
        f"A row is a control step; a file is a rollout of several cycles, which does not end where it began. {content}"
    )
    target = Target(title=title, write=write_motion, fields=body_fields, loading=loading, time_rule=rule)
    return MotionTarget(target, suffix, write)


@dataclass(frozen=True)
class MotionTarget:
    """A format with a file a motion, for trajectories and for clips."""

    target: Target
    suffix: str
    write: Callable[[BodyMotion, Path], None]


def as_motion(output: Output, one: Trajectory) -> BodyMotion:
    """Return a trajectory as a motion."""
    attributes = output.dataset.attributes
    names = (tuple(attributes[name]) for name in ("joint_names", "link_names", "sdk_motor_order"))
    return BodyMotion(output.dataset.rate, False, one.arrays, *names)


_FILE = "{motion}/trajectory-0000"
READ_PICKLE = f"""\
from pathlib import Path
from kine2go_warp.motions.sources.joint_files import read_pickle

frames = read_pickle(Path("{_FILE}.pkl")).values  # rows x columns; no code in the file is run
"""
"""A pickle can run any code when it is opened; this reader refuses all but numbers, texts, lists and arrays."""

MOTION_TARGETS = {
    "mjlab": tracker(
        "motions for mjlab and BeyondMimic, an .npz a trajectory", ".npz", write_mjlab,
        f'import numpy as np\n\nmotion = np.load("{_FILE}.npz")\nplaces = motion["body_pos_w"]  # rows, 13, 3\n',
        "`joint_pos`, `joint_vel`, and of 13 bodies `body_pos_w`, `body_quat_w` (w, x, y, z), `body_lin_vel_w`, "
        "`body_ang_vel_w`, all in the world frame. `joint_names` and `body_names` give the order, that of MuJoCo: leg "
        "by leg. A simulator with another order must be given the arrays in its own.",
    ),
    "mimickit": tracker(
        "motions for MimicKit, a pickle a trajectory", ".pkl", write_mimickit,
        READ_PICKLE,
        "`frames` has base position, rotation vector and joints, legs FL, FR, RL, RR; the pickle holds lists and "
        "numbers alone.",
    ),
    "amp": tracker(
        "motions for AMP, 61 columns of JSON a trajectory", ".txt", write_amp,
        f'import json\n\nwith open("{_FILE}.txt") as file:\n    frames = json.load(file)["Frames"]  # rows x 61\n',
        "Columns: base position 0:3, orientation (x, y, z, w) 3:7, joints 7:19, feet from the base 19:31, linear and "
        "angular velocity of the base 31:37, joint velocities 37:49, velocities of the feet 49:61. Feet and velocities "
        "are in the frame of the base. Legs are FR, FL, RR, RL.",
    ),
    "humanoidverse": tracker(
        "motions for HumanoidVerse, PHC and ASAP, a pickle a trajectory", ".pkl", write_humanoidverse,
        READ_PICKLE,
        "`root_trans_offset`, `root_rot` (x, y, z, w), `dof`, `pose_aa` (rotation vectors of base and joints), `fps`.",
    ),
    "protomotions": tracker(
        "motions for ProtoMotions, a .motion a trajectory", ".motion", write_protomotions,
        f'import torch\n\nmotion = torch.load("{_FILE}.motion", weights_only=True)\n',
        "Joints, and 13 bodies in MuJoCo's order, leg by leg, in the world frame; quaternions (x, y, z, w).",
    ),
    "unitree": tracker(
        "motions in the order of Unitree's SDK, a CSV a trajectory", ".csv", write_unitree,
        f'import numpy as np\n\ntable = np.genfromtxt("{_FILE}.csv", delimiter=",", names=True)\n',
        "Columns have names: time [s], base position, orientation (x, y, z, w), joints in the order of the SDK.",
    ),
}  # fmt: skip
"""The formats for trackers."""

MJLAB = MOTION_TARGETS["mjlab"].target
MIMICKIT = MOTION_TARGETS["mimickit"].target
AMP = MOTION_TARGETS["amp"].target
HUMANOIDVERSE = MOTION_TARGETS["humanoidverse"].target
PROTOMOTIONS = MOTION_TARGETS["protomotions"].target
UNITREE = MOTION_TARGETS["unitree"].target
