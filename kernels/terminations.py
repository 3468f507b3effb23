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

REASON_NAMES = ("none", "distance", "rotation", "body_contact", "non_finite", "time_out")
"""Names of the reasons, indexed by the numbers above."""


@wp.kernel
def terminate(
    robot: RobotState,
    reference: ReferenceState,
    body_contact: wp.array(dtype=int),
    episode_length: wp.array(dtype=wp.int64),
    max_episode_length: wp.int64,
    max_distance: float,
    max_angle: float,
    reason: wp.array(dtype=int),
    done: wp.array(dtype=wp.int64),
    time_out: wp.array(dtype=wp.bool),
):
    """Write why each world's episode ends, 0 if it goes on. Launched over [num_worlds].

    A failure is reported before a time-out, since only a time-out may be bootstrapped from the value function.
    """
    world = wp.tid()
    why = int(REASON_NONE)
    if not is_finite(robot, world):
        why = REASON_NON_FINITE
    else:
        root = reference.root[world]
        distance = wp.length(root_position(robot, world) - wp.transform_get_translation(root))
        angle = rotation_angle(root_orientation(robot, world), wp.transform_get_rotation(root))
        if body_contact[world] > 0:
            why = REASON_BODY_CONTACT
        elif distance > max_distance:
            why = REASON_DISTANCE
        elif angle > max_angle:
            why = REASON_ROTATION
        elif episode_length[world] >= max_episode_length:
            why = REASON_TIME_OUT
    reason[world] = why
    time_out[world] = why == REASON_TIME_OUT
    if why != REASON_NONE:
        done[world] = wp.int64(1)
    else:
        done[world] = wp.int64(0)
