"""The Unitree Go2."""

from pathlib import Path

from kine2go_warp.robots.spec import LEG_JOINTS, MotorLimits, RobotSpec
from kine2go_warp.robots.urdf import UrdfReader


def _load() -> RobotSpec:
    reader = UrdfReader(Path(__file__).with_name("go2.urdf").resolve())
    leg_names = ("FL", "FR", "RL", "RR")
    joints = tuple(f"{leg}_{joint}_joint" for leg in leg_names for joint in LEG_JOINTS)
    feet = tuple(f"{leg}_foot" for leg in leg_names)
    effort = reader.joint_limits(joints, "effort")
    # Motors are alike; the calf's linkage gears its own by 1.5, as the URDF's limits tell: 35.55 / 23.7 N m.
    ratio = tuple(torque / min(effort) for torque in effort)
    return RobotSpec(
        name="go2",
        urdf=reader.path,
        legs=tuple(reader.leg(leg) for leg in leg_names),
        joint_names=joints,
        base_link="base",
        foot_links=feet,
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
        # Unitree's table for this motor (unitree_rl_lab): Y1 = 20.2 and Y2 = 23.4 N m, X1 = 13.5 and X2 = 30 rad/s.
        motor_limits=MotorLimits(
            driving=tuple(20.2 * gear for gear in ratio),
            braking=tuple(23.4 * gear for gear in ratio),
            full_torque_speed=tuple(13.5 / gear for gear in ratio),
            no_load_speed=tuple(30.0 / gear for gear in ratio),
        ),
        # Middles of what was measured on a hanging Go2 (yusufdxb/go2-phoenix): 0.24-0.35, 0.17-0.34, 0.42-0.96 N m.
        joint_friction=(0.295, 0.255, 0.69) * 4,
        default_joint_position=(0.0, 0.8, -1.5) * 2 + (0.0, 1.0, -1.5) * 2,
        default_root_height=0.335,
        # The URDF holds link inertias only; 0.01 kg m^2 is the rotor inertia that MuJoCo Menagerie's Go2 uses.
        armature=0.01,
        action_scale=0.25,
        sdk_motor_order=tuple(f"{leg}_{joint}_joint" for leg in ("FR", "FL", "RR", "RL") for joint in LEG_JOINTS),
    )


GO2 = _load()
"""The robot that the whole package is built for."""
