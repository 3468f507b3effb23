"""Robot descriptions: the URDF, the typed specification read from it, and closed-form kinematics in NumPy."""

from kine2go_warp.robots.go2 import GO2
from kine2go_warp.robots.spec import Leg, MotorLimits, RobotSpec

__all__ = ["GO2", "Leg", "MotorLimits", "RobotSpec"]
