"""Reference motions on the device: from a place in a clip to a pose in each world's own heading.

A place in a clip is a frame number with a fraction, ``frame = start_phase * span + step * frames_per_step``. In a cycle
it grows without bound, and every ``num_frames`` frames the clip has moved on by one cycle. A clip played once is
at rest in its first and last frame, and beyond them the place stays there: ``frame_at`` alone sees to that.
"""

import warp as wp

from kine2go_warp.kernels.rotations import rotate_planar, slerp, yaw_rotation
from kine2go_warp.kernels.state import NUM_JOINTS
from kine2go_warp.kernels.terrain import Terrain, reference_climb, reference_lift

wp.set_module_options({"enable_backward": False})


@wp.struct
class ReferenceClips:
    """Several clips packed one after another. Root velocities and positions are in the clip's own world frame."""

    root_position: wp.array(dtype=wp.vec3)
    """Base link origin [m], shape [total_frames]."""
    root_orientation: wp.array(dtype=wp.quat)
    """Base link orientation, shape [total_frames]."""
    root_linear_velocity: wp.array(dtype=wp.vec3)
    """Velocity of the base link origin [m/s], shape [total_frames]."""
    root_angular_velocity: wp.array(dtype=wp.vec3)
    """Angular velocity of the base [rad/s], shape [total_frames]."""
    joint_position: wp.array2d(dtype=float)
    """Joint positions [rad], shape [total_frames, 12]."""
    joint_velocity: wp.array2d(dtype=float)
    """Joint velocities [rad/s], shape [total_frames, 12]."""
    body_rests: wp.array(dtype=int)
    """1 where parts other than feet may touch the ground, else 0; see ``MotionClip``, shape [total_frames]."""
    first_frame: wp.array(dtype=int)
    """Where each clip begins, shape [num_clips]."""
    num_frames: wp.array(dtype=int)
    """Frames of each clip, shape [num_clips]."""
    span: wp.array(dtype=int)
    """Frames from phase 0 to phase 1: ``num_frames`` of a cycle, one less of a clip played once, shape [num_clips]."""
    frames_per_step: wp.array(dtype=float)
    """Clip frames that pass in one control step, shape [num_clips]."""
    cycle_translation: wp.array(dtype=wp.vec2)
    """Displacement of one cycle in the ground plane [m], 0 of a clip played once, shape [num_clips]."""
    cycle_yaw: wp.array(dtype=float)
    """Turn of one cycle [rad], 0 of a clip played once, shape [num_clips]."""


@wp.struct
class Placement:
    """What each world tracks and where it lies in that world. All arrays have shape [num_worlds]."""

    clip: wp.array(dtype=int)
    """Index of the clip."""
    start_phase: wp.array(dtype=float)
    """Phase of the clip where the episode began, in [0, 1); less than 0 before the beginning of a clip played once."""
    heading: wp.array(dtype=float)
    """Turn of the whole reference about the world's z axis [rad]."""
    origin: wp.array(dtype=wp.vec2)
    """Where the clip's own origin lies in the world [m]."""
    terrain: Terrain
    """The ground, the same for all worlds."""


@wp.struct
class ReferenceState:
    """The reference at one instant, in each world's own frame."""

    root: wp.array(dtype=wp.transform)
    """Base link pose, shape [num_worlds]."""
    linear_velocity: wp.array(dtype=wp.vec3)
    """Velocity of the base link origin [m/s], shape [num_worlds]."""
    angular_velocity: wp.array(dtype=wp.vec3)
    """Angular velocity of the base [rad/s], shape [num_worlds]."""
    joint_position: wp.array2d(dtype=float)
    """Joint positions [rad], shape [num_worlds, 12]."""
    joint_velocity: wp.array2d(dtype=float)
    """Joint velocities [rad/s], shape [num_worlds, 12]."""
    body_rests: wp.array(dtype=int)
    """1 where base and legs may touch the ground as the reference does, else 0, shape [num_worlds]."""


@wp.func
def is_once(clips: ReferenceClips, clip: int) -> bool:
    """Return whether a clip is played once rather than repeated."""
    return clips.span[clip] < clips.num_frames[clip]


@wp.func
def frames_passed(clips: ReferenceClips, placement: Placement, world: int, step: float) -> float:
    """Return how far beyond the clip's first frame time is ``step`` control steps into the episode [frames]."""
    clip = placement.clip[world]
    return placement.start_phase[world] * float(clips.span[clip]) + step * clips.frames_per_step[clip]


@wp.func
def frame_at(clips: ReferenceClips, placement: Placement, world: int, step: float) -> float:
    """Return the place in the clip ``step`` control steps into the episode [frames]."""
    frame = frames_passed(clips, placement, world, step)
    clip = placement.clip[world]
    if is_once(clips, clip):
        frame = wp.clamp(frame, 0.0, float(clips.span[clip]))
    return frame


@wp.func
def turns_at(clips: ReferenceClips, placement: Placement, world: int, step: float) -> float:
    """Return the cycles passed, or the phase of a clip played once, ``step`` control steps into the episode."""
    return frame_at(clips, placement, world, step) / float(clips.span[placement.clip[world]])


@wp.func
def whole_cycles(clips: ReferenceClips, clip: int, turns: float) -> float:
    """Return how often a clip has been repeated."""
    return wp.where(is_once(clips, clip), 0.0, wp.floor(turns))


@wp.func
def cycle_displacement(translation: wp.vec2, yaw: float, cycles: float) -> wp.vec2:
    """Return where ``cycles`` repetitions of the step (``translation``, ``yaw``) lead [m].

    The closed form of the sum of ``translation`` turned by 0, yaw, 2 yaw, ..., (cycles - 1) yaw.
    """
    half = 0.5 * yaw
    gain = cycles
    if wp.abs(wp.sin(half)) > 1.0e-6:
        gain = wp.sin(cycles * half) / wp.sin(half)
    return rotate_planar((cycles - 1.0) * half, translation) * gain


@wp.func
def whole_frame_pose(clips: ReferenceClips, clip: int, frame: int) -> wp.transform:
    """Return the root pose at a whole frame, in the clip's world frame, cycles included."""
    num_frames = clips.num_frames[clip]
    cycle = frame // num_frames
    index = clips.first_frame[clip] + frame - cycle * num_frames
    yaw = clips.cycle_yaw[clip]
    turn = float(cycle) * yaw
    position = clips.root_position[index]
    planar = rotate_planar(turn, wp.vec2(position[0], position[1])) + cycle_displacement(
        clips.cycle_translation[clip], yaw, float(cycle)
    )
    return wp.transform(wp.vec3(planar[0], planar[1], position[2]), yaw_rotation(turn) * clips.root_orientation[index])


@wp.func
def reference_root(clips: ReferenceClips, placement: Placement, world: int, frame: float) -> wp.transform:
    """Return the reference root pose in the world, lifted onto the ground: positions linear, rotation slerp."""
    clip = placement.clip[world]
    whole = int(wp.floor(frame))
    fraction = frame - wp.floor(frame)
    a = whole_frame_pose(clips, clip, whole)
    b = whole_frame_pose(clips, clip, whole + 1)
    position = wp.transform_get_translation(a) * (1.0 - fraction) + wp.transform_get_translation(b) * fraction
    rotation = slerp(wp.transform_get_rotation(a), wp.transform_get_rotation(b), fraction)
    heading = placement.heading[world]
    planar = rotate_planar(heading, wp.vec2(position[0], position[1])) + placement.origin[world]
    height = position[2] + reference_lift(placement.terrain, planar)
    return wp.transform(wp.vec3(planar[0], planar[1], height), yaw_rotation(heading) * rotation)


@wp.func
def frame_index(clips: ReferenceClips, clip: int, frame: int) -> int:
    """Return where a whole frame of a clip lies in the packed arrays."""
    num_frames = clips.num_frames[clip]
    return clips.first_frame[clip] + frame - (frame // num_frames) * num_frames


@wp.func
def interpolate_turned(
    clips: ReferenceClips, values: wp.array(dtype=wp.vec3), placement: Placement, world: int, frame: float
) -> wp.vec3:
    """Interpolate a vector field of a clip and turn it by cycle and heading into the world frame."""
    clip = placement.clip[world]
    num_frames = clips.num_frames[clip]
    whole = int(wp.floor(frame))
    fraction = frame - wp.floor(frame)
    yaw = clips.cycle_yaw[clip]
    heading = placement.heading[world]
    a = wp.quat_rotate(
        yaw_rotation(heading + float(whole // num_frames) * yaw), values[frame_index(clips, clip, whole)]
    )
    b = wp.quat_rotate(
        yaw_rotation(heading + float((whole + 1) // num_frames) * yaw), values[frame_index(clips, clip, whole + 1)]
    )
    return a * (1.0 - fraction) + b * fraction


@wp.func
def reference_velocity(
    clips: ReferenceClips, placement: Placement, world: int, frame: float, position: wp.vec3
) -> wp.vec3:
    """Return the velocity of the reference root in the world [m/s], the climb over the ground included."""
    velocity = interpolate_turned(clips, clips.root_linear_velocity, placement, world, frame)
    place = wp.vec2(position[0], position[1])
    climb = reference_climb(placement.terrain, place, wp.vec2(velocity[0], velocity[1]))
    return wp.vec3(velocity[0], velocity[1], velocity[2] + climb)


@wp.func
def interpolate_joint(
    clips: ReferenceClips, values: wp.array2d(dtype=float), clip: int, frame: float, joint: int
) -> float:
    """Interpolate a joint quantity of a clip."""
    whole = int(wp.floor(frame))
    fraction = frame - wp.floor(frame)
    a = values[frame_index(clips, clip, whole), joint]
    b = values[frame_index(clips, clip, whole + 1), joint]
    return a * (1.0 - fraction) + b * fraction


@wp.kernel
def sample_reference(
    clips: ReferenceClips,
    placement: Placement,
    reference_step: wp.array(dtype=int),
    reference: ReferenceState,
):
    """Write the reference state at the present step of each world. Launched over [num_worlds]."""
    world = wp.tid()
    clip = placement.clip[world]
    frame = frame_at(clips, placement, world, float(reference_step[world]))
    root = reference_root(clips, placement, world, frame)
    position = wp.transform_get_translation(root)
    reference.root[world] = root
    reference.linear_velocity[world] = reference_velocity(clips, placement, world, frame, position)
    reference.angular_velocity[world] = interpolate_turned(clips, clips.root_angular_velocity, placement, world, frame)
    reference.body_rests[world] = clips.body_rests[frame_index(clips, clip, int(wp.floor(frame)))]
    for joint in range(NUM_JOINTS):
        reference.joint_position[world, joint] = interpolate_joint(clips, clips.joint_position, clip, frame, joint)
        reference.joint_velocity[world, joint] = interpolate_joint(clips, clips.joint_velocity, clip, frame, joint)
