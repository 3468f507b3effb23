import newton
import numpy as np
import pytest

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
