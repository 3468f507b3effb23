"""Least distance between the legs, and from the legs to trunk and head, whatever the solver lets collide."""

import warp as wp

from kine2go_warp.kernels.kinematics import LegGeometry, leg_point_b
from kine2go_warp.kernels.state import RobotState, leg_joint_position

# Unrolled, the loops over pairs of parts are ten thousand lines of C++, which take minutes to compile for a GPU.
wp.set_module_options({"enable_backward": False, "max_unroll": 1})

SEARCH_STEPS = wp.constant(24)
"""Steps of the search along a leg for the place closest to the trunk: 0.2 m are halved to 0.02 mm."""


@wp.struct
class BodyShapes:
    """Shapes of legs, trunk and head, as in ``RobotSpec``."""

    thigh_radius: float
    calf_radius: float
    calf_top: float
    """Beginning of the calf capsule's axis below the knee [m]."""
    calf_bottom: float
    """End of the calf capsule's axis below the knee [m]."""
    trunk_half: wp.vec3
    """Half the edges of the trunk's box, centred on the base origin [m]."""
    head_centre: wp.vec3
    head_radius: float


@wp.func
def part_axis(geometry: LegGeometry, shapes: BodyShapes, leg: int, part: int, q: wp.vec3):
    """Return both ends of the axis of thigh (0), calf (1) or foot (2, a point), base frame, and the radius [m]."""
    knee = leg_point_b(geometry, leg, 2, q)
    if part == 0:
        return leg_point_b(geometry, leg, 1, q), knee, shapes.thigh_radius
    foot = leg_point_b(geometry, leg, 3, q)
    if part == 1:
        down = wp.normalize(foot - knee)
        return knee + shapes.calf_top * down, knee + shapes.calf_bottom * down, shapes.calf_radius
    return foot, foot, geometry.foot_radius


@wp.func
def segment_distance(a: wp.vec3, b: wp.vec3, c: wp.vec3, d: wp.vec3) -> float:
    """Return the distance of the segments from a to b and from c to d, either of which may be a point [m]."""
    along, other, between = b - a, d - c, a - c
    length, other_length = wp.dot(along, along), wp.dot(other, other)
    mixed, near, far = wp.dot(along, other), wp.dot(along, between), wp.dot(other, between)
    s, t = float(0.0), float(0.0)
    determinant = length * other_length - mixed * mixed
    if determinant > 1e-12:
        s = wp.clamp((mixed * far - near * other_length) / determinant, 0.0, 1.0)
    if other_length > 1e-12:
        t = wp.clamp((mixed * s + far) / other_length, 0.0, 1.0)
    if length > 1e-12:
        # The closest place on the first segment to the place found on the second.
        s = wp.clamp((mixed * t - near) / length, 0.0, 1.0)
    return wp.length(between + s * along - t * other)


@wp.func
def box_distance(point: wp.vec3, half: wp.vec3) -> float:
    """Return the distance of a point to a box about the origin, negative inside [m]."""
    over = wp.vec3(wp.abs(point[0]) - half[0], wp.abs(point[1]) - half[1], wp.abs(point[2]) - half[2])
    outside = wp.vec3(wp.max(over[0], 0.0), wp.max(over[1], 0.0), wp.max(over[2], 0.0))
    return wp.length(outside) + wp.min(wp.max(over[0], wp.max(over[1], over[2])), 0.0)


@wp.func
def segment_box_distance(a: wp.vec3, b: wp.vec3, half: wp.vec3) -> float:
    """Return the least ``box_distance`` along a segment [m]: it is convex, so that thirds can be left out in turn."""
    low, high = float(0.0), float(1.0)
    for _ in range(SEARCH_STEPS):
        first, second = low + (high - low) / 3.0, high - (high - low) / 3.0
        if box_distance(a + first * (b - a), half) < box_distance(a + second * (b - a), half):
            high = second
        else:
            low = first
    return box_distance(a + 0.5 * (low + high) * (b - a), half)


@wp.kernel
def least_leg_distance(robot: RobotState, geometry: LegGeometry, shapes: BodyShapes, distance: wp.array(dtype=float)):
    """Write the least distance between parts of two legs, or of a leg and trunk or head [m].

    It is negative where they overlap. Launched over [num_worlds].
    """
    world = wp.tid()
    least = float(1e3)
    for leg in range(4):
        q = leg_joint_position(robot, world, leg)
        for part in range(3):
            begin, end, radius = part_axis(geometry, shapes, leg, part, q)
            least = wp.min(least, segment_box_distance(begin, end, shapes.trunk_half) - radius)
            head = segment_distance(begin, end, shapes.head_centre, shapes.head_centre)
            least = wp.min(least, head - radius - shapes.head_radius)
            for other in range(leg + 1, 4):
                other_q = leg_joint_position(robot, world, other)
                for other_part in range(3):
                    first, last, other_radius = part_axis(geometry, shapes, other, other_part, other_q)
                    gap = segment_distance(begin, end, first, last) - radius - other_radius
                    least = wp.min(least, gap)
    distance[world] = least
