"""What a dataset stores of a state and of its reference, in the dataset's own frames and orders."""

import warp as wp

from kine2go_warp.kernels.kinematics import LegGeometry, foot_position_b
from kine2go_warp.kernels.reference import Placement, ReferenceClips, ReferenceState, turns_at, whole_cycles
from kine2go_warp.kernels.rotations import wxyz
from kine2go_warp.kernels.state import (
    NUM_LEGS,
    RobotState,
    root_angular_velocity_w,
    root_linear_velocity_w,
    root_orientation,
    root_position,
)

wp.set_module_options({"enable_backward": False})


@wp.kernel
def record_root(
    robot: RobotState,
    position: wp.array(dtype=wp.vec3),
    orientation: wp.array(dtype=wp.vec4),
    linear_velocity: wp.array(dtype=wp.vec3),
    angular_velocity: wp.array(dtype=wp.vec3),
):
    """Write the base link origin [m], orientation (w, x, y, z) and velocities [m/s, rad/s], all in the world frame."""
    world = wp.tid()
    position[world] = root_position(robot, world)
    orientation[world] = wxyz(root_orientation(robot, world))
    linear_velocity[world] = root_linear_velocity_w(robot, world)
    angular_velocity[world] = root_angular_velocity_w(robot, world)


@wp.kernel
def record_reference(
    clips: ReferenceClips,
    placement: Placement,
    reference_step: wp.array(dtype=int),
    reference: ReferenceState,
    geometry: LegGeometry,
    root_position_w: wp.array(dtype=wp.vec3),
    root_orientation_w: wp.array(dtype=wp.vec4),
    foot_position_w: wp.array2d(dtype=wp.vec3),
    phase: wp.array(dtype=float),
    cycle: wp.array(dtype=int),
):
    """Write the reference root [m, -], its feet [m] and the place in the clip: phase and whole cycles."""
    world = wp.tid()
    root = reference.root[world]
    root_position_w[world] = wp.transform_get_translation(root)
    root_orientation_w[world] = wxyz(wp.transform_get_rotation(root))
    for leg in range(NUM_LEGS):
        first = 3 * leg
        foot_b = foot_position_b(
            geometry,
            leg,
            reference.joint_position[world, first],
            reference.joint_position[world, first + 1],
            reference.joint_position[world, first + 2],
        )
        foot_position_w[world, leg] = wp.transform_point(root, foot_b)
    turns = turns_at(clips, placement, world, float(reference_step[world]))
    cycles = whole_cycles(clips, placement.clip[world], turns)
    phase[world] = turns - cycles
    cycle[world] = int(cycles)
