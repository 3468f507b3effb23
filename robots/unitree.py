"""Unitree's quadrupeds: what their specifications have in common, each read from a URDF with the same names."""

from pathlib import Path

from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.robots.spec import LEG_JOINTS, MotorLimits, RobotSpec
from kine2go_warp.robots.urdf import UrdfReader

GO2_PEAK_TORQUE, GO2_DRIVING, GO2_BRAKING = 23.7, 20.2, 23.4
"""The Go2's hip motor: largest torque by the URDF, driving and braking torque by its curve [N m]."""
GO2_FULL_TORQUE_SPEED, GO2_NO_LOAD_SPEED = 13.5, 30.0
"""Speeds of the same curve [rad/s]: X1 and X2 of Unitree's table (unitree_rl_lab), whose Y1 and Y2 the torques are."""
GO2_FRICTION = (0.295, 0.255, 0.69)
"""Friction of hip, thigh and calf [N m]: middles of what was measured on a hanging Go2 (yusufdxb/go2-phoenix),
0.24-0.35, 0.17-0.34 and 0.42-0.96 N m."""


def motor_limits(effort: tuple[float, ...], no_load_speed: float = GO2_NO_LOAD_SPEED) -> MotorLimits:
    """Return the Go2's curve of torque by speed, stretched to the torques and the speed of another robot's motors.

    The motors of a robot are alike; where the URDF gives a joint more torque than the hip, a linkage gears its motor.

    Args:
        effort: Largest joint torques by the URDF [N m], shape [12].
        no_load_speed: Of the hips and thighs [rad/s].
    """
    gears = [torque / min(effort) for torque in effort]
    torque, speed = min(effort) / GO2_PEAK_TORQUE, no_load_speed / GO2_NO_LOAD_SPEED
    return MotorLimits(
        driving=tuple(GO2_DRIVING * torque * gear for gear in gears),
        braking=tuple(GO2_BRAKING * torque * gear for gear in gears),
        full_torque_speed=tuple(GO2_FULL_TORQUE_SPEED * speed / gear for gear in gears),
        no_load_speed=tuple(GO2_NO_LOAD_SPEED * speed / gear for gear in gears),
    )


def unitree_robot(
    urdf: Path,
    *,
    no_load_speed: float,
    joint_friction: tuple[float, ...],
    default_root_height: float,
    armature: float,
    stiffness_factor: float = 1.0,
    damping_factor: float = 1.0,
) -> RobotSpec:
    """Return the specification of one of Unitree's quadrupeds, named as its URDF.

    They all stand with the same joint angles, legs apart by the bodies' width (Isaac Lab and legged_gym, but for the
    hips, which those turn outwards by 0.1 rad), take actions of 0.25 rad, and count their motors from the front right
    leg on (unitree_legged_sdk, unitree_sdk2).

    Args:
        urdf: The URDF.
        no_load_speed: Of the motors of hips and thighs [rad/s].
        joint_friction: Of hip, thigh and calf [N m], shape [3].
        default_root_height: See ``RobotSpec``, as the other arguments.
        armature: See there.
        stiffness_factor: See there.
        damping_factor: See there.
    """
    reader = UrdfReader(urdf.resolve())
    joints = tuple(f"{leg}_{joint}_joint" for leg in LEG_NAMES for joint in LEG_JOINTS)
    effort = reader.joint_limits(joints, "effort")
    return RobotSpec(
        name=urdf.stem,
        urdf=reader.path,
        legs=tuple(reader.leg(leg) for leg in LEG_NAMES),
        joint_names=joints,
        base_link="base",
        foot_links=tuple(f"{leg}_foot" for leg in LEG_NAMES),
        foot_radius=reader.collision("FL_foot", "sphere", "radius"),
        trunk_size=reader.collision_vector("base_box", "geometry/box", "size"),
        head_centre=reader.collision_vector("head_sphere", "origin", "xyz"),
        head_radius=reader.collision("base", "sphere", "radius"),
        thigh_radius=reader.collision("FL_thigh", "cylinder", "radius"),
        calf_radius=reader.collision("FL_calf", "cylinder", "radius"),
        calf_span=reader.capsule_span("FL_calf"),
        joint_lower=reader.joint_limits(joints, "lower"),
        joint_upper=reader.joint_limits(joints, "upper"),
        joint_effort=effort,
        joint_speed=reader.joint_limits(joints, "velocity"),
        motor_limits=motor_limits(effort, no_load_speed),
        joint_friction=joint_friction * 4,
        default_joint_position=(0.0, 0.8, -1.5) * 2 + (0.0, 1.0, -1.5) * 2,
        default_root_height=default_root_height,
        armature=armature,
        stiffness_factor=stiffness_factor,
        damping_factor=damping_factor,
        action_scale=0.25,
        sdk_motor_order=tuple(f"{leg}_{joint}_joint" for leg in ("FR", "FL", "RR", "RL") for joint in LEG_JOINTS),
    )
