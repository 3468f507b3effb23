"""Settings of the environment. Defaults are the paper's (appendix, hyperparameter table), with one exception.

The table perturbs the base's initial position by 1 m, which is as far as an episode may stray before it ends; the base
begins at its reference here.
"""

from dataclasses import dataclass, field
from typing import Literal

from kine2go_warp.errors import Kine2GoError


@dataclass(frozen=True)
class ActionConfig:
    """How the policy's output becomes a joint target."""

    form: Literal["default_pose", "reference"] = "default_pose"
    """``default_pose``: default pose + scale * output (the paper). ``reference``: the coming reference with its
    velocity fed forward + scale * output. The recorded action means the same in both."""
    scale: float = 0.25
    """Radians for an output of 1."""
    clip: float = 100.0
    """Outputs are clipped to this magnitude."""
    latency: float = 0.02
    """Time from an action to its effect at the motors, rounded to physics substeps [s]."""


@dataclass(frozen=True)
class MotorConfig:
    """The motors' PD law."""

    stiffness: float = 30.0
    """[N m/rad]"""
    damping: float = 1.5
    """[N m s/rad]"""


@dataclass(frozen=True)
class RewardConfig:
    """Weights of the tracking terms; each is divided by the control rate, which gives the paper's scales."""

    joint_position: float = 0.5
    joint_velocity: float = 0.05
    foot_position: float = 0.2
    root_pose: float = 0.15
    root_velocity: float = 0.1

    @property
    def weights(self) -> tuple[float, ...]:
        """Weights in the order of ``REWARD_TERMS``."""
        return (self.joint_position, self.joint_velocity, self.foot_position, self.root_pose, self.root_velocity)


@dataclass(frozen=True)
class ResetConfig:
    """How the initial state is drawn: half widths of uniform perturbations about the reference."""

    reference_probability: float = 0.9
    """Share of episodes that begin on the reference; the others begin standing where it is."""
    joint_position: float = 0.3
    """[rad]"""
    joint_velocity: float = 0.2
    """[rad/s]"""
    tilt: float = 0.05
    """Roll and pitch [rad]."""
    linear_velocity: float = 0.1
    """[m/s]"""
    angular_velocity: float = 0.2
    """[rad/s]"""


@dataclass(frozen=True)
class TerminationConfig:
    """When an episode fails."""

    max_distance: float = 1.0
    """Root from its reference [m]."""
    max_angle: float = 1.5708
    """Root orientation from its reference [rad]."""


@dataclass(frozen=True)
class SolverConfig:
    """MuJoCo Warp's constraint solver."""

    iterations: int = 5
    line_search_iterations: int = 8
    tolerance: float = 1e-6
    max_contacts: int = 24
    """Capacity of the contact buffer for each world."""
    max_constraints: int = 96
    """Capacity of the constraint buffer for each world."""
    friction: float = 0.8
    """Coefficient of friction between robot and floor."""


@dataclass(frozen=True)
class EnvConfig:
    """Settings of the imitation environment."""

    num_worlds: int = 8192
    seed: int = 1
    control_rate: float = 60.0
    """[Hz]"""
    substeps: int = 4
    """Physics steps in one control step; an even number."""
    episode_time: float = 20.0
    """Longest episode [s]."""
    history_length: int = 3
    """States in an observation, the present one included."""
    steps_ahead: tuple[int, ...] = (1, 2, 10, 30)
    """Future control steps whose reference is observed."""
    action: ActionConfig = field(default_factory=ActionConfig)
    motor: MotorConfig = field(default_factory=MotorConfig)
    reward: RewardConfig = field(default_factory=RewardConfig)
    reset: ResetConfig = field(default_factory=ResetConfig)
    termination: TerminationConfig = field(default_factory=TerminationConfig)
    solver: SolverConfig = field(default_factory=SolverConfig)

    def __post_init__(self) -> None:
        if self.num_worlds < 1 or self.control_rate <= 0.0 or self.episode_time <= 0.0 or self.history_length < 1:
            raise Kine2GoError("num_worlds, control_rate, episode_time and history_length must be positive")
        if self.substeps < 2 or self.substeps % 2:
            # Newton alternates between two states; an odd number would leave the result in the wrong one on replay.
            raise Kine2GoError(f"substeps is {self.substeps}; it must be an even number")

    @property
    def control_duration(self) -> float:
        """Duration of a control step [s]."""
        return 1.0 / self.control_rate

    @property
    def substep_duration(self) -> float:
        """Duration of a physics step [s]."""
        return self.control_duration / self.substeps

    @property
    def max_episode_length(self) -> int:
        """Longest episode [control steps]."""
        return round(self.episode_time * self.control_rate)

    @property
    def delay_substeps(self) -> int:
        """Action latency in physics substeps."""
        return round(self.action.latency / self.substep_duration)
