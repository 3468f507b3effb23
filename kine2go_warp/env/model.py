"""The Newton model: many worlds with one robot each on a common floor."""

from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import kine2go_warp.kernels  # noqa: F401 - its settings of Warp come before Newton

# isort: split
import mujoco_warp
import newton
import numpy as np
import warp as wp

from kine2go_warp.env.config import EnvConfig, SolverConfig
from kine2go_warp.env.mujoco_engine import FLOOR_FRICTION
from kine2go_warp.env.terrain import HeightField
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.kernels.contacts import ROLE_BODY, ROLE_IGNORED, ROLE_LEG
from kine2go_warp.kernels.kinematics import LegGeometry
from kine2go_warp.kernels.leg_distance import BodyShapes
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.urdf import merge_fixed_links

ABSENT = int(
    mujoco_warp.DisableBit.EULERDAMP
    | mujoco_warp.DisableBit.SPRING
    | mujoco_warp.DisableBit.DAMPER
    | mujoco_warp.DisableBit.FRICTIONLOSS
)
"""MuJoCo's flags for what the model has none of: joint springs, damping, compensation of gravity, fluids, friction."""

SOLREF_AS_GIVEN = 1
"""Newton's mode in which a joint limit takes MuJoCo's time constant and damping ratio as they are."""


def build_model(spec: RobotSpec, config: EnvConfig, ground: HeightField, device: wp.Device) -> newton.Model:
    """Build a model of ``config.num_worlds`` worlds on common ground.

    The robot stands in its default pose, which also tells the solver how many contacts to expect.
    """
    robot = robot_builder(spec, config.solver)
    scene = newton.ModelBuilder()
    for _ in range(config.num_worlds):
        scene.add_world(robot)
    surface = newton.ModelBuilder.ShapeConfig(mu=FLOOR_FRICTION, gap=0.0)
    if config.terrain.is_flat:
        scene.add_ground_plane(cfg=surface)
    else:
        scene.add_shape_heightfield(heightfield=height_field(ground), cfg=surface)
    return scene.finalize(device=device)


def height_field(ground: HeightField) -> newton.Heightfield:
    """Return the ground as Newton takes it."""
    rows, columns = ground.height.shape
    return newton.Heightfield(ground.height, rows, columns, ground.half_extent, ground.half_extent)


def robot_builder(spec: RobotSpec, config: SolverConfig) -> newton.ModelBuilder:
    """Return the builder of one robot, with capsules for legs and torque-driven joints."""
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.default_shape_cfg.mu = config.friction
    # Without it the solver lists every shape within 0.1 m of the floor as a contact.
    builder.default_shape_cfg.gap = 0.0
    builder.default_joint_cfg.armature = spec.armature
    builder.add_urdf(collision_urdf(spec), floating=True, enable_self_collisions=config.self_contact)
    for shape, kind in enumerate(builder.shape_type):
        if kind == newton.GeoType.CYLINDER:
            radius, half_length, _ = builder.shape_scale[shape]
            builder.shape_type[shape] = newton.GeoType.CAPSULE
            builder.shape_scale[shape] = (radius, half_length - radius, 0.0)
    for dof in range(6, 18):
        builder.joint_target_mode[dof] = int(newton.JointTargetMode.EFFORT)
        # Newton's default is a spring of its own, which on these inertias bounces: a damping ratio of 0.06.
        for name, value in (("solreflimit", wp.vec2(config.stop_time, 1.0)), ("solreflimit_mode", SOLREF_AS_GIVEN)):
            values = builder.custom_attributes[f"mujoco:{name}"].values
            assert values is not None
            values[dof] = value
    joints = [label.split("/")[-1] for label in builder.joint_label[1:]]
    if tuple(joints) != spec.joint_names:
        raise Kine2GoError(f"{spec.urdf}: joints are ordered {joints}, not {list(spec.joint_names)}")
    builder.joint_q[:7] = [0.0, 0.0, spec.default_root_height, 0.0, 0.0, 0.0, 1.0]
    builder.joint_q[7:] = list(spec.default_joint_position)
    return builder


def collision_urdf(spec: RobotSpec) -> str:
    """Return the robot's URDF for the simulation: its moving links alone, without visual shapes.

    Newton would copy visual shapes into every world.
    """
    root = ElementTree.parse(spec.urdf).getroot()
    merge_fixed_links(root)
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    return ElementTree.tostring(root, encoding="unicode")


def build_solver(model: newton.Model, config: EnvConfig) -> newton.solvers.SolverMuJoCo:
    """Return the MuJoCo Warp solver of a model."""
    solver = newton.solvers.SolverMuJoCo(
        model,
        iterations=config.solver.iterations,
        ls_iterations=config.solver.line_search_iterations,
        tolerance=config.solver.tolerance,
        njmax=config.max_constraints,
        nconmax=config.solver.max_contacts or possible_contacts(model, config),
        cone="pyramidal",
        # Motor torques come from this project's kernel: an implicit integrator would have nothing to solve for.
        integrator="euler",
        # One unused weld a floating base would otherwise take constraint rows.
        kinematic_switchable_roots=False,
    )
    # The solver would compute what is zero, and factorise the mass matrix a second time for the damping.
    solver.mjw_model.opt.disableflags |= ABSENT
    solver.mj_model.opt.disableflags |= ABSENT
    solver.mjw_model.opt.timestep.fill_(config.substep_duration)
    solver.mj_model.opt.timestep = config.substep_duration
    # Full buffers are counted and reported; with thousands of worlds, a line printed for each would hide the report.
    solver.mjw_model.opt.warn_overflow = 0
    return solver


def possible_contacts(model: newton.Model, config: EnvConfig) -> int:
    """Return how many contacts a world can have at most: of its robot's shapes with the ground, and with one another.

    The worlds share one buffer. So sized, whether a world fits depends on no other world.
    """
    bodies = host_copy(model.shape_body)
    kinds = host_copy(model.shape_type)[(bodies >= 0) & (bodies < model.body_count // config.num_worlds)]
    on_plane = {int(newton.GeoType.SPHERE): 1, int(newton.GeoType.CAPSULE): 2}
    ground = [on_plane.get(int(kind), 8) if config.terrain.is_flat else 4 for kind in kinds]
    pairs = len(kinds) * (len(kinds) - 1) // 2
    return sum(ground) + (2 * pairs if config.solver.self_contact else 0)


def host_copy(array: Any) -> np.ndarray:
    """Return a Warp array of a finished model, in which none is missing, on the host."""
    return np.array(array.numpy())


def by_world(array: wp.array[Any] | None, num_worlds: int) -> wp.array[Any]:
    """Return a flat array of Newton's as rows, one a world, without copying."""
    assert array is not None
    return array.reshape((num_worlds, -1))


def geom_roles(model: newton.Model, solver: newton.solvers.SolverMuJoCo, spec: RobotSpec) -> np.ndarray:
    """Return what each of the solver's shapes is: a foot (0 to 3), body, leg or ignored, shape [num_geoms].

    Shapes are told by the names of their links, never by their order; feet are the spheres on the calves, with which
    the foot links are merged.
    """
    shapes = host_copy(solver.mjc_geom_to_newton_shape)[0]
    bodies, kinds = host_copy(model.shape_body), host_copy(model.shape_type)
    calves = {link: index for index, link in enumerate(spec.leg_links[2::3])}
    roles = np.full(len(shapes), int(ROLE_IGNORED), dtype=np.int32)
    for geom, shape in enumerate(shapes):
        if shape < 0 or bodies[shape] < 0:
            continue
        link = model.body_label[int(bodies[shape])].split("/")[-1]
        if link == spec.base_link:
            roles[geom] = int(ROLE_BODY)
        elif link in calves and kinds[shape] == newton.GeoType.SPHERE:
            roles[geom] = calves[link]
        else:
            roles[geom] = int(ROLE_LEG)
    if sorted(role for role in roles if 0 <= role < 4) != [0, 1, 2, 3]:
        raise Kine2GoError(f"{spec.urdf}: expected one sphere on each of {sorted(calves)}")
    return roles


def base_com(model: newton.Model, num_worlds: int) -> np.ndarray:
    """Return the centre of mass of the base link in its own frame for every world [m], shape [num_worlds, 3]."""
    per_world = model.body_count // num_worlds
    return host_copy(model.body_com)[::per_world]


def leg_geometry(spec: RobotSpec, device: wp.Device) -> LegGeometry:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Return the legs' dimensions for kernels."""
    geometry = LegGeometry()
    geometry.hip_offset = wp.array([leg.hip_offset for leg in spec.legs], dtype=wp.vec3, device=device)
    geometry.thigh_offset = wp.array([leg.thigh_offset for leg in spec.legs], dtype=wp.vec3, device=device)
    geometry.thigh_length = spec.legs[0].thigh_length
    geometry.calf_length = spec.legs[0].calf_length
    geometry.foot_radius = spec.foot_radius
    return geometry


def body_shapes(spec: RobotSpec) -> BodyShapes:  # pyright: ignore[reportGeneralTypeIssues] - a Warp struct
    """Return the shapes of legs, trunk and head for kernels."""
    shapes = BodyShapes()
    shapes.thigh_radius, shapes.calf_radius = spec.thigh_radius, spec.calf_radius
    shapes.calf_top, shapes.calf_bottom = spec.calf_span
    shapes.trunk_half = wp.vec3(*(0.5 * edge for edge in spec.trunk_size))
    shapes.head_centre, shapes.head_radius = wp.vec3(*spec.head_centre), spec.head_radius
    return shapes


@dataclass(frozen=True)
class SpecArrays:
    """The robot's constants on the device, each of shape [12]."""

    spec: RobotSpec
    default_position: wp.array[Any]
    joint_lower: wp.array[Any]
    joint_upper: wp.array[Any]

    @classmethod
    def upload(cls, spec: RobotSpec, device: wp.Device) -> "SpecArrays":
        """Copy the constants to a device."""
        values = (spec.default_joint_position, spec.joint_lower, spec.joint_upper)
        return cls(spec, *(wp.array(value, dtype=float, device=device) for value in values))
