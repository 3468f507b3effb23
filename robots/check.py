"""What a robot must be like for retargeting, kernels and drawings, checked before anything is done with it."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.quantities import LEG_NAMES
from kine2go_warp.robots.spec import LEG_JOINTS, RobotSpec
from kine2go_warp.robots.urdf import UrdfReader, joint_link

TOLERANCE = 1e-6
"""By which lengths of specification and URDF may differ [m]."""

PER_JOINT = ("joint_lower", "joint_upper", "joint_effort", "joint_speed", "joint_friction", "default_joint_position")
POSITIVE = (
    *("foot_radius", "trunk_size", "head_radius", "thigh_radius", "calf_radius", "joint_effort", "joint_speed"),
    *("default_root_height", "stiffness_factor", "damping_factor", "action_scale"),
)
AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0))
"""Of the three joints of a leg."""


def check_robot(spec: RobotSpec, where: str) -> None:
    """Check a specification, and that its URDF is a robot of this kind.

    Args:
        spec: The robot.
        where: Where it is defined, for the message.

    Raises:
        Kine2GoError: something is wrong; the message has the first problem.
    """
    for problem in (*problems_of_values(spec), *problems_of_urdf(spec)):
        raise Kine2GoError(f"{where}: {problem}")


def problems_of_values(spec: RobotSpec) -> Iterator[str]:
    """Yield what is wrong with the numbers and names of a specification alone."""
    if (legs := tuple(leg.name for leg in spec.legs)) != LEG_NAMES:
        yield f"legs are {', '.join(legs)}; they must be {', '.join(LEG_NAMES)}, in this order"
        return
    for name, count in (("joint_names", 12), ("foot_links", 4), ("sdk_motor_order", 12), *((n, 12) for n in PER_JOINT)):
        if len(found := getattr(spec, name)) != count:
            yield f"{name} has {len(found)} entries, not {count}"
            return
    if sorted(spec.sdk_motor_order) != sorted(spec.joint_names):
        yield "sdk_motor_order does not hold the names of joint_names, each once"
    for name in (*PER_JOINT, *POSITIVE, "head_centre", "calf_span", "armature"):
        values = np.atleast_1d(getattr(spec, name))
        if not np.isfinite(values).all() or (name in POSITIVE and (values <= 0.0).any()):
            yield f"{name} is {getattr(spec, name)}; its values must be {'positive' if name in POSITIVE else 'finite'}"
    for name, values in vars(spec.motor_limits).items():
        if len(values) != 12 or not np.isfinite(values).all() or min(values) <= 0.0:
            yield f"motor_limits.{name} must have 12 positive values"
    lower, upper = np.array(spec.joint_lower), np.array(spec.joint_upper)
    standing = np.array(spec.default_joint_position)
    for index in np.flatnonzero((standing < lower) | (standing > upper)):
        yield f"default_joint_position of {spec.joint_names[index]} is outside its limits"
    lengths = {(leg.thigh_length, leg.calf_length) for leg in spec.legs}
    if np.ptp(np.array(sorted(lengths)), axis=0).max() > TOLERANCE or np.min(sorted(lengths)) <= 0.0:
        yield "thighs and calves must have the same positive lengths on all legs"


def problems_of_urdf(spec: RobotSpec) -> Iterator[str]:
    """Yield where the URDF is missing, lacks a name, or has other axes and lengths than the specification."""
    if not Path(spec.urdf).is_file():
        yield f"{spec.urdf}: no such URDF"
        return
    try:
        reader = UrdfReader(spec.urdf)
    except ElementTree.ParseError as error:
        yield f"{spec.urdf}: not a URDF ({error})"
        return
    moving = tuple(joint.attrib["name"] for joint in reader.root.iter("joint") if joint.get("type") != "fixed")
    if sorted(moving) != sorted(spec.joint_names):
        yield f"{spec.urdf}: its moving joints are {', '.join(moving)}; joint_names has other ones"
        return
    for index, leg in enumerate(spec.legs):
        parent = spec.base_link
        feet = reader.root.findall("joint[@type='fixed']")
        foot = next((one for one in feet if joint_link(one, "child") == spec.foot_links[index]), None)
        if foot is None:
            yield f"{spec.urdf}: no fixed joint leads to the foot {spec.foot_links[index]}"
            return
        joints = [reader.find(f"joint[@name='{name}']") for name in spec.joint_names[3 * index : 3 * index + 3]]
        down = ((0.0, 0.0, -leg.thigh_length), (0.0, 0.0, -leg.calf_length))
        for part, joint, axis, offset in zip(
            (*LEG_JOINTS, "foot"),
            (*joints, foot),
            (*AXES, None),
            (leg.hip_offset, leg.thigh_offset, *down),
            strict=True,
        ):
            name = joint.attrib["name"]
            if (found := joint_link(joint, "parent")) != parent:
                yield f"{spec.urdf}: {name} is on {found}; the {part} joint of {leg.name} must be on {parent}"
            xyz, rpy = read_vector(joint, "origin", "xyz", "0 0 0"), read_vector(joint, "origin", "rpy", "0 0 0")
            if np.abs(xyz - offset).max() > TOLERANCE or np.abs(rpy).max() > TOLERANCE:
                yield (
                    f"{spec.urdf}: {name} is at {xyz.tolist()} turned by {rpy.tolist()}; the specification has it at "
                    f"{list(offset)}, not turned"
                )
            turn = read_vector(joint, "axis", "xyz", "1 0 0")
            if axis is not None and np.abs(turn - axis).max() > TOLERANCE:
                yield f"{spec.urdf}: {name} turns about {turn.tolist()}; the {part} joint must turn about {list(axis)}"
            parent = joint_link(joint, "child")
        sphere = reader.root.find(f"link[@name='{parent}']/collision/geometry/sphere")
        if sphere is None or abs(float(sphere.attrib["radius"]) - spec.foot_radius) > TOLERANCE:
            yield f"{spec.urdf}: {parent} has no collision sphere of foot_radius, {spec.foot_radius} m"


def read_vector(element: ElementTree.Element, child: str, attribute: str, default: str) -> NDArray[np.float64]:
    """Return three numbers of a child element, or the default if it is not there."""
    found = element.find(child)
    return np.array((default if found is None else found.get(attribute, default)).split(), dtype=np.float64)
