"""Domain randomisation: what is drawn for each world besides its initial state."""

import warp as wp

from kine2go_warp.kernels.actuation import MotorModel
from kine2go_warp.kernels.resets import random_stream
from kine2go_warp.kernels.state import RobotState
from kine2go_warp.kernels.world import BaseBody

wp.set_module_options({"enable_backward": False})


@wp.struct
class MotorRanges:
    """Ranges of what is drawn for each episode, each (low, high)."""

    stiffness: wp.vec2
    """Factor on the stiffness [-], drawn for each joint."""
    damping: wp.vec2
    """Factor on the damping [-], drawn for each joint."""
    strength: wp.vec2
    """Factor on the torque [-], drawn for each joint."""
    offset: wp.vec2
    """Error of the joint's zero [rad], drawn for each joint."""
    friction: wp.vec2
    """Factor on the joint's friction [-], drawn for each joint."""
    delay: wp.vec2
    """Latency [physics substeps], both ends included."""


@wp.struct
class BodyRanges:
    """Ranges of what is drawn for each world when it is made, each (low, high)."""

    mass: wp.vec2
    """Mass added to the base [kg]."""
    com: wp.vec2
    """Shift of the base's centre of mass along each axis [m]."""


@wp.kernel
def draw_bodies(seed: wp.array(dtype=wp.uint32), ranges: BodyRanges, base: BaseBody):
    """Draw mass and centre of mass of each world's base. Launched over [num_worlds]."""
    world = wp.tid()
    rng = random_stream(seed[world], 0, 8)
    base.mass[world] = base.nominal_mass + wp.randf(rng, ranges.mass[0], ranges.mass[1])
    shift = wp.vec3(0.0, 0.0, 0.0)
    for axis in range(3):
        shift[axis] = wp.randf(rng, ranges.com[0], ranges.com[1])
    base.com[world] = base.nominal_com + shift


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
def draw_motors(
    done: wp.array(dtype=wp.int64),
    seed: wp.array(dtype=wp.uint32),
    episode: wp.array(dtype=int),
    ranges: MotorRanges,
    nominal_stiffness: float,
    nominal_damping: float,
    nominal_friction: wp.array(dtype=float),
    motors: MotorModel,
):
    """Draw the motors of every world that is done. Launched over [num_worlds]."""
    world = wp.tid()
    if done[world] == wp.int64(0):
        return
    rng = random_stream(seed[world], episode[world], 6)
    for joint in range(12):
        motors.stiffness[world, joint] = nominal_stiffness * wp.randf(rng, ranges.stiffness[0], ranges.stiffness[1])
        motors.damping[world, joint] = nominal_damping * wp.randf(rng, ranges.damping[0], ranges.damping[1])
        motors.strength[world, joint] = wp.randf(rng, ranges.strength[0], ranges.strength[1])
        motors.offset[world, joint] = wp.randf(rng, ranges.offset[0], ranges.offset[1])
        friction = wp.randf(rng, ranges.friction[0], ranges.friction[1])
        motors.friction[world, joint] = nominal_friction[joint] * friction
    motors.delay[world] = wp.min(int(wp.randf(rng, ranges.delay[0], ranges.delay[1] + 1.0)), int(ranges.delay[1]))


@wp.kernel
def draw_friction(
    done: wp.array(dtype=wp.int64),
    seed: wp.array(dtype=wp.uint32),
    episode: wp.array(dtype=int),
    limits: wp.vec2,
    friction: wp.array(dtype=float),
):
    """Draw the coefficient of friction between robot and floor for every world that is done."""
    world = wp.tid()
    if done[world] == wp.int64(0):
        return
    rng = random_stream(seed[world], episode[world], 7)
    friction[world] = wp.randf(rng, limits[0], limits[1])


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
def schedule_push(
    done: wp.array(dtype=wp.int64),
    seed: wp.array(dtype=wp.uint32),
    episode: wp.array(dtype=int),
    interval: wp.vec2,
    next_push: wp.array(dtype=int),
):
    """Draw when the first push of an episode comes [control steps]. Launched over [num_worlds]."""
    world = wp.tid()
    if done[world] == wp.int64(0):
        return
    rng = random_stream(seed[world], episode[world], 9)
    # Anywhere in the first interval, so that the worlds are not pushed in time with each other.
    next_push[world] = int(wp.randf(rng, 0.0, interval[1]))


@wp.kernel
def push_robots(
    seed: wp.array(dtype=wp.uint32),
    episode: wp.array(dtype=int),
    reference_step: wp.array(dtype=int),
    interval: wp.vec2,
    speed: wp.vec2,
    next_push: wp.array(dtype=int),
    robot: RobotState,
    push: wp.array(dtype=wp.vec3),
):
    """Add a horizontal velocity of random direction to the base of every world whose time has come.

    ``push`` tells what was added [m/s], zero as a rule. Launched over [num_worlds].
    """
    world = wp.tid()
    push[world] = wp.vec3(0.0, 0.0, 0.0)
    step = reference_step[world]
    if step < next_push[world]:
        return
    rng = wp.rand_init(int(random_stream(seed[world], episode[world], 10)), step)
    direction = 2.0 * wp.PI * wp.randf(rng)
    strength = wp.randf(rng, speed[0], speed[1])
    added = wp.vec3(strength * wp.cos(direction), strength * wp.sin(direction), 0.0)
    for axis in range(2):
        robot.joint_qd[world, axis] = robot.joint_qd[world, axis] + added[axis]
    push[world] = added
    next_push[world] = step + 1 + int(wp.randf(rng, interval[0], interval[1]))
