"""Named settings for training: the paper's table, minutes instead of hours, and those with domain randomisation."""

from dataclasses import dataclass, field, replace
from typing import Any

from kine2go_warp.env.config import (
    ActionConfig,
    EnvConfig,
    MotorConfig,
    PhaseSamplingConfig,
    RandomizationConfig,
    ResetConfig,
    TerminationConfig,
)
from kine2go_warp.errors import Kine2GoError


@dataclass(frozen=True)
class PpoConfig:
    """Settings of RSL-RL's PPO. Defaults are the paper's (appendix, hyperparameter table)."""

    iterations: int = 10_000
    steps_per_iteration: int = 24
    """Control steps of each world between two updates."""
    hidden_sizes: tuple[int, ...] = (512, 256, 128)
    activation: str = "elu"
    normalise_observations: bool = False
    initial_noise: float = 1.0
    """Standard deviation of the untrained policy's output."""
    learning_rate: float = 1e-3
    schedule: str = "adaptive"
    desired_kl: float = 0.01
    clip: float = 0.2
    entropy: float = 0.01
    final_entropy: float | None = None
    """Entropy coefficient after ``annealing`` iterations, to which it falls linearly; by default it stays."""
    final_noise: float | None = None
    """Greatest standard deviation after ``annealing`` iterations; the limit falls to it linearly from
    ``initial_noise``. By default there is none."""
    annealing: int = 120
    """[iterations]"""
    value_loss: float = 1.0
    max_gradient: float = 1.0
    epochs: int = 5
    mini_batches: int = 4
    symmetry: bool = False
    """Learn from each sample also mirrored, left for right."""
    discount: float = 0.99
    gae_lambda: float = 0.95
    save_interval: int = 100
    """Iterations between two checkpoints."""

    def runner_settings(self, seed: int, privileged: bool = False) -> dict[str, Any]:
        """Return the dictionary that RSL-RL's runner takes; ``privileged`` gives the critic its own observations."""
        network = {
            "class_name": "MLPModel",
            "hidden_dims": list(self.hidden_sizes),
            "activation": self.activation,
            "obs_normalization": self.normalise_observations,
        }
        noise = {"class_name": "GaussianDistribution", "init_std": self.initial_noise, "std_type": "scalar"}
        return {
            "seed": seed,
            "num_steps_per_env": self.steps_per_iteration,
            "save_interval": self.save_interval,
            "logger": "tensorboard",
            "check_for_nan": False,
            "obs_groups": {"actor": ["policy"], "critic": ["policy", "privileged"] if privileged else ["policy"]},
            "actor": {**network, "distribution_cfg": noise},
            "critic": dict(network),
            "algorithm": {
                "class_name": "PPO",
                "num_learning_epochs": self.epochs,
                "num_mini_batches": self.mini_batches,
                "clip_param": self.clip,
                "gamma": self.discount,
                "lam": self.gae_lambda,
                "value_loss_coef": self.value_loss,
                "use_clipped_value_loss": True,
                "entropy_coef": self.entropy,
                "learning_rate": self.learning_rate,
                "max_grad_norm": self.max_gradient,
                "schedule": self.schedule,
                "desired_kl": self.desired_kl,
                "rnd_cfg": None,
                "symmetry_cfg": self._symmetry() if self.symmetry else None,
            },
        }

    def _symmetry(self) -> dict[str, Any]:
        """Return RSL-RL's settings of the mirrored samples."""
        return {
            "use_data_augmentation": True,
            "use_mirror_loss": False,
            "mirror_loss_coeff": 0.0,
            "data_augmentation_func": "kine2go_warp.learning.symmetry:with_mirrored",
        }


@dataclass(frozen=True)
class Preset:
    """Environment and learner together."""

    env: EnvConfig = field(default_factory=EnvConfig)
    ppo: PpoConfig = field(default_factory=PpoConfig)


PAPER = Preset()

GENTLE_START = ResetConfig(reference_probability=1.0, joint_position=0.05)
"""Always on the reference, little perturbed."""

FAST = Preset(
    env=EnvConfig(
        num_worlds=256,
        episode_time=10.0,
        action=ActionConfig(form="reference"),
        motor=MotorConfig(stiffness=60.0, damping=2.0),
        reset=GENTLE_START,
        termination=TerminationConfig(max_distance=0.4, max_angle=1.0),
    ),
    ppo=PpoConfig(
        iterations=200,
        hidden_sizes=(256, 128, 64),
        normalise_observations=True,
        initial_noise=0.4,
        entropy=0.002,
        discount=0.97,
        desired_kl=0.03,
        save_interval=20,
    ),
)

ROBUST = replace(
    FAST,
    env=replace(
        FAST.env,
        randomization=RandomizationConfig(
            base_mass=(-0.5, 1.5),
            base_com=(-0.02, 0.02),
            friction=(0.5, 1.2),
            stiffness=(0.9, 1.1),
            damping=(0.9, 1.1),
            strength=(0.9, 1.1),
            motor_offset=(-0.02, 0.02),
            latency=(0.01, 0.03),
            push_interval=(3.0, 6.0),
            push_speed=(0.1, 0.5),
        ),
        phase_sampling=PhaseSamplingConfig(uniform_share=0.5),
        privileged=True,
    ),
)
"""``fast`` with everything drawn that differs between robots, a critic that sees it, and pushes."""

PRESETS = {"paper": PAPER, "fast": FAST, "robust": ROBUST}


def preset_named(name: str) -> Preset:
    """Return a preset.

    Raises:
        Kine2GoError: there is none of that name.
    """
    if name not in PRESETS:
        raise Kine2GoError(f"unknown preset '{name}'; known are: {', '.join(PRESETS)}")
    return PRESETS[name]
