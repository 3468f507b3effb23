"""Settings of the gathering stage."""

from dataclasses import dataclass, replace

from kine2go_warp.env.config import EnvConfig, ResetConfig, TerminationConfig
from kine2go_warp.errors import DatasetError


@dataclass(frozen=True)
class GatherConfig:
    """Settings of the gathering stage."""

    trajectories: int = 20
    """Rollouts to run."""
    rows: int | None = None
    """Rows of a trajectory after the trim; by default those of the paper's table, 571 for other motions."""
    warm_up: float = 0.5
    """Dropped from the beginning of each rollout, where the policy gets in step with the reference [s]."""
    noise: float = 1.0
    """Noise on the actions, in standard deviations of the policy."""
    seed: int = 1
    max_distance: float = 0.5
    """A rollout whose root is ever farther than this from its reference is rejected [m]."""
    max_angle: float = 0.8
    """A rollout whose root is ever turned further than this from its reference is rejected [rad]."""
    max_joint_rmse: float = 0.25
    """A rollout whose joints track worse than this is rejected [rad]."""

    def __post_init__(self) -> None:
        if self.trajectories < 1 or (self.rows is not None and self.rows < 2):
            raise DatasetError("trajectories must be at least 1 and rows at least 2")
        if self.noise < 0.0 or self.warm_up < 0.0 or self.seed < 0:
            raise DatasetError("noise, warm-up and seed must not be negative")

    def environment(self, trained: EnvConfig, rows: int) -> EnvConfig:
        """Return the environment to gather in: that of the training, with the limits of a good rollout."""
        time = self.warm_up + (rows + 2) / trained.control_rate
        return replace(
            trained,
            num_worlds=self.trajectories,
            seed=self.seed,
            episode_time=time,
            reset=ResetConfig(reference_probability=1.0, joint_position=0.05),
            termination=TerminationConfig(self.max_distance, self.max_angle),
        )
