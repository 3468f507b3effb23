"""Motion files of other people's formats, generated: a robot that trots and a dog that walks."""

import json
import pickle

import numpy as np
from scipy.spatial.transform import Rotation

from kine2go_warp.motions.generator import DogGait, generate
from kine2go_warp.motions.keypoints import KEYPOINTS
from kine2go_warp.motions.sources.ai4animation import COLUMN_OF_KEYPOINT
from kine2go_warp.motions.sources.dialects import robot_of_files
from kine2go_warp.robots.kinematics import foot_positions

RATE = 50.0
LEGS = ("FL", "FR", "RL", "RR")


def dog(num_frames=121):
    """The generated dog's keypoints in metres, z up, shape [num_frames, 10, 3]."""
    points = generate(DogGait(), num_frames).points
    return points[:, [COLUMN_OF_KEYPOINT[name] for name in KEYPOINTS]]


def robot(robot_name="go2", num_frames=60):
    """Base positions, orientations (x, y, z, w), joints [num_frames, 4, 3] and feet in the base frame of a trot."""
    phase = 2.0 * np.pi * np.arange(num_frames) / 25.0
    beat = np.array([0.0, np.pi, np.pi, 0.0])
    swing = np.sin(phase[:, None] + beat)
    joints = np.stack([0.05 * swing, 0.8 + 0.2 * swing, -1.5 - 0.3 * np.maximum(swing, 0.0)], axis=-1)
    feet = foot_positions(robot_of_files(robot_name), joints.reshape(-1, 12))
    height = 0.022 - feet[..., 2].min(axis=1)
    position = np.stack([0.01 * np.arange(num_frames), np.zeros(num_frames), height], axis=-1)
    half_yaw = 0.01 * np.sin(phase)
    orientation = np.stack([0.0 * phase, 0.0 * phase, np.sin(half_yaw), np.cos(half_yaw)], axis=-1)
    return position, orientation, joints, feet


def in_order(values, order):
    """Return an array of legs in another order of theirs, flattened to columns."""
    return values[:, [LEGS.index(leg) for leg in order]].reshape(len(values), -1)


def write_frames(path, rows, **more):
    """Write JSON with rows of numbers."""
    path.write_text(json.dumps({"FrameDuration": 1.0 / RATE, "Frames": rows.tolist(), **more}))
    return path


def write_amp(path, robot_name="go2", order=LEGS, shift=0.0):
    """Write 61 columns; the feet may be shifted against the joints, as where the origin is another one."""
    position, orientation, joints, feet = robot(robot_name)
    rest = np.zeros((len(position), 30))
    columns = [position, orientation, in_order(joints, order), in_order(feet + shift, order), rest]
    return write_frames(path, np.concatenate(columns, axis=1))


def write_pickle(path, content=None):
    """Write MimicKit's pickle."""
    position, orientation, joints, _ = robot()
    turns = Rotation.from_quat(orientation).as_rotvec()
    rows = np.concatenate([position, turns, joints.reshape(-1, 12)], axis=1)
    path.write_bytes(pickle.dumps(content or {"loop_mode": 1, "fps": RATE, "frames": rows.tolist()}))
    return path


def write_bvh(path, points, parents, rate=60.0, unit=0.01):
    """Write a skeleton whose joints are moved by channels of position alone, in axes with y up.

    Args:
        path: The file.
        points: Positions by name [m], z up, each of shape [num_frames, 3]; parents come first.
        parents: Name of the parent of each but the first.
        rate: Frames per second [Hz].
        unit: Of the file [m].
    """
    y_up = {name: np.stack([p[:, 0], p[:, 2], -p[:, 1]], axis=-1) / unit for name, p in points.items()}
    root = next(iter(points))
    lines, columns = ["HIERARCHY"], []

    def add(name, depth):
        here = y_up[name] - (y_up[parents[name]] if name != root else 0.0)
        kind = "ROOT" if name == root else "JOINT"
        lines.extend([f"{kind} {name}", "{", "OFFSET 1 2 3", "CHANNELS 3 Xposition Yposition Zposition"])
        columns.append(here)
        for child in (one for one in points if one != root and parents[one] == name):
            add(child, depth + 1)
        lines.append("}")

    add(root, 0)
    rows = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(rows)}", f"Frame Time: {1.0 / rate:.8f}"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


AI4ANIMATION = (
    *("Hips", "Spine", "Spine1", "Neck", "Head", "HeadEnd"),
    *("LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand", "LeftHandSite"),
    *("RightShoulder", "RightArm", "RightForeArm", "RightHand", "RightHandSite"),
    *("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftFootSite"),
    *("RightUpLeg", "RightLeg", "RightFoot", "RightFootSite"),
    *("Tail", "Tail1", "TailEnd"),
)
"""The 27 points of AI4Animation's dog."""
BEFORE = (0, 1, 2, 3, 4, 2, 6, 7, 8, 9, 2, 11, 12, 13, 14, 0, 16, 17, 18, 0, 20, 21, 22, 0, 24, 25)
AI4ANIMATION_PARENTS = {name: AI4ANIMATION[parent] for name, parent in zip(AI4ANIMATION[1:], BEFORE, strict=True)}


def ai4animation_points(points):
    """Return the 27 points, shape [num_frames, 27, 3], by name."""
    return {name: points[:, index] for index, name in enumerate(AI4ANIMATION)}
