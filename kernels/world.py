"""Everything that a term of the environment may read of the worlds, as one struct."""

import warp as wp

from kine2go_warp.kernels.actuation import MotorModel
from kine2go_warp.kernels.kinematics import LegGeometry
from kine2go_warp.kernels.reference import Placement, ReferenceClips, ReferenceState
from kine2go_warp.kernels.state import RobotState

wp.set_module_options({"enable_backward": False})


@wp.struct
class BaseBody:
    """The base link: as the robot model has it, and as each world has it."""

    nominal_mass: float
    """[kg]"""
    nominal_com: wp.vec3
    """[m]"""
    nominal_inertia: wp.mat33
    """[kg m^2]"""
    mass: wp.array(dtype=float)
    """[kg], shape [num_worlds]."""
    com: wp.array(dtype=wp.vec3)
    """In the base frame [m], shape [num_worlds]."""


@wp.struct
class WorldView:
    """All worlds after a control step. Terms read it; resets and what is drawn are written to it.

    The first axis of every array is the world.
    """

    robot: RobotState
    reference: ReferenceState
    """The reference at the present control step; observations of the future read ``clips`` and ``placement``."""
    clips: ReferenceClips
    placement: Placement
    geometry: LegGeometry
    motors: MotorModel
    base: BaseBody
    friction: wp.array(dtype=float)
    """Coefficient of friction between robot and ground, shape [num_worlds]."""
    foot_force: wp.array2d(dtype=wp.vec3)
    """Force of the ground on each foot, world frame [N], shape [num_worlds, 4]."""
    body_contact: wp.array(dtype=int)
    """Contacts of base and head with the ground, shape [num_worlds]."""
    leg_contact: wp.array(dtype=int)
    """Contacts of thighs and calves with the ground, shape [num_worlds]."""
    overflow: wp.array(dtype=int)
    """The solver's warnings, a bit mask, shape [num_worlds]."""
    action: wp.array2d(dtype=float)
    """The policy's present action, shape [num_worlds, 12]."""
    last_action: wp.array2d(dtype=float)
    """Its action of the step before, zero when an episode begins, shape [num_worlds, 12]."""
    joint_target: wp.array2d(dtype=float)
    """Joint targets of the present action [rad], shape [num_worlds, 12]."""
    torque: wp.array2d(dtype=float)
    """Joint torques of the last physics substep [N m], shape [num_worlds, 12]."""
    default_position: wp.array(dtype=float)
    """Default pose [rad], shape [12]."""
    reference_step: wp.array(dtype=int)
    """Control steps of the reference since the episode began, shape [num_worlds]."""
    episode_length: wp.array(dtype=wp.int64)
    """Control steps since the episode began, as the learner sets them, shape [num_worlds]."""
    world_steps: wp.array(dtype=int)
    """Control steps of each world over all its episodes, counted where limits are annealed, shape [num_worlds]."""
    done: wp.array(dtype=wp.int64)
    """1 where an episode has ended, shape [num_worlds]."""
    seed: wp.array(dtype=wp.uint32)
    """Seed of each world, shape [num_worlds]."""
    episode: wp.array(dtype=int)
    """Number of the present episode, shape [num_worlds]."""
    ahead: int
    """For observations of the future: control steps from now."""
    max_episode_length: int
    """[control steps]"""
    end_hold_steps: int
    """Control steps for which an episode goes on beyond the end of a clip played once."""
    overflow_mask: int
    """Bits of ``overflow`` that mean dropped contacts or constraints."""
    initial_limit_scale: float
    """Factor on annealed limits when training begins."""
    limit_anneal_steps: int
    """Control steps within which it falls to 1."""
    nominal_stiffness: float
    """[N m/rad]"""
    nominal_damping: float
    """[N m s/rad]"""
    robot_weight: float
    """[N]"""
    control_duration: float
    """[s]"""
