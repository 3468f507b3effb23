"""Legs that are driven into each other, with and without contacts between them."""

from dataclasses import replace

import numpy as np

from kine2go_warp.env.config import ActionConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.terms.terminations import with_limits
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import link_positions
from tests.env.helpers import STILL

PLACES = np.linspace(0.0, 1.0, 60)[:, None]
"""Places along the axis of a thigh or calf at which distances are taken."""


def surfaces(joint_position, leg):
    """Points on the axes of a leg's thigh, calf and foot, shape [60, 3], each with the radius around them [m]."""
    points = link_positions(GO2, joint_position)
    thigh, knee, foot = points[3 * leg + 1], points[3 * leg + 2], points[12 + leg]
    down = (foot - knee) / np.linalg.norm(foot - knee)
    top, bottom = (knee + length * down for length in GO2.calf_span)
    return (
        (thigh + PLACES * (knee - thigh), GO2.thigh_radius),
        (top + PLACES * (bottom - top), GO2.calf_radius),
        (foot[None], GO2.foot_radius),
    )


def front_legs_gap(joint_position):
    """Distance of the front legs from each other, negative where they overlap, by NumPy alone [m]."""
    left, right = surfaces(joint_position, 0), surfaces(joint_position, 1)
    return min(
        np.linalg.norm(a[:, None] - b[None], axis=-1).min() - radius - other for a, radius in left for b, other in right
    )


def driven_together(clip, config, self_contact):
    """Gaps step by step, and how far the left foot is to the left of the right one in the end [m]."""
    config = replace(
        config,
        num_worlds=1,
        action=ActionConfig("absolute", latency=0.0),
        reset=STILL,
        terminations=with_limits(1e3, 10.0),
        solver=replace(config.solver, self_contact=self_contact),
    )
    environment = ImitationEnvironment([clip], config, "cpu")
    joint_q = environment.robot.joint_q.numpy()
    joint_q[:, 2], joint_q[:, 7:] = 20.0, GO2.default_joint_position
    environment.robot.joint_q.assign(joint_q)
    gaps = []
    for step in range(60):
        target = np.float32(GO2.default_joint_position)
        target[[0, 3]] = np.array([-0.45, 0.45]) * min(1.0, (step + 1) / 40)
        environment.action.assign(target[None])
        environment.step()
        joint_position = environment.robot.joint_q.numpy()[0, 7:].astype(float)
        gaps.append(front_legs_gap(joint_position))
    points = link_positions(GO2, joint_position)
    return np.array(gaps), points[12, 1] - points[13, 1]


def test_self_contact_holds_two_legs_apart_that_pass_through_each_other_without_it(standing_clip, small_config):
    through, apart_through = driven_together(standing_clip, small_config, self_contact=False)
    held, apart_held = driven_together(standing_clip, small_config, self_contact=True)
    assert through[0] > 0.05, "they begin apart"
    assert through.min() < -0.03
    assert apart_through < 0.0, "the left foot is right of the right one"
    assert held.min() > -0.005, "contacts give way by millimetres"
    assert held[-1] < 0.005, "they touch"
    assert apart_held > 0.03
