"""When a training ends: once the policy tracks, judged by evaluations of its mean action while it learns."""

import math
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from kine2go_warp.settings import check_ranges

if TYPE_CHECKING:
    import torch

TARGETS, BUDGET, DIVERGED = "targets reached", "budget", "diverged"
"""Why a training has stopped."""
ERRORS = ("joint_rmse", "root_error", "foot_slip")
"""Metrics of an evaluation that are no shares."""


@dataclass(frozen=True)
class StoppingConfig:
    """Early stopping: training ends before ``ppo.iterations`` when the targets are met, and keeps the best policy.

    The limits of the rollouts are the defaults of ``GatherConfig``: what its filter would reject does not track.
    """

    interval: int = 0
    """Iterations between two evaluations; 0 evaluates nothing and always runs ``ppo.iterations``."""
    consecutive: int = 2
    """Evaluations in a row that must meet the targets."""
    rollouts: int = 16
    """Rollouts of an evaluation, at least two a clip: a quarter from the clip's first frame, the others from phases
    spread over the cycle. Each target must be met by both groups, of every clip."""
    seconds: float = 10.0
    """Length of a rollout [s]."""
    min_acceptance: float = 0.95
    """Smallest share of rollouts that survive and pass the filter of gathering."""
    max_joint_rmse: float = 0.03
    """Largest mean of the rollouts' joint RMSE [rad]."""
    max_root_error: float = 0.04
    """Largest mean distance of the root from its reference [m]."""

    def __post_init__(self) -> None:
        check_ranges(self, interval=(0, 1e9), consecutive=(1, 1e6), rollouts=(2, 1e6), seconds=(0.1, 3600))
        check_ranges(self, min_acceptance=(0, 1), max_joint_rmse=(1e-9, math.inf), max_root_error=(1e-9, math.inf))

    def is_active(self, iterations: int) -> bool:
        """Return whether a training of at most so many iterations is evaluated at all."""
        return 0 < self.interval <= iterations


@dataclass(frozen=True)
class TrackingMetrics:
    """Means over the rollouts of a clip; the worst of them where a policy tracks several clips."""

    survival: float
    """Share of rollouts that stay within the filter's distance and angle of the reference to their end."""
    acceptance: float
    """Share of rollouts that also pass the filter's other limits."""
    joint_rmse: float
    """[rad]"""
    root_error: float
    """[m]"""
    foot_slip: float
    """[m/s]"""

    @classmethod
    def worst(cls, clips: list["TrackingMetrics"]) -> "TrackingMetrics":
        """Return the worst value of each metric."""
        shares = (min(one.survival for one in clips), min(one.acceptance for one in clips))
        errors = (max(getattr(one, name) for one in clips) for name in ERRORS)
        return cls(*shares, *errors)


@dataclass(frozen=True)
class ClipEvaluation:
    """How well the mean action of a policy tracks a clip."""

    phases: TrackingMetrics
    """Rollouts from phases spread over the cycle."""
    first_frame: TrackingMetrics
    """Rollouts from the first frame of the clip."""

    @property
    def survival(self) -> float:
        """The smaller share of survivors of both."""
        return min(self.phases.survival, self.first_frame.survival)

    @property
    def acceptance(self) -> float:
        """The smaller share of accepted rollouts of both."""
        return min(self.phases.acceptance, self.first_frame.acceptance)

    def excess(self, config: StoppingConfig) -> float:
        """Return the largest error over its target, 1 where all are within theirs or at them."""
        ratios = [
            ratio
            for one in (self.phases, self.first_frame)
            for ratio in (one.joint_rmse / config.max_joint_rmse, one.root_error / config.max_root_error)
        ]
        return max(float(np.max(ratios)), 1.0) if np.isfinite(ratios).all() else math.inf

    def meets(self, config: StoppingConfig) -> bool:
        """Return whether it meets the targets."""
        return self.acceptance >= config.min_acceptance and self.excess(config) <= 1.0


@dataclass(frozen=True)
class Evaluation:
    """How well the mean action of a policy tracks its clips."""

    iteration: int
    """Iterations that the policy had learned for."""
    clips: dict[str, ClipEvaluation]
    """By the clip's name."""
    rejected: str = ""
    """Number of rollouts by the reason why the filter of gathering would reject them, in words."""

    @property
    def phases(self) -> TrackingMetrics:
        """The worst clip's value of each metric, over rollouts from phases spread over the cycle."""
        return TrackingMetrics.worst([one.phases for one in self.clips.values()])

    @property
    def first_frame(self) -> TrackingMetrics:
        """The same over rollouts from the first frame."""
        return TrackingMetrics.worst([one.first_frame for one in self.clips.values()])

    def mean(self, share: str) -> float:
        """Return the mean over the clips of ``survival`` or ``acceptance``."""
        return float(np.mean([getattr(one, share) for one in self.clips.values()]))

    def __str__(self) -> str:
        rejected = f" ({self.rejected})" if self.rejected else ""
        if len(self.clips) > 1:
            whole = sum(one.survival == 1.0 for one in self.clips.values())
            survival, acceptance = (100.0 * self.mean(share) for share in ("survival", "acceptance"))
            return (
                f"{whole} of {len(self.clips)} clips survive in every rollout, mean survival {survival:.0f} %, "
                f"mean acceptance {acceptance:.0f} %{rejected}"
            )
        phases, zero = self.phases, self.first_frame
        return (
            f"{100.0 * min(phases.acceptance, zero.acceptance):.0f} % accepted{rejected}, joint RMSE "
            f"{phases.joint_rmse:.3f} rad, root {100.0 * phases.root_error:.1f} cm, from the first frame "
            f"{zero.joint_rmse:.3f} rad, {100.0 * zero.root_error:.1f} cm"
        )

    @property
    def curves(self) -> dict[str, float]:
        """Metrics by ``group/name``: each metric's worst clip, and the share of clips whose rollouts all survive."""
        return {
            f"{'evaluation' if name in ERRORS else 'evaluation_shares'}/{prefix}{name}": value
            for prefix, one in (("", self.phases), ("first_frame_", self.first_frame))
            for name, value in asdict(one).items()
        } | {"evaluation_shares/clips": float(np.mean([one.survival == 1.0 for one in self.clips.values()]))}

    def described(self) -> dict[str, Any]:
        """Return it as JSON values, without metrics that are not finite."""
        groups = {"phases": asdict(self.phases), "first_frame": asdict(self.first_frame)}
        finite = {
            group: {name: value for name, value in one.items() if math.isfinite(value)} for group, one in groups.items()
        }
        return {"iteration": self.iteration, "rejected": self.rejected, **finite}

    def rank(self, config: StoppingConfig) -> tuple[float, float, float]:
        """Return what a better policy has more of: acceptance, then survival, then nearness to the targets.

        Means over the clips: of many, some may always be lost. Policies within the targets are equal in the last: of
        these a later one has less noise.
        """
        nearness = float(np.mean([1.0 / one.excess(config) for one in self.clips.values()]))
        return self.mean("acceptance"), self.mean("survival"), nearness

    def meets(self, config: StoppingConfig) -> bool:
        """Return whether every clip meets the targets."""
        return all(one.meets(config) for one in self.clips.values())


@dataclass
class TargetWatch:
    """Looks at each evaluation, remembers the best policy and says when to stop. A checkpoint holds its state."""

    config: StoppingConfig
    met: int = 0
    """Evaluations in a row that met the targets."""
    latest: Evaluation | None = None
    best: Evaluation | None = None
    best_weights: "dict[str, torch.Tensor]" = field(default_factory=dict)
    """Those of the actor, on the CPU."""
    final: Evaluation | None = None
    """An evaluation at the end of the budget that is none of those at each interval; a longer training has none here,
    so this one changes nothing else."""

    @property
    def is_reached(self) -> bool:
        """Whether to stop."""
        return self.met >= self.config.consecutive

    @property
    def kept(self) -> Evaluation | None:
        """The evaluation of the policy that acts."""
        return self.final if self.keeps_final else self.best

    @property
    def keeps_final(self) -> bool:
        """Whether the policy of the end acts, although it was evaluated between two intervals."""
        best, final = self.best, self.final
        return final is not None and (best is None or final.rank(self.config) >= best.rank(self.config))

    def look(self, evaluation: Evaluation, actor: "torch.nn.Module") -> None:
        """Take in an evaluation of a policy."""
        if evaluation.iteration % self.config.interval:
            self.final = evaluation
            return
        self.latest = evaluation
        self.met = self.met + 1 if evaluation.meets(self.config) else 0
        if self.best is None or evaluation.rank(self.config) >= self.best.rank(self.config):
            self.best = evaluation
            self.best_weights = {name: value.detach().cpu().clone() for name, value in actor.state_dict().items()}

    def state(self) -> dict[str, Any]:
        """Return what training goes on from."""
        known = {"latest": self.latest, "best": self.best}
        found = {name: asdict(one) for name, one in known.items() if one is not None}
        return {"met": self.met, **found, "best_weights": self.best_weights}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on where ``state`` was taken."""
        self.met, self.best_weights = state["met"], state["best_weights"]
        self.latest, self.best = (stored_evaluation(state.get(name)) for name in ("latest", "best"))

    def policy_weights(self) -> dict[str, Any]:
        """Return what a checkpoint says of the weights that act, nothing if they are those of the last iteration."""
        return {} if self.best is None or self.keeps_final else {"policy_state_dict": self.best_weights}


def stored_evaluation(values: dict[str, Any] | None) -> Evaluation | None:
    """Return an evaluation that was stored with ``asdict``, none if there is none.

    Those made before clips were told apart are of one clip, whose name is not in them.
    """
    if not values:
        return None
    clips = values.get("clips") or {"": values}
    stored = {
        name: ClipEvaluation(TrackingMetrics(**one["phases"]), TrackingMetrics(**one["first_frame"]))
        for name, one in clips.items()
    }
    return Evaluation(values["iteration"], stored, values["rejected"])
