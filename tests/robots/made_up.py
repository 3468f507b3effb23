"""A robot that no maker has: longer legs and other masses than the Go2, other names."""

import re
from pathlib import Path

from tests.conftest import REPOSITORY

PAGE = REPOSITORY / "docs" / "adding-a-robot.md"
THIGH, CALF, WIDTH, FOOT = 0.24, 0.25, 0.11, 0.025
"""Lengths of thigh and calf, distance of the thigh joint from the hip joint, radius of the foot [m]."""


def inertial(mass, size):
    moment = mass * size**2 / 6.0
    return f"""<inertial><mass value="{mass}"/>
    <inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial>"""


def shape(geometry, xyz="0 0 0", name="", rpy="0 0 0"):
    inside = f'<origin xyz="{xyz}" rpy="{rpy}"/><geometry>{geometry}</geometry>'
    named = f' name="{name}"' if name else ""
    return f"<collision{named}>{inside}</collision><visual>{inside}</visual>"


def joint(name, parent, child, xyz, axis="", limits=(0.0, 0.0), effort=30.0):
    kind = "revolute" if axis else "fixed"
    rest = ""
    if axis:
        lower, upper = limits
        rest = f'<axis xyz="{axis}"/><limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="25"/>'
    return f"""<joint name="{name}" type="{kind}"><origin xyz="{xyz}"/>
    <parent link="{parent}"/><child link="{child}"/>{rest}</joint>"""


def leg(name, x, y):
    side = WIDTH if y > 0 else -WIDTH
    bar = '<cylinder radius="0.02" length="{}"/>'
    hip = shape('<cylinder radius="0.04" length="0.04"/>', f"0 {0.8 * side} 0", rpy="1.57079633 0 0")
    hip = hip[hip.index("<visual>") :]
    return f"""
  {joint(f"{name}_abduction", "body", f"{name}_side", f"{x} {y} 0", "1 0 0", (-0.9, 0.9))}
  <link name="{name}_side">{inertial(0.8, 0.06)}{hip}</link>
  {joint(f"{name}_shoulder", f"{name}_side", f"{name}_upper", f"0 {side} 0", "0 1 0", (-1.4, 3.4))}
  <link name="{name}_upper">{inertial(1.4, 0.1)}{shape(bar.format(THIGH + 0.04), f"0 0 {-0.5 * THIGH}")}</link>
  {joint(f"{name}_elbow", f"{name}_upper", f"{name}_lower", f"0 0 {-THIGH}", "0 1 0", (-2.7, -0.7), 45.0)}
  <link name="{name}_lower">{inertial(0.2, 0.1)}{shape(bar.format(CALF - 0.02), f"0 0 {-0.5 * CALF}")}</link>
  {joint(f"{name}_ankle", f"{name}_lower", f"{name}_toe", f"0 0 {-CALF}")}
  <link name="{name}_toe">{inertial(0.06, 0.03)}{shape(f'<sphere radius="{FOOT}"/>')}</link>"""


def urdf():
    places = {"front_left": (1, 1), "front_right": (1, -1), "rear_left": (-1, 1), "rear_right": (-1, -1)}
    legs = "".join(leg(name, 0.22 * x, 0.05 * y) for name, (x, y) in places.items())
    trunk = shape('<box size="0.42 0.1 0.12"/>', name="trunk") + shape('<sphere radius="0.05"/>', "0.32 0 0", "nose")
    return f'<robot name="my_robot"><link name="body">{inertial(9.0, 0.3)}{trunk}</link>{legs}</robot>'


def write_robot(folder: Path) -> str:
    """Write the URDF and the file of docs/adding-a-robot.md into a folder; return the robot's reference."""
    example, _variant = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (folder / "my_robot.urdf").write_text(urdf())
    (folder / "my_robot.py").write_text(example)
    return f"{(folder / 'my_robot.py').resolve()}:SPEC"
