"""Choices of training, each one change of the preset ``fast``, to be compared at the same number of steps.

Nothing heavy is imported here: the command line reads it.
"""

from dataclasses import dataclass
from typing import Any

from kine2go_warp.learning.presets import FAST, Preset


@dataclass(frozen=True)
class Choice:
    """One change of the settings."""

    name: str
    meaning: str
    """What is changed, for the table."""
    values: tuple[tuple[str, Any], ...] = ()
    """Settings by their path in ``Preset``, such as ``env.motor.stiffness``, and their values."""

    def apply(self, preset: Preset) -> Preset:
        """Return the preset with the change."""
        return preset.override(dict(self.values))


CHOICES = (
    Choice("fast", "the preset `fast` as it is"),
    Choice(
        "default_pose",
        "joint target = default pose + output (paper), instead of a residual on the reference",
        (("env.action.mode", "default_offset"),),
    ),
    Choice("no_feed_forward", "the reference's velocity is not fed forward", (("env.action.mode", "residual"),)),
    Choice("symmetry", "each sample also mirrored, left for right", (("ppo.symmetry", True),)),
    Choice(
        "weighted_phases",
        "half of the episodes begin where failures are frequent",
        (("env.phase_sampling.uniform_share", 0.5),),
    ),
    Choice(
        "tight_ends",
        "episodes end at 0.2 m or 0.5 rad, instead of 0.4 m or 1 rad",
        (("env.termination.max_distance", 0.2), ("env.termination.max_angle", 0.5)),
    ),
    Choice(
        "loose_ends",
        "episodes end at 1 m or 1.57 rad (paper)",
        (("env.termination.max_distance", 1.0), ("env.termination.max_angle", 1.5708)),
    ),
    Choice(
        "paper_gains",
        "gains 30 N m/rad and 1.5 N m s/rad (paper's release), instead of 60 and 2",
        (("env.motor.stiffness", 30.0), ("env.motor.damping", 1.5)),
    ),
    Choice(
        "many_worlds",
        "512 worlds and half as many updates, instead of 256",
        (("env.num_worlds", 512),),
    ),
    Choice(
        "few_worlds",
        "128 worlds and twice as many updates, instead of 256",
        (("env.num_worlds", 128),),
    ),
    Choice("many_epochs", "8 passes over the samples of an iteration, instead of 5", (("ppo.num_learning_epochs", 8),)),
    Choice(
        "action_rate",
        "the squared change of the outputs costs 0.02 (times 1/60) of the reward",
        (("env.rewards.action_rate.weight", -0.02),),
    ),
    Choice(
        "tightening",
        "episodes end at 0.8 m or 2 rad at first, and after 40 iterations at 0.2 m or 0.5 rad",
        (
            ("env.termination.max_distance", 0.2),
            ("env.termination.max_angle", 0.5),
            ("env.termination.initial_limit_scale", 4.0),
            ("env.termination.limit_anneal_time", 16.0),
        ),
    ),
    Choice(
        "falling_noise",
        "the noise falls from 0.4 to 0.2 within 40 iterations",
        (("ppo.final_std", 0.2), ("ppo.annealing_iterations", 40)),
    ),
    Choice(
        "falling_entropy",
        "the entropy coefficient falls from 0.01 (paper) to 0 within 40 iterations",
        (("ppo.entropy_coef", 0.01), ("ppo.final_entropy_coef", 0.0), ("ppo.annealing_iterations", 40)),
    ),
    Choice("small_noise", "initial noise 0.2, instead of 0.4", (("ppo.init_std", 0.2),)),
    Choice("paper_noise", "initial noise 1.0 (paper)", (("ppo.init_std", 1.0),)),
    Choice("paper_discount", "discount 0.99 (paper), instead of 0.97", (("ppo.gamma", 0.99),)),
    Choice("paper_kl", "desired KL divergence 0.01 (paper), instead of 0.03", (("ppo.desired_kl", 0.01),)),
    Choice("paper_entropy", "entropy coefficient 0.01 (paper), instead of 0.002", (("ppo.entropy_coef", 0.01),)),
    Choice("raw_observations", "observations are not normalised (paper)", (("ppo.obs_normalization", False),)),
    Choice(
        "paper_beginnings",
        "a tenth of the episodes begins standing, joints off by up to 0.3 rad (paper)",
        (("env.reset.reference_probability", 0.9), ("env.reset.joint_position", 0.3)),
    ),
    Choice(
        "soft_gains",
        "gains 20 N m/rad and 0.5 N m s/rad (Unitree's own examples of learning)",
        (("env.motor.stiffness", 20.0), ("env.motor.damping", 0.5)),
    ),
    Choice(
        "paper_network", "layers of 512, 256, 128 (paper), instead of half", (("ppo.hidden_dims", (512, 256, 128)),)
    ),
)


@dataclass(frozen=True)
class AblationConfig:
    """Settings of an ablation."""

    steps: int = 245_760
    """Environment steps of each training."""
    seeds: int = 3
    """Trainings of each choice and clip, with the seeds 1, 2, ..."""
    rollouts: int = 16
    """Rollouts of each policy with and without noise, each."""

    def preset(self, choice: Choice, seed: int) -> Preset:
        """Return the settings of one training."""
        preset = choice.apply(FAST.on("cpu"))
        steps = preset.env.num_worlds * preset.ppo.num_steps_per_env
        iterations = max(1, round(self.steps / steps))
        return preset.override({"env.seed": seed, "ppo.iterations": iterations})
