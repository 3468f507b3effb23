"""Ends of episodes: one kernel each, launched over [num_worlds], which writes 1 where its condition holds, else 0.

The limits are the paper's (appendix, hyperparameter table, "Termination").
"""

import warp as wp

from kine2go_warp.kernels.reference import frames_passed, is_once
from kine2go_warp.kernels.rotations import rotation_angle
from kine2go_warp.kernels.state import is_finite, root_orientation, root_position
from kine2go_warp.kernels.world import WorldView

wp.set_module_options({"enable_backward": False})


@wp.func
def annealed_limit(view: WorldView, world: int, limit: float) -> float:
    """Return a limit that falls from ``view.initial_limit_scale`` times its value to its value."""
    progress = wp.min(float(view.world_steps[world]) / float(wp.max(view.limit_anneal_steps, 1)), 1.0)
    return limit * (view.initial_limit_scale + (1.0 - view.initial_limit_scale) * progress)


@wp.kernel
def non_finite(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Find worlds of which a coordinate is not a finite number."""
    world = wp.tid()
    out[world, column] = wp.where(is_finite(view.robot, world), 0.0, 1.0)


@wp.kernel
def overflow(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Find worlds in which the solver has dropped contacts or constraints."""
    world = wp.tid()
    out[world, column] = wp.where((view.overflow[world] & view.overflow_mask) != 0, 1.0, 0.0)


@wp.kernel
def body_contact(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Find robots whose base or head touches the ground while their reference stands on its feet alone."""
    world = wp.tid()
    falls = view.body_contact[world] > 0 and view.reference.body_rests[world] == 0
    out[world, column] = wp.where(falls, 1.0, 0.0)


@wp.kernel
def distance(view: WorldView, out: wp.array2d(dtype=float), column: int, max_distance: float):
    """Find roots that are farther from their reference than an annealed limit [m]."""
    world = wp.tid()
    offset = root_position(view.robot, world) - wp.transform_get_translation(view.reference.root[world])
    out[world, column] = wp.where(wp.length(offset) > annealed_limit(view, world, max_distance), 1.0, 0.0)


@wp.kernel
def rotation(view: WorldView, out: wp.array2d(dtype=float), column: int, max_angle: float):
    """Find roots that are turned from their reference by more than an annealed limit [rad]."""
    world = wp.tid()
    reference = wp.transform_get_rotation(view.reference.root[world])
    angle = rotation_angle(root_orientation(view.robot, world), reference)
    out[world, column] = wp.where(angle > annealed_limit(view, world, max_angle), 1.0, 0.0)


@wp.kernel
def time_out(view: WorldView, out: wp.array2d(dtype=float), column: int):
    """Find episodes that have reached their longest time, or have held the end of a clip played once long enough."""
    world = wp.tid()
    is_over = view.episode_length[world] >= wp.int64(view.max_episode_length)
    clip = view.placement.clip[world]
    if is_once(view.clips, clip):
        held = float(view.reference_step[world] - view.end_hold_steps)
        passed = frames_passed(view.clips, view.placement, world, held)
        is_over = is_over or passed >= float(view.clips.span[clip])
    out[world, column] = wp.where(is_over, 1.0, 0.0)


@wp.kernel
def end_episodes(
    conditions: wp.array2d(dtype=float),
    is_time_out: wp.array(dtype=wp.bool),
    overflow: wp.array(dtype=int),
    reason: wp.array(dtype=int),
    reason_count: wp.array(dtype=int),
    done: wp.array(dtype=wp.int64),
    time_out: wp.array(dtype=wp.bool),
):
    """Write why each world's episode ends: 1 + the column of the first condition that holds, 0 if none does.

    A failure hides a time-out, since only a time-out may be bootstrapped from the value function. ``overflow`` is
    cleared; ``reason_count`` counts the ends by reason, shape [1 + number of conditions].
    """
    world = wp.tid()
    failure = int(0)
    expiry = int(0)
    for term in range(conditions.shape[1]):
        if conditions[world, term] != 0.0:
            if is_time_out[term]:
                expiry = wp.where(expiry == 0, term + 1, expiry)
            else:
                failure = wp.where(failure == 0, term + 1, failure)
    why = wp.where(failure > 0, failure, expiry)
    overflow[world] = 0
    reason[world] = why
    time_out[world] = why > 0 and failure == 0
    done[world] = wp.int64(0)
    if why > 0:
        wp.atomic_add(reason_count, why, 1)
        done[world] = wp.int64(1)
