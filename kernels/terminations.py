"""When an episode ends (appendix, hyperparameter table, "Termination")."""

import warp as wp

from kine2go_warp.kernels.reference import ReferenceState
from kine2go_warp.kernels.rotations import rotation_angle
from kine2go_warp.kernels.state import RobotState, is_finite, root_orientation, root_position

wp.set_module_options({"enable_backward": False})

REASON_NONE = wp.constant(0)
REASON_DISTANCE = wp.constant(1)
REASON_ROTATION = wp.constant(2)
REASON_BODY_CONTACT = wp.constant(3)
REASON_NON_FINITE = wp.constant(4)
REASON_TIME_OUT = wp.constant(5)
REASON_OVERFLOW = wp.constant(6)

REASON_NAMES = ("none", "distance", "rotation", "body_contact", "non_finite", "time_out", "overflow")
"""Names of the reasons, indexed by the numbers above."""

REASON_DESCRIPTIONS = (
    "the episode goes on",
    "the root is too far from its reference",
    "the root is turned too far from its reference",
    "base or head touches the ground",
    "a coordinate is not a finite number",
    "the episode has reached its longest time; the only end that is bootstrapped",
    "the solver had more contacts or constraints than its buffers hold, and dropped some",
)
"""What the reasons mean, indexed likewise."""


@wp.func
def annealed_limit(limit: float, initial_limit_scale: float, world_steps: int, limit_anneal_steps: int) -> float:
    """Return a limit that falls within some steps from ``initial_limit_scale`` times its value to its value."""
    progress = wp.min(float(world_steps) / float(wp.max(limit_anneal_steps, 1)), 1.0)
    return limit * (initial_limit_scale + (1.0 - initial_limit_scale) * progress)


@wp.kernel
def terminate(
    robot: RobotState,
    reference: ReferenceState,
    body_contact: wp.array(dtype=int),
    overflow: wp.array(dtype=int),
    overflow_mask: int,
    episode_length: wp.array(dtype=wp.int64),
    max_episode_length: wp.int64,
    max_distance: float,
    max_angle: float,
    world_steps: wp.array(dtype=int),
    initial_limit_scale: float,
    limit_anneal_steps: int,
    reason: wp.array(dtype=int),
    reason_count: wp.array(dtype=int),
    done: wp.array(dtype=wp.int64),
    time_out: wp.array(dtype=wp.bool),
):
    """Write why each world's episode ends, 0 if it goes on. Launched over [num_worlds].

    A failure is reported before a time-out, since only a time-out may be bootstrapped from the value function.
    ``overflow`` is the solver's own bit mask, shape [num_worlds]; the bits of ``overflow_mask`` count, and it is
    cleared. ``world_steps`` is the number of control steps that a world has seen, shape [num_worlds]: within the first
    ``limit_anneal_steps`` the limits fall from ``initial_limit_scale`` times their values. ``reason_count`` counts the
    ends by reason, shape [number of reasons].
    """
    world = wp.tid()
    why = int(REASON_NONE)
    if not is_finite(robot, world):
        why = REASON_NON_FINITE
    elif (overflow[world] & overflow_mask) != 0:
        why = REASON_OVERFLOW
    else:
        root = reference.root[world]
        distance = wp.length(root_position(robot, world) - wp.transform_get_translation(root))
        angle = rotation_angle(root_orientation(robot, world), wp.transform_get_rotation(root))
        if body_contact[world] > 0:
            why = REASON_BODY_CONTACT
        elif distance > annealed_limit(max_distance, initial_limit_scale, world_steps[world], limit_anneal_steps):
            why = REASON_DISTANCE
        elif angle > annealed_limit(max_angle, initial_limit_scale, world_steps[world], limit_anneal_steps):
            why = REASON_ROTATION
        elif episode_length[world] >= max_episode_length:
            why = REASON_TIME_OUT
    overflow[world] = 0
    reason[world] = why
    time_out[world] = why == REASON_TIME_OUT
    if why != REASON_NONE:
        wp.atomic_add(reason_count, why, 1)
        done[world] = wp.int64(1)
    else:
        done[world] = wp.int64(0)
