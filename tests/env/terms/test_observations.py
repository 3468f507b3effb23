from dataclasses import replace

import numpy as np
import pytest

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.observations import observation_layout, observation_size
from kine2go_warp.env.terms.base import with_term
from kine2go_warp.env.terms.observations import OBSERVATIONS, PRIVILEGED_OBSERVATIONS, REFERENCE_OBSERVATIONS
from kine2go_warp.errors import Kine2GoError
from tests.env.helpers import drive


def test_every_observation_of_the_package_has_a_kernel():
    for term in (*OBSERVATIONS, *REFERENCE_OBSERVATIONS, *PRIVILEGED_OBSERVATIONS):
        assert term.load_kernel().func.__module__ == "kine2go_warp.kernels.observations"


def test_without_the_bases_linear_velocity_all_other_values_are_the_same_bits(clip, small_config):
    config = replace(small_config, num_worlds=4)
    blind = replace(config, observations=with_term(config.observations, "linear_velocity_b", enabled=False))
    assert observation_size(blind) == observation_size(config) - 3 * 3
    seen = drive(ImitationEnvironment([clip], config, "cpu"), 5, 1)[-1]["observation"]
    less = drive(ImitationEnvironment([clip], blind, "cpu"), 5, 1)[-1]["observation"]
    places = {field.name: slice(field.start, field.stop) for field in observation_layout(config)}
    for field in observation_layout(blind):
        assert not field.name.startswith("linear_velocity_b")
        np.testing.assert_array_equal(less[:, field.start : field.stop], seen[:, places[field.name]])


def test_a_policy_must_see_something():
    with pytest.raises(Kine2GoError, match="observations are all switched off"):
        EnvConfig(observations=tuple(replace(term, enabled=False) for term in OBSERVATIONS))


def test_an_unknown_dimension_is_refused():
    with pytest.raises(Kine2GoError, match="unknown dimension 'toe'; known are: axis, joint, foot"):
        replace(OBSERVATIONS[0], dims=("toe",))
