"""Domain randomisation: what is drawn for each world besides its initial state."""

import warp as wp

from kine2go_warp.kernels.resets import random_stream
from kine2go_warp.kernels.state import RobotState
from kine2go_warp.kernels.world import BaseBody, WorldView

SCALE = wp.constant(0)
ADD = wp.constant(1)
SET = wp.constant(2)
"""What a draw does to the value before it."""


@wp.struct
class Draw:
    """A uniform distribution, and which of a world's random numbers are its own."""

    limits: wp.vec2
    """Least and greatest value."""
    operation: int
    """``SCALE``, ``ADD`` or ``SET``."""
    shared: bool
    """Whether all values of a world share one draw."""
    stream: int
    key: int
    """Sets terms of one stream apart; 0 is the stream itself."""
    first: int
    """Numbers of the stream before the first draw."""
    stride: int
    """Numbers from one draw to the next."""


@wp.kernel
def draw_parameter(view: WorldView, draw: Draw, before: wp.array2d(dtype=float), after: wp.array2d(dtype=float)):
    """Draw the values of every world that is done, shape [num_worlds, number of values]. Launched over [num_worlds]."""
    world = wp.tid()
    if view.done[world] == wp.int64(0):
        return
    rng = random_stream(view.seed[world], view.episode[world], draw.stream)
    if draw.key != 0:
        rng = wp.rand_init(int(rng), draw.key)
    for _first in range(draw.first):
        wp.randf(rng)
    drawn = float(0.0)
    for index in range(after.shape[1]):
        if index == 0 or not draw.shared:
            drawn = wp.randf(rng, draw.limits[0], draw.limits[1])
            for _next in range(draw.stride - 1):
                wp.randf(rng)
        value = before[world, index]
        if draw.operation == SCALE:
            after[world, index] = value * drawn
        elif draw.operation == ADD:
            after[world, index] = value + drawn
        else:
            after[world, index] = drawn


@wp.kernel
def round_down(view: WorldView, drawn: wp.array2d(dtype=float), greatest: int):
    """Turn drawn latencies into whole physics substeps in every world that is done. Launched over [num_worlds]."""
    world = wp.tid()
    if view.done[world] != wp.int64(0):
        view.motors.delay[world] = wp.min(int(drawn[world, 0]), greatest)


@wp.kernel
def apply_bodies(
    base: BaseBody,
    bodies_per_world: int,
    robot: RobotState,
    body_mass: wp.array(dtype=float),
    body_inverse_mass: wp.array(dtype=float),
    body_com: wp.array(dtype=wp.vec3),
    body_inertia: wp.array(dtype=wp.mat33),
    body_inverse_inertia: wp.array(dtype=wp.mat33),
):
    """Write each world's base into the model's arrays, of which the solver must be told. Launched over [num_worlds].

    The inertia about the centre of mass grows in proportion to the mass.
    """
    world = wp.tid()
    body = world * bodies_per_world
    mass = base.mass[world]
    inertia = base.nominal_inertia * (mass / base.nominal_mass)
    body_mass[body] = mass
    body_inverse_mass[body] = 1.0 / mass
    body_com[body] = base.com[world]
    body_inertia[body] = inertia
    body_inverse_inertia[body] = wp.inverse(inertia)
    robot.com_b[world] = base.com[world]


@wp.kernel
def apply_friction(
    friction: wp.array(dtype=float), geom_role: wp.array(dtype=int), geom_friction: wp.array2d(dtype=wp.vec3)
):
    """Write the sliding friction of the robot's shapes into the solver's model. Launched over [num_worlds, num_geoms].

    The floor's own is next to nothing and a contact takes the larger of the two, so that the robot's rules.
    """
    world, geom = wp.tid()
    if geom_role[geom] >= 0:
        present = geom_friction[world, geom]
        geom_friction[world, geom] = wp.vec3(friction[world], present[1], present[2])


@wp.kernel
def schedule_push(view: WorldView, interval: wp.vec2, next_push: wp.array(dtype=int)):
    """Draw when the first push of an episode comes [control steps]. Launched over [num_worlds]."""
    world = wp.tid()
    if view.done[world] == wp.int64(0):
        return
    rng = random_stream(view.seed[world], view.episode[world], 9)
    # Anywhere in the first interval, so that the worlds are not pushed in time with each other.
    next_push[world] = int(wp.randf(rng, 0.0, interval[1]))


@wp.kernel
def push_robots(
    view: WorldView, interval: wp.vec2, speed: wp.vec2, next_push: wp.array(dtype=int), push: wp.array(dtype=wp.vec3)
):
    """Add a horizontal velocity of random direction to the base of every world whose time has come.

    ``push`` tells what was added [m/s], zero as a rule. Launched over [num_worlds].
    """
    world = wp.tid()
    push[world] = wp.vec3(0.0, 0.0, 0.0)
    step = view.reference_step[world]
    if step < next_push[world]:
        return
    rng = wp.rand_init(int(random_stream(view.seed[world], view.episode[world], 10)), step)
    direction = 2.0 * wp.PI * wp.randf(rng)
    strength = wp.randf(rng, speed[0], speed[1])
    added = wp.vec3(strength * wp.cos(direction), strength * wp.sin(direction), 0.0)
    for axis in range(2):
        view.robot.joint_qd[world, axis] = view.robot.joint_qd[world, axis] + added[axis]
    push[world] = added
    next_push[world] = step + 1 + int(wp.randf(rng, interval[0], interval[1]))
