"""The kernels' mathematics once more: NumPy and SciPy in double precision, written from the paper's equations."""

from dataclasses import dataclass

import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation, Slerp

from kine2go_warp.env.clips import make_reference_state
from kine2go_warp.kernels.reference import ReferenceState
from kine2go_warp.kernels.state import RobotState
from kine2go_warp.kernels.world import WorldView
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions

Array = np.ndarray


@dataclass
class States:
    """Robot or reference states of several worlds, quaternions (x, y, z, w)."""

    position: Array
    quaternion: Array
    linear: Array
    angular: Array
    joint: Array
    joint_speed: Array

    @property
    def rotation(self) -> Rotation:
        return Rotation.from_quat(self.quaternion)

    @property
    def yaw(self) -> Array:
        forward = self.rotation.apply([1.0, 0.0, 0.0])
        return np.arctan2(forward[:, 1], forward[:, 0])

    def feet_in_heading_frame(self) -> Array:
        feet = foot_positions(GO2, self.joint)
        upright = Rotation.from_euler("z", -self.yaw[:, None]) * self.rotation
        return np.stack([upright.apply(feet[:, leg]) for leg in range(4)], axis=1)


def random_states(rng: np.random.Generator, num_worlds: int) -> States:
    """States in the single-precision numbers that the kernels will see."""
    states = States(
        position=rng.normal(0.0, 2.0, (num_worlds, 3)),
        quaternion=Rotation.random(num_worlds, rng=rng).as_quat(),
        linear=rng.normal(0.0, 1.0, (num_worlds, 3)),
        angular=rng.normal(0.0, 2.0, (num_worlds, 3)),
        joint=rng.uniform(GO2.joint_lower, GO2.joint_upper, (num_worlds, 12)),
        joint_speed=rng.normal(0.0, 5.0, (num_worlds, 12)),
    )
    return States(*(np.float64(np.float32(value)) for value in vars(states).values()))


def near(rng: np.random.Generator, states: States, scale: float) -> States:
    """States a little off, so that rewards are neither 0 nor 1."""
    turn = Rotation.from_rotvec(rng.normal(0.0, scale, (len(states.position), 3)))
    moved = States(
        position=states.position + rng.normal(0.0, scale, states.position.shape),
        quaternion=(turn * states.rotation).as_quat(),
        linear=states.linear + rng.normal(0.0, 3.0 * scale, states.linear.shape),
        angular=states.angular + rng.normal(0.0, 5.0 * scale, states.angular.shape),
        joint=states.joint + rng.normal(0.0, scale, states.joint.shape),
        joint_speed=states.joint_speed + rng.normal(0.0, 5.0 * scale, states.joint_speed.shape),
    )
    return States(*(np.float64(np.float32(value)) for value in vars(moved).values()))


def upload_robot(states: States, com_b: Array) -> RobotState:
    """Newton's coordinates: the linear velocity is that of the centre of mass."""
    com_velocity = states.linear + np.cross(states.angular, states.rotation.apply(com_b))
    robot = RobotState()
    joint_q = np.hstack([states.position, states.quaternion, states.joint])
    joint_qd = np.hstack([com_velocity, states.angular, states.joint_speed])
    robot.joint_q = wp.array(joint_q.astype(np.float32), dtype=float)
    robot.joint_qd = wp.array(joint_qd.astype(np.float32), dtype=float)
    robot.com_b = wp.array(np.tile(com_b, (len(states.position), 1)).astype(np.float32), dtype=wp.vec3)
    return robot


def upload_reference(states: States) -> ReferenceState:
    reference = make_reference_state(len(states.position), wp.get_device())
    reference.root.assign(np.hstack([states.position, states.quaternion]).astype(np.float32))
    reference.linear_velocity.assign(states.linear.astype(np.float32))
    reference.angular_velocity.assign(states.angular.astype(np.float32))
    reference.joint_position.assign(states.joint.astype(np.float32))
    reference.joint_velocity.assign(states.joint_speed.astype(np.float32))
    return reference


def world_view(**parts) -> WorldView:
    """What terms read, of which some parts are there."""
    view = WorldView()
    for name, value in parts.items():
        setattr(view, name, value)
    return view


def paper_rewards(robot: States, reference: States) -> Array:
    """The five terms of the paper's appendix without their weights, shape [num_worlds, 5]."""
    angle = (robot.rotation * reference.rotation.inv()).magnitude()

    def square(a: Array, b: Array) -> Array:
        return np.sum((a - b) ** 2, axis=tuple(range(1, a.ndim)))

    return np.stack(
        [
            np.exp(-5.0 * square(robot.joint, reference.joint)),
            np.exp(-0.1 * square(robot.joint_speed, reference.joint_speed)),
            np.exp(-40.0 * square(robot.feet_in_heading_frame(), reference.feet_in_heading_frame())),
            np.exp(-20.0 * square(robot.position, reference.position)) + np.exp(-10.0 * angle**2),
            np.exp(-2.0 * square(robot.linear, reference.linear))
            + np.exp(-0.2 * square(robot.angular, reference.angular)),
        ],
        axis=1,
    )


def planar(position: Array, quaternion: Rotation, x: float, y: float, yaw: float) -> tuple[Array, Rotation]:
    """Move a pose on by a step in the plane."""
    turn = Rotation.from_rotvec([0.0, 0.0, yaw])
    return turn.apply(position) + np.array([x, y, 0.0]), turn * quaternion


def whole_frame(clip: MotionClip, frame: int) -> tuple[Array, Rotation, Rotation]:
    """Root pose at a whole frame by repeating the cycle step by step, and the turn of all cycles passed."""
    cycle, index = divmod(frame, clip.num_frames)
    position = clip.root_position[index]
    rotation = Rotation.from_quat(clip.root_orientation[index][[1, 2, 3, 0]])
    for _ in range(cycle):
        position, rotation = planar(position, rotation, clip.cycle.x, clip.cycle.y, clip.cycle.yaw)
    return position, rotation, Rotation.from_rotvec([0.0, 0.0, cycle * clip.cycle.yaw])


def reference_at(clip: MotionClip, frame: float, heading: float, origin: Array) -> States:
    """The reference at a place in the clip, in one world's own heading."""
    if clip.cycle is None:
        return once_at(clip, frame, heading, origin)
    whole, share = int(np.floor(frame)), frame - np.floor(frame)
    (position_a, rotation_a, turn_a), (position_b, rotation_b, turn_b) = (
        whole_frame(clip, whole),
        whole_frame(clip, whole + 1),
    )
    a, b = whole % clip.num_frames, (whole + 1) % clip.num_frames
    position = (1.0 - share) * position_a + share * position_b
    rotation = rotation_a * Rotation.from_rotvec(share * (rotation_a.inv() * rotation_b).as_rotvec())
    position, rotation = planar(position, rotation, origin[0], origin[1], heading)
    turn = Rotation.from_rotvec([0.0, 0.0, heading])

    def mixed(values: Array) -> Array:
        return (1.0 - share) * values[a] + share * values[b]

    def turned(values: Array) -> Array:
        return turn.apply((1.0 - share) * turn_a.apply(values[a]) + share * turn_b.apply(values[b]))

    return States(
        position=position[None],
        quaternion=rotation.as_quat()[None],
        linear=turned(clip.root_linear_velocity)[None],
        angular=turned(clip.root_angular_velocity)[None],
        joint=mixed(clip.joint_position)[None],
        joint_speed=mixed(clip.joint_velocity)[None],
    )


def once_at(clip: MotionClip, frame: float, heading: float, origin: Array) -> States:
    """The same of a clip that is played once: the first and the last pose at rest beyond its ends."""
    frames = np.arange(clip.num_frames)

    def mixed(values: Array) -> Array:
        return np.array([np.interp(frame, frames, column) for column in values.T])

    rotations = Rotation.from_quat(clip.root_orientation[:, [1, 2, 3, 0]])
    turn = Rotation.from_rotvec([0.0, 0.0, heading])
    is_beyond = not 0.0 <= frame <= frames[-1]
    speed = 0.0 if is_beyond else 1.0
    return States(
        position=np.add(turn.apply(mixed(clip.root_position)), [*origin, 0.0])[None],
        quaternion=(turn * Slerp(frames, rotations)(np.clip(frame, 0.0, frames[-1]))).as_quat()[None],
        linear=turn.apply(speed * mixed(clip.root_linear_velocity))[None],
        angular=turn.apply(speed * mixed(clip.root_angular_velocity))[None],
        joint=mixed(clip.joint_position)[None],
        joint_speed=speed * mixed(clip.joint_velocity)[None],
    )


def stacked(states: list[States]) -> States:
    return States(*(np.concatenate([vars(one)[name] for one in states]) for name in vars(states[0])))
