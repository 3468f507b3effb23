"""The Unitree Go2."""

from pathlib import Path

from kine2go_warp.robots.unitree import GO2_FRICTION, GO2_NO_LOAD_SPEED, unitree_robot

GO2 = unitree_robot(
    Path(__file__).with_name("go2.urdf"),
    no_load_speed=GO2_NO_LOAD_SPEED,
    joint_friction=GO2_FRICTION,
    default_root_height=0.335,
    # The URDF holds link inertias only; 0.01 kg m^2 is the rotor inertia that MuJoCo Menagerie's Go2 uses.
    armature=0.01,
)
"""The default robot, for which sources state their scale and presets their gains."""
