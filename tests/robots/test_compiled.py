"""Hashes of the compiled robot."""

from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.robots import GO2, MotorLimits
from kine2go_warp.robots.compiled import model_difference, model_numbers, model_parts


@pytest.fixture(scope="module")
def stored():
    """What a motion that was made with the present robot tells of it."""
    return {"model_parts": model_parts(GO2)}


def edited(tmp_path, old, new):
    """The robot with another text in its URDF."""
    text = GO2.urdf.read_text()
    assert old in text
    path = tmp_path / "edited.urdf"
    path.write_text(text.replace(old, new))
    return replace(GO2, urdf=path)


def test_the_same_numbers_have_the_same_hash_wherever_the_file_lies(tmp_path, stored):
    copy = edited(tmp_path, "Unitree Go2 with primitive", "The Go2 of Unitree with primitive")
    assert model_difference(stored, copy) == ""
    assert copy.model_hash == GO2.model_hash


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('<mass value="0.04"/>', '<mass value="0.05"/>', "changed since: masses, centres of mass, inertias"),
        ('radius="0.022"', 'radius="0.023"', "changed since: shapes"),
        ('upper="-0.83776"', 'upper="-0.8"', "changed since: joint limits"),
        ('iyy="0.0058"', 'iyy="0.0057"', "changed since: inertias"),
    ],
)
def test_what_has_changed_in_the_urdf_is_named(tmp_path, stored, old, new, named):
    changed = edited(tmp_path, old, new)
    assert model_difference(stored, changed) == named
    assert changed.model_hash != GO2.model_hash


def test_motors_friction_and_rotors_count_too(stored):
    limits = MotorLimits.constant(GO2.joint_effort)
    changed = replace(GO2, armature=0.02, joint_friction=(0.1,) * 12, motor_limits=limits)
    assert model_difference(stored, changed) == "changed since: rotor inertia, joint friction, motor limits"


def test_a_dataset_from_before_the_hash_says_what_was_otherwise():
    assert "no hash of its model" in model_difference({}, GO2)


def test_the_numbers_are_those_of_the_urdf():
    numbers = model_numbers(GO2)
    assert numbers["masses"][0].sum() == pytest.approx(GO2.mass, rel=1e-12)
    np.testing.assert_allclose(numbers["joint limits"][0][1:], np.transpose([GO2.joint_lower, GO2.joint_upper]))
