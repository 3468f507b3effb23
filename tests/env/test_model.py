import mujoco
import newton
import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from kine2go_warp.kernels.contacts import ROLE_BODY, ROLE_LEG
from kine2go_warp.robots import GO2


def test_shapes_and_their_roles(environment):
    roles = environment.simulation.geom_role.numpy()
    assert [int(np.sum(roles == foot)) for foot in range(4)] == [1, 1, 1, 1]
    assert int(np.sum(roles == int(ROLE_BODY))) == 2, "trunk and head"
    assert int(np.sum(roles == int(ROLE_LEG))) == 8, "thighs and calves"


def test_the_foot_of_a_role_is_on_the_leg_of_that_name(environment):
    shapes = environment.simulation.solver.mjc_geom_to_newton_shape.numpy()[0]
    bodies = environment.simulation.model.shape_body.numpy()
    for foot, leg in enumerate(GO2.legs):
        geom = int(np.flatnonzero(environment.simulation.geom_role.numpy() == foot)[0])
        assert environment.simulation.model.body_label[bodies[shapes[geom]]].endswith(f"/{leg.name}_calf")


def test_legs_are_capsules_as_long_as_the_urdfs_cylinders(environment):
    kinds, scales = environment.simulation.model.shape_type.numpy(), environment.simulation.model.shape_scale.numpy()
    assert not np.any(kinds == newton.GeoType.CYLINDER)
    capsules = scales[kinds == newton.GeoType.CAPSULE][:8]
    lengths = sorted({round(float(2.0 * (radius + half)), 4) for radius, half, _ in capsules})
    assert lengths == [0.205, 0.253]


def test_mass_and_limits_arrive_in_the_simulator(environment):
    num_worlds = environment.num_worlds
    assert environment.simulation.model.body_mass.numpy().sum() / num_worlds == pytest.approx(15.017, abs=1e-3)
    lower = environment.simulation.model.joint_limit_lower.numpy().reshape(num_worlds, 18)[0, 6:]
    np.testing.assert_allclose(lower, GO2.joint_lower, atol=1e-6)
    armature = environment.simulation.model.joint_armature.numpy().reshape(num_worlds, 18)[0, 6:]
    np.testing.assert_allclose(armature, GO2.armature)


def read_by_mujoco():
    """Mass, centre and inertia of each moving body, as MuJoCo's own compiler reads the URDF."""
    spec = mujoco.MjSpec.from_file(str(GO2.urdf))
    spec.body(GO2.base_link).add_freejoint()
    model = spec.compile()
    found = {}
    for body in range(1, model.nbody):
        turn = Rotation.from_quat(model.body_iquat[body], scalar_first=True).as_matrix()
        inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
        found[model.body(body).name] = (model.body_mass[body], model.body_ipos[body].copy(), inertia)
    return found


def added_by_numpy():
    """The same of the calves with their feet, from the numbers of the URDF as the manufacturer publishes them."""
    found = {}
    for leg in GO2.legs:
        side = 1.0 if leg.name.endswith("L") else -1.0
        calf, foot = np.array([0.00548, -0.000975 * side, -0.115]), np.array([0.0, 0.0, -0.213])
        shear = np.array([[0, 3.4e-07 * side, 1.72e-05], [0, 0, 8.28e-06 * side], [0, 0, 0]])
        inertia = np.diag([0.00108, 0.0011, 3.29e-05]) + shear + shear.T + 7.744e-06 * np.eye(3)
        centre = (0.154 * calf + 0.04 * foot) / 0.194
        for mass, place in ((0.154, calf), (0.04, foot)):
            arm = place - centre
            inertia = inertia + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        found[f"{leg.name}_calf"] = (0.194, centre, inertia)
    return found


@pytest.mark.parametrize("reader", [read_by_mujoco, added_by_numpy])
def test_every_body_has_the_mass_centre_and_inertia_of_the_urdf(environment, reader):
    model, expected = environment.simulation.model, reader()
    labels = [label.split("/")[-1] for label in model.body_label[:13]]
    assert set(expected) <= set(labels)
    masses, centres, inertias = model.body_mass.numpy(), model.body_com.numpy(), model.body_inertia.numpy()
    for name, (mass, centre, inertia) in expected.items():
        body = labels.index(name)
        assert masses[body] == pytest.approx(mass, rel=1e-3), name
        np.testing.assert_allclose(centres[body], centre, atol=1e-3 * np.linalg.norm(centre), err_msg=name)
        np.testing.assert_allclose(inertias[body], inertia, atol=1e-3 * np.linalg.norm(inertia), err_msg=name)


def test_the_solver_has_the_inertias_of_the_model(environment):
    """What the solver steps with, in every world: principal moments and masses."""
    solver, expected = environment.simulation.solver.mjw_model, read_by_mujoco()
    for body, label in enumerate(environment.simulation.model.body_label[:13], start=1):
        mass, _, inertia = expected[label.split("/")[-1]]
        np.testing.assert_allclose(solver.body_mass.numpy()[:, body], mass, rtol=1e-3)
        principal = np.sort(np.linalg.eigvalsh(inertia))
        np.testing.assert_allclose(
            np.sort(solver.body_inertia.numpy()[:, body], axis=1), [principal] * environment.num_worlds, rtol=1e-3
        )


def test_newtons_kernels_are_compiled_without_adjoints():
    assert wp.get_module("newton._src.sim.articulation").options["enable_backward"] is False
