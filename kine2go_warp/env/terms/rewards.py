"""Reward terms. Their weighted values add up to the reward."""

from dataclasses import dataclass

from kine2go_warp.env.terms.base import Term

_KERNELS = "kine2go_warp.kernels.rewards"


@dataclass(frozen=True)
class RewardTerm(Term):
    """One summand of the reward. Its kernel writes the value before the weight."""

    weight: float = 1.0
    """Factor; it is divided by the control rate, which gives the paper's scales. A term of weight 0 is left out."""
    maximum: float | None = None
    """Largest value before the weight; the least is 0. By default not known."""
    formula: str = ""
    """The value before the weight, with the parameters in braces; a hat marks the reference."""

    @property
    def formula_text(self) -> str:
        """The formula with the values of the parameters."""
        return self.formula.format(**{name: f"{value:g}" for name, value in self.params})


REWARDS = (
    RewardTerm(
        "joint_position",
        f"{_KERNELS}:track_joint_position",
        (("exponent", 5.0),),
        weight=0.5,
        maximum=1.0,
        formula="exp(-{exponent} Σ (q - q̂)²) over 12 joints [rad]",
    ),
    RewardTerm(
        "joint_velocity",
        f"{_KERNELS}:track_joint_velocity",
        (("exponent", 0.1),),
        weight=0.05,
        maximum=1.0,
        formula="exp(-{exponent} Σ (q̇ - q̇̂)²) over 12 joints [rad/s]",
    ),
    RewardTerm(
        "foot_position",
        f"{_KERNELS}:track_foot_position",
        (("exponent", 40.0),),
        weight=0.2,
        maximum=1.0,
        formula="exp(-{exponent} Σ \\|p - p̂\\|²) over 4 feet relative to the root, each in its own heading frame [m]",
    ),
    RewardTerm(
        "root_pose",
        f"{_KERNELS}:track_root_pose",
        (("position_exponent", 20.0), ("angle_exponent", 10.0)),
        weight=0.15,
        maximum=2.0,
        formula="exp(-{position_exponent} \\|p - p̂\\|²) + exp(-{angle_exponent} θ²), root position [m] and angle of "
        "the rotation between the two roots [rad]",
    ),
    RewardTerm(
        "root_velocity",
        f"{_KERNELS}:track_root_velocity",
        (("linear_exponent", 2.0), ("angular_exponent", 0.2)),
        weight=0.1,
        maximum=2.0,
        formula="exp(-{linear_exponent} \\|v - v̂\\|²) + exp(-{angular_exponent} \\|ω - ω̂\\|²), root velocities in the "
        "world frame [m/s, rad/s]",
    ),
    RewardTerm(
        "action_rate",
        f"{_KERNELS}:action_rate",
        weight=0.0,
        formula="Σ (a - a')² over 12 joints, a' being the action of the step before; a penalty if its weight is "
        "negative",
    ),
)
"""The paper's tracking rewards (appendix, "Reward structure"), and a penalty that no preset uses."""
