"""The start of an episode: reference-state initialisation at a random phase and heading."""

import warp as wp

from kine2go_warp.kernels.kinematics import LegGeometry, foot_position_b
from kine2go_warp.kernels.phase_sampling import PhaseTable, find_bin
from kine2go_warp.kernels.reference import (
    Placement,
    ReferenceClips,
    frame_at,
    interpolate_joint,
    interpolate_turned,
    reference_root,
    reference_velocity,
)
from kine2go_warp.kernels.rotations import heading_of, yaw_rotation
from kine2go_warp.kernels.state import (
    FIRST_JOINT_Q,
    FIRST_JOINT_QD,
    NUM_JOINTS,
    NUM_LEGS,
    RobotState,
    com_velocity_w,
    leg_joint_position,
)
from kine2go_warp.kernels.terrain import Terrain, ground_height
from kine2go_warp.kernels.world import WorldView

FOOT_CLEARANCE = wp.constant(1e-5)
"""Height of the lowest foot above the ground [m]: exactly on it, rounding would decide whether it touches at once."""


@wp.func
def random_stream(seed: wp.uint32, episode: int, stream: int) -> wp.uint32:
    """Return a generator of its own for each world, episode and purpose (0 to 15)."""
    return wp.rand_init(int(seed), 16 * episode + stream)


@wp.func
def random_vector(seed: wp.uint32, episode: int, stream: int, half_width: float) -> wp.vec3:
    """Return a vector with independent uniform components in [-half_width, half_width)."""
    rng = random_stream(seed, episode, stream)
    return wp.vec3(
        wp.randf(rng, -half_width, half_width),
        wp.randf(rng, -half_width, half_width),
        wp.randf(rng, -half_width, half_width),
    )


@wp.func
def starts_on_reference(seed: wp.uint32, episode: int, probability: float) -> bool:
    """Return whether an episode begins on the reference rather than standing."""
    rng = random_stream(seed, episode, 5)
    return wp.randf(rng) < probability


@wp.func
def place_reference(
    clips: ReferenceClips,
    placement: Placement,
    world: int,
    clip: int,
    phase: float,
    heading: float,
    place: wp.vec2,
) -> float:
    """Choose clip, start phase and heading of a world, put the reference root above a place on the ground [m].

    Returns:
        The place in the clip [frames].
    """
    placement.clip[world] = clip
    placement.start_phase[world] = phase
    placement.heading[world] = heading
    placement.origin[world] = wp.vec2(0.0, 0.0)
    frame = frame_at(clips, placement, world, 0.0)
    position = wp.transform_get_translation(reference_root(clips, placement, world, frame))
    placement.origin[world] = place - wp.vec2(position[0], position[1])
    return frame


@wp.func
def least_root_height(
    geometry: LegGeometry, terrain: Terrain, robot: RobotState, place: wp.vec2, rotation: wp.quat, world: int
) -> float:
    """Return the height at which the root, above ``place``, has its lowest foot as good as on the ground [m]."""
    least = ground_height(terrain, place)
    for leg in range(NUM_LEGS):
        q = leg_joint_position(robot, world, leg)
        foot_w = wp.quat_rotate(rotation, foot_position_b(geometry, leg, q[0], q[1], q[2]))
        ground = ground_height(terrain, place + wp.vec2(foot_w[0], foot_w[1]))
        least = wp.max(least, ground + geometry.foot_radius + FOOT_CLEARANCE - foot_w[2])
    return least


@wp.kernel
def draw_episodes(
    done: wp.array(dtype=wp.int64),
    seed: wp.array(dtype=wp.uint32),
    episode: wp.array(dtype=int),
    clips: ReferenceClips,
    placement: Placement,
    phase_table: PhaseTable,
    spread: float,
    reference_step: wp.array(dtype=int),
    episode_length: wp.array(dtype=wp.int64),
):
    """Draw clip, phase, heading and place for every world that is done, and restart its counters.

    ``spread`` is half the side of the square in which the episode begins [m].
    """
    world = wp.tid()
    if done[world] == wp.int64(0):
        return
    episode[world] = episode[world] + 1
    rng = random_stream(seed[world], episode[world], 0)
    phase_bin = find_bin(phase_table, wp.randf(rng))
    clip = phase_bin // phase_table.bins_per_clip
    phase = (float(phase_bin - clip * phase_table.bins_per_clip) + wp.randf(rng)) / float(phase_table.bins_per_clip)
    # Rounding may reach 1, which is the next cycle's beginning.
    phase = phase - wp.floor(phase)
    heading = wp.randf(rng, -wp.PI, wp.PI)
    x = wp.randf(rng, -spread, spread)
    y = wp.randf(rng, -spread, spread)
    place_reference(clips, placement, world, clip, phase, heading, wp.vec2(x, y))
    reference_step[world] = 0
    episode_length[world] = wp.int64(0)


@wp.kernel
def choose_episodes(
    done: wp.array(dtype=wp.int64),
    clips: ReferenceClips,
    placement: Placement,
    clip: wp.array(dtype=int),
    phase: wp.array(dtype=float),
    heading: wp.array(dtype=float),
):
    """Give episodes of worlds that are done another clip, phase and heading [rad], at the same place on the ground."""
    world = wp.tid()
    if done[world] == wp.int64(0):
        return
    frame = frame_at(clips, placement, world, 0.0)
    position = wp.transform_get_translation(reference_root(clips, placement, world, frame))
    place = wp.vec2(position[0], position[1])
    place_reference(clips, placement, world, clip[world], phase[world], heading[world], place)


@wp.kernel
def reset_joints(
    view: WorldView,
    reference_probability: float,
    position_width: float,
    velocity_width: float,
    scale: wp.array(dtype=float),
    joint_lower: wp.array(dtype=float),
    joint_upper: wp.array(dtype=float),
    queue: wp.array3d(dtype=float),
):
    """Put the joints of every world that is done on its reference or in the default pose, perturbed within limits.

    Widths are half those of uniform perturbations [rad, rad/s], times each world's ``scale``, shape [num_worlds];
    ``reference_probability`` is the share on the reference.
    The target queue is filled with the initial joint positions, so that the motors hold the pose until the first
    action takes effect.
    """
    world = wp.tid()
    if view.done[world] == wp.int64(0):
        return
    seed, episode = view.seed[world], view.episode[world]
    rng = random_stream(seed, episode, 1)
    clip = view.placement.clip[world]
    frame = frame_at(view.clips, view.placement, world, 0.0)
    on_reference = starts_on_reference(seed, episode, reference_probability)
    for joint in range(NUM_JOINTS):
        position = view.default_position[joint]
        velocity = float(0.0)
        if on_reference:
            position = interpolate_joint(view.clips, view.clips.joint_position, clip, frame, joint)
            velocity = interpolate_joint(view.clips, view.clips.joint_velocity, clip, frame, joint)
        position += scale[world] * wp.randf(rng, -position_width, position_width)
        position = wp.clamp(position, joint_lower[joint], joint_upper[joint])
        view.robot.joint_q[world, FIRST_JOINT_Q + joint] = position
        velocity += scale[world] * wp.randf(rng, -velocity_width, velocity_width)
        view.robot.joint_qd[world, FIRST_JOINT_QD + joint] = velocity
        view.torque[world, joint] = 0.0
        for slot in range(queue.shape[1]):
            queue[world, slot, joint] = position


@wp.kernel
def reset_root(
    view: WorldView,
    reference_probability: float,
    tilt_width: float,
    linear_width: float,
    angular_width: float,
    scale: wp.array(dtype=float),
    warm_start: wp.array2d(dtype=float),
):
    """Put the root of every world that is done on its reference, or level above its place, no foot below the floor.

    Launched after ``reset_joints``. Widths are half those of uniform perturbations [rad, m/s, rad/s], times each
    world's ``scale``, shape [num_worlds]. The solver's warm start is cleared: a value that is not finite would poison
    the new episode.
    """
    world = wp.tid()
    if view.done[world] == wp.int64(0):
        return
    seed, episode = view.seed[world], view.episode[world]
    frame = frame_at(view.clips, view.placement, world, 0.0)
    on_reference = starts_on_reference(seed, episode, reference_probability)
    root = reference_root(view.clips, view.placement, world, frame)
    upright = wp.transform_get_rotation(root)
    position = wp.transform_get_translation(root)
    linear = reference_velocity(view.clips, view.placement, world, frame, position)
    angular = interpolate_turned(view.clips, view.clips.root_angular_velocity, view.placement, world, frame)
    if not on_reference:
        upright = yaw_rotation(heading_of(upright))
        position = wp.vec3(position[0], position[1], -1.0e3)
        linear = wp.vec3(0.0, 0.0, 0.0)
        angular = wp.vec3(0.0, 0.0, 0.0)
    tilt = scale[world] * random_vector(seed, episode, 2, tilt_width)
    rotation = wp.normalize(upright * wp.quat_rpy(tilt[0], tilt[1], 0.0))
    view.robot.joint_q[world, 0] = position[0]
    view.robot.joint_q[world, 1] = position[1]
    place = wp.vec2(position[0], position[1])
    least_height = least_root_height(view.geometry, view.placement.terrain, view.robot, place, rotation, world)
    view.robot.joint_q[world, 2] = wp.max(position[2], least_height)
    for axis in range(4):
        view.robot.joint_q[world, 3 + axis] = rotation[axis]

    linear += scale[world] * random_vector(seed, episode, 3, linear_width)
    angular += scale[world] * random_vector(seed, episode, 4, angular_width)
    linear = com_velocity_w(linear, angular, rotation, view.robot.com_b[world])
    for axis in range(3):
        view.robot.joint_qd[world, axis] = linear[axis]
        view.robot.joint_qd[world, 3 + axis] = angular[axis]
    for foot in range(NUM_LEGS):
        view.foot_force[world, foot] = wp.vec3(0.0, 0.0, 0.0)
    for index in range(warm_start.shape[1]):
        warm_start[world, index] = 0.0


@wp.kernel
def advance_counters(reference_step: wp.array(dtype=int), episode_length: wp.array(dtype=wp.int64)):
    """Count one control step. Launched over [num_worlds]."""
    world = wp.tid()
    reference_step[world] = reference_step[world] + 1
    episode_length[world] = episode_length[world] + wp.int64(1)


@wp.kernel
def count_world_steps(world_steps: wp.array(dtype=int)):
    """Count one control step of each world over all its episodes. Launched over [num_worlds]."""
    world = wp.tid()
    world_steps[world] = world_steps[world] + 1
