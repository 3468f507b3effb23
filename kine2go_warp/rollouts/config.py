"""Settings of the gathering stage, and the environment that policies are rolled out in."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from kine2go_warp.env.config import EnvConfig, PhaseSamplingConfig, ResetConfig
from kine2go_warp.env.terms.randomization import RandomizationTerm, active, check_randomization, randomized
from kine2go_warp.env.terms.terminations import TRACKING, with_limits
from kine2go_warp.errors import DatasetError
from kine2go_warp.rollouts.diversity import DiversitySettings
from kine2go_warp.settings import check_ranges

ProgressCallback = Callable[[int, int, str], None]
"""Called with what is done, the total, and details in words."""

CPU_WORLDS, CUDA_WORLDS = 128, 4096
"""Most rollouts run at once where ``num_worlds`` is not set."""

MILD = randomized(base_mass=(-0.3, 0.7), friction=(0.6, 1.0), push_interval=(3.0, 6.0), push_speed=(0.0, 0.2))
"""What differs between rollouts by default: little enough for a policy that was trained without it."""


@dataclass(frozen=True)
class GatherConfig:
    """Settings of the gathering stage."""

    trajectories: int = 20
    """Rollouts wanted; only those that the filter accepts count."""
    rows: int | None = None
    """Rows of a trajectory after the trim; by default those of the paper's table, 571 for other cycles, and all of a
    motion that is played once."""
    warm_up: float = 0.5
    """Dropped from the beginning of each rollout, where the policy gets in step with the reference, or with the first
    pose of a motion that is played once [s]."""
    action_noise_scale: tuple[float, float] = (0.5, 1.0)
    """Noise on the actions, in standard deviations of the policy, drawn for each rollout from this range."""
    seed: int = 1
    num_worlds: int | None = None
    """Rollouts run at once; by default as many as are wanted, at most 128 on a CPU and 4096 on a GPU."""
    max_attempts: float = 4.0
    """Most rollouts run, as a multiple of those wanted; then those that were accepted are kept."""
    min_acceptance: float = 0.5
    """Share of the wanted rollouts that must be accepted within ``max_attempts``, or none are kept."""
    keep_rejected: bool = False
    """Store rejected rollouts, too, in a group of their own."""
    until_fall: bool = False
    """Let rollouts that leave the reference go on until they fall or are full, and store them as rejected ones."""
    observations: bool = False
    """Store what the policy saw in each row, too."""
    max_distance: float = 0.4
    """Largest distance of the root from its reference at any time [m]."""
    max_angle: float = 0.5
    """Largest angle of the root from its reference at any time [rad]."""
    max_joint_rmse: float = 0.12
    """Largest root mean square of the joint position error [rad]."""
    max_leg_contact: float = 0.2
    """Largest share of rows in which a thigh or calf touches the ground, but for where the reference does."""
    max_joint_limit: float = 0.05
    """Largest share of joint positions at a limit of the joint."""
    max_torque_saturation: float = 0.05
    """Largest share of joint torques at the motor's limit."""
    max_action_saturation: float = 0.1
    """Largest share of joint targets beyond the limits of the joint."""
    max_foot_slip: float = 0.3
    """Largest mean horizontal speed of feet that bear weight [m/s]."""
    max_joint_jerk: float = 20_000.0
    """Largest mean size of the joints' jerk [rad/s^3]."""
    max_joint_speed: float = 1.0
    """Largest joint speed as a share of the motor's largest."""
    max_leg_overlap: float = 0.01
    """Greatest depth of a leg in another one, the trunk or the head [m]."""
    randomization: tuple[RandomizationTerm, ...] = MILD
    """What differs between the rollouts."""
    diversity: DiversitySettings = field(default_factory=DiversitySettings)
    """What else differs, on purpose."""

    def __post_init__(self) -> None:
        check_ranges(
            self,
            trajectories=(1, 1e6),
            rows=(2, 1e7),
            warm_up=(0, 1e4),
            action_noise_scale=(0, 100),
            seed=(0, 2**31 - 1),
            num_worlds=(1, 1e6),
            max_attempts=(1, 1e6),
            min_acceptance=(0, 1),
            **{name: (1e-9, math.inf) for name in vars(self) if name.startswith("max_") and name != "max_attempts"},
        )
        lowest, highest = self.action_noise_scale
        if lowest > highest:
            raise DatasetError(f"action_noise_scale is {[lowest, highest]}; the first must not be above the second")
        check_randomization(self.randomization)

    def worlds(self, device: str) -> int:
        """Return how many rollouts to run at once."""
        most = CPU_WORLDS if device == "cpu" else CUDA_WORLDS
        return self.num_worlds or min(self.trajectories, most)

    def environment(self, trained: EnvConfig, rows: int, num_worlds: int) -> EnvConfig:
        """Return the environment to gather in: that of the training, with the limits of a good rollout."""
        time = self.warm_up + (rows + 2) / trained.control_rate
        diversity = self.diversity.resolved()
        scale, speed = diversity.recovery_limit_scale or 1.0, diversity.hard_push_speed
        limits = (scale * self.max_distance, scale * self.max_angle)
        drawn = self.randomization
        if speed is not None and active(drawn, "push_speed"):
            drawn = randomized(drawn, push_speed=speed)
        config = rollout_environment(trained, num_worlds, self.seed, time, limits, drawn)
        if not self.until_fall:
            return config
        terms = tuple(replace(one, enabled=one.enabled and one.name not in TRACKING) for one in config.terminations)
        return replace(config, terminations=terms)

    @property
    def stores_rejected(self) -> bool:
        """Whether rejected rollouts are stored."""
        return self.keep_rejected or self.until_fall


def rollout_environment(
    trained: EnvConfig,
    num_worlds: int,
    seed: int,
    episode_time: float,
    limits: tuple[float, float],
    randomization: tuple[RandomizationTerm, ...],
) -> EnvConfig:
    """Return the environment to roll a policy out in: that of its training, but for what is given and the resets.

    Every episode begins on the reference, joints off by up to 0.05 rad.

    Args:
        trained: The environment of the training.
        num_worlds: Rollouts that run at once.
        seed: Seed of the worlds.
        episode_time: Longer than a rollout, so that no rollout ends by its time [s].
        limits: Largest distance [m] and angle [rad] of the root from its reference.
        randomization: What differs between the rollouts.
    """
    return replace(
        trained,
        num_worlds=num_worlds,
        seed=seed,
        episode_time=episode_time,
        end_hold=episode_time,
        reset=ResetConfig(reference_probability=1.0, joint_position=0.05),
        terminations=with_limits(*limits, trained.terminations),
        initial_limit_scale=1.0,
        randomization=randomization,
        phase_sampling=PhaseSamplingConfig(),
        privileged=False,
    )
