"""Some trajectories of a motion in double precision, as the checks see them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.quality import rollout_quality, settled_quality
from kine2go_warp.dataset.schema import DIVERSITY_ARRAYS, RewardSettings, observation_labels, reward_settings
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.quantities import RANDOMIZED_PARAMETERS
from kine2go_warp.robots import RobotSpec
from kine2go_warp.robots.spec import MotorLimits

Array = NDArray[np.float64]

DIVERSITY = ("gather_settings", "diversity")
"""Where the attributes of a motion have the settings of diversity."""


@dataclass(frozen=True)
class Settings:
    """What the attributes say of how a motion was made; None where they do not."""

    control_frequency: float | None
    """[Hz]"""
    physics_substeps: int | None
    """Physics steps in one control step."""
    stiffness: float | None
    """[N m/rad]"""
    damping: float | None
    """[N m s/rad]"""
    latency: float | None
    """Time from an action to its effect at the motors [s]."""
    torque_speed: bool
    """Whether torques end on the motors' torque-speed line; if not, at the URDF's limits."""
    friction: float | None
    """Coefficient of friction between robot and floor."""
    is_flat: bool
    """Whether the ground is a plane."""
    is_once: bool
    """Whether the motion is played once, rather than a cycle."""
    ranges: Mapping[str, tuple[float, float]]
    """Least and greatest value, or factor, of each parameter that is drawn or not; empty if terms share one."""
    nominal: Mapping[str, float]
    """Value of each parameter that is not drawn, where it is one number."""
    rewards: tuple[RewardSettings, ...]
    """The reward terms; none where the attributes do not describe them."""
    warm_up: float | None
    """Dropped from the beginning of each rollout [s]."""
    policy_std: tuple[float, ...] | None
    """Standard deviations of the policy's actions, one a joint."""
    noise: tuple[float, float] | None
    """Least and greatest noise on the actions, in standard deviations."""
    diversity: Mapping[str, tuple[float, float]]
    """Least and greatest value of each of ``DIVERSITY_ARRAYS`` that the settings give a range."""
    recovery_time: float
    """Time after a beginning off the reference or a hard push for which the limits of tracking do not count [s]."""
    recovery_limit_scale: float
    """Distance and angle that are accepted within that time, as a multiple of their limits."""
    max_distance: float | None
    """Farthest that a root of an accepted rollout is from its reference [m]."""
    max_angle: float | None
    """Furthest that it is turned from its reference [rad]."""
    max_joint_rmse: float | None
    """Worst tracking of an accepted rollout's joints [rad]."""
    observed: tuple[str, ...]
    """Names of the columns of observations, none where they are not stored."""
    limits: Mapping[str, float]
    """Limits of the filter by the metric that they are for."""

    @classmethod
    def read(cls, root: Mapping[str, Any], motion: Mapping[str, Any]) -> "Settings":
        """Read the settings from the attributes of the root and of a motion, in which anything may be missing.

        Args:
            root: Attributes of the dataset.
            motion: Attributes of the motion.
        """
        substeps = number(root, "physics_substeps")

        def gathering(name: str) -> float | None:
            return number(motion, "gather_settings", name)

        return cls(
            control_frequency=positive(number(root, "control_frequency")),
            physics_substeps=round(substeps) if substeps is not None and substeps >= 1.0 else None,
            stiffness=number(root, "stiffness"),
            damping=number(root, "damping"),
            latency=number(motion, "training_settings", "env", "action", "latency"),
            torque_speed=nested(motion, "training_settings", "env", "motor", "torque_speed") is True,
            friction=number(motion, "training_settings", "env", "solver", "friction"),
            is_flat=nested(motion, "environment_settings", "terrain", "kind") == "flat",
            is_once=nested(motion, "kind") == "once",
            ranges=drawn_ranges(motion, nominal := nominal_values(root, motion)),
            nominal=nominal,
            rewards=reward_settings(motion),
            warm_up=gathering("warm_up"),
            policy_std=numbers(motion, "policy_std"),
            noise=pair(motion, "gather_settings", "action_noise_scale"),
            diversity={one.name: found for one in DIVERSITY_ARRAYS if (found := pair(motion, *DIVERSITY, one.name))},
            recovery_time=number(motion, *DIVERSITY, "recovery_time") or 0.0,
            recovery_limit_scale=number(motion, *DIVERSITY, "recovery_limit_scale") or 1.0,
            max_distance=gathering("max_distance"),
            max_angle=gathering("max_angle"),
            max_joint_rmse=gathering("max_joint_rmse"),
            observed=observation_labels(motion),
            limits={one.name: limit for one in FILTER_METRICS if (limit := gathering(one.setting or "")) is not None},
        )


def nominal_values(root: Mapping[str, Any], motion: Mapping[str, Any]) -> dict[str, float]:
    """Return the value of each parameter that is one number where nothing is drawn."""
    found = {
        "base_mass": 0.0,
        "base_com": 0.0,
        "strength": 1.0,
        "motor_offset": 0.0,
        "stiffness": number(root, "stiffness"),
        "damping": number(root, "damping"),
        "friction": number(motion, "environment_settings", "solver", "friction"),
        "latency": number(motion, "environment_settings", "action", "latency"),
    }
    return {name: value for name, value in found.items() if value is not None}


def drawn_ranges(motion: Mapping[str, Any], nominal: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return the range of each parameter, one value where it is not drawn."""
    terms = nested(motion, "gather_settings", "randomization")
    if not isinstance(terms, Mapping) or any(isinstance(one, Mapping) for one in terms.values()):
        # Terms with names of their own may draw a parameter again.
        return {}
    operations = {one.name: one.operation for one in RANDOMIZED_PARAMETERS}
    found = {}
    for name, value in nominal.items():
        drawn = pair(motion, "gather_settings", "randomization", name)
        fixed = 1.0 if operations[name] == "scale" else value
        found[name] = (fixed, fixed) if drawn is None else drawn
    return found


def nested(attributes: Mapping[str, Any], *keys: str) -> Any:
    """Return a value from nested attributes, None if it is not there."""
    value: Any = attributes
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value


def number(attributes: Mapping[str, Any], *keys: str) -> float | None:
    """Return a number from nested attributes, None if it is not there or no number."""
    value = nested(attributes, *keys)
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and np.isfinite(value) else None


def numbers(attributes: Mapping[str, Any], *keys: str) -> tuple[float, ...] | None:
    """Return a list of numbers from nested attributes, None if it is not there."""
    values = nested(attributes, *keys)
    if not isinstance(values, list):
        return None
    found = [number({"value": value}, "value") for value in values]
    return None if None in found else tuple(value for value in found if value is not None)


def pair(attributes: Mapping[str, Any], *keys: str) -> tuple[float, float] | None:
    """Return two numbers from nested attributes, None if they are not there."""
    values = numbers(attributes, *keys)
    return (values[0], values[1]) if values is not None and len(values) == 2 else None


def positive(value: float | None) -> float | None:
    """Return a value if it is a positive number, None otherwise."""
    return value if value is not None and value > 0.0 else None


def is_rows(name: str, values: Any) -> bool:
    """Return whether an array has an entry for each row; those of sub-groups have one for each trajectory."""
    return values.ndim > 1 and "/" not in name


@dataclass(frozen=True)
class Block:
    """Some neighbouring trajectories of one motion."""

    first: int
    """Number of the first of them in the motion."""
    stored: Mapping[str, Array]
    """Arrays by name as they are stored, those of sub-groups as ``group/name``; unreadable ones are not there."""
    settings: Settings
    spec: RobotSpec

    @property
    def motor_limits(self) -> MotorLimits:
        """What the motors gave in this simulation, by speed."""
        spec = self.spec
        return spec.motor_limits if self.settings.torque_speed else MotorLimits.constant(spec.joint_effort)

    @cached_property
    def rows(self) -> Mapping[str, Array]:
        """The row arrays, NaN beyond each trajectory's length."""
        return {name: self._masked(values) for name, values in self.stored.items() if is_rows(name, values)}

    @cached_property
    def beyond(self) -> NDArray[np.bool_]:
        """Whether a row lies beyond its trajectory's length, shape [num_trajectories, num_rows]."""
        if "length" not in self.stored:
            return np.zeros((self.num_trajectories, self.num_rows), dtype=bool)
        return np.arange(self.num_rows) >= self.stored["length"][:, None]

    @cached_property
    def quality(self) -> Mapping[str, Array]:
        """The metrics of the filter, computed from the rows; none where the rate is not known."""
        frequency = self.settings.control_frequency
        if frequency is None:
            return {}
        found = rollout_quality(self.rows, 1.0 / frequency, self.spec)
        settings = self.settings
        judging = (self["recovery"] > 0.0, settings.recovery_time, settings.recovery_limit_scale)
        judged = settled_quality(self.rows, found, 1.0 / frequency, self.spec, *judging)
        limits = [judged[one.name] / settings.limits.get(one.name, np.nan) for one in FILTER_METRICS]
        return {**found, "worst_limit_ratio": np.max(np.stack(limits), axis=0)}

    @property
    def num_trajectories(self) -> int:
        """Number of trajectories."""
        return len(next(iter(self.stored.values())))

    @property
    def num_rows(self) -> int:
        """Rows of the longest possible trajectory."""
        return next(values.shape[1] for name, values in self.stored.items() if is_rows(name, values))

    def __getitem__(self, name: str) -> Array:
        """Return an array by name: row arrays with NaN beyond each length, others as they are."""
        return self.rows[name] if name in self.rows else self.stored[name]

    def __contains__(self, name: str) -> bool:
        return name in self.stored

    def replaced(self, changes: Mapping[str, Array]) -> "Block":
        """Return the block with other values in some arrays."""
        return replace(self, stored={**self.stored, **changes})

    def selected(self, numbers: NDArray[np.intp]) -> "Block":
        """Return some of the trajectories, by their place in the block."""
        return replace(self, stored={name: values[numbers] for name, values in self.stored.items()})

    def _masked(self, values: Array) -> Array:
        beyond = self.beyond.reshape(*self.beyond.shape, *(1,) * (values.ndim - 2))
        return np.where(beyond, np.nan, values)
