"""Named settings for training: the paper's table, minutes instead of hours, and those with domain randomisation."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from kine2go_warp.env.config import (
    ActionConfig,
    EnvConfig,
    MotorConfig,
    PhaseSamplingConfig,
    ResetConfig,
)
from kine2go_warp.env.terms.base import with_term
from kine2go_warp.env.terms.observations import OBSERVATIONS, REFERENCE_OBSERVATIONS
from kine2go_warp.env.terms.randomization import randomized
from kine2go_warp.env.terms.terminations import with_limits
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.learning.stopping import StoppingConfig
from kine2go_warp.objects import load_object
from kine2go_warp.settings import check_ranges, override

Activation = Literal[
    "elu", "selu", "relu", "crelu", "lrelu", "tanh", "sigmoid", "softplus", "gelu", "swish", "mish", "identity"
]
"""Activation functions that RSL-RL knows."""

ALGORITHM_SETTINGS = (
    "num_learning_epochs",
    "num_mini_batches",
    "clip_param",
    "gamma",
    "lam",
    "value_loss_coef",
    "use_clipped_value_loss",
    "entropy_coef",
    "learning_rate",
    "max_grad_norm",
    "schedule",
    "desired_kl",
)
"""Those of ``PpoConfig`` that RSL-RL's algorithm takes."""

MIRRORED_SAMPLES = {
    "use_data_augmentation": True,
    "use_mirror_loss": False,
    "mirror_loss_coeff": 0.0,
    "data_augmentation_func": "kine2go_warp.learning.symmetry:with_mirrored",
}
"""RSL-RL's settings of ``PpoConfig.symmetry``."""


INFINITE = float("inf")


@dataclass(frozen=True)
class PpoConfig:
    """Settings of RSL-RL's PPO, under its own names. Defaults are the paper's (appendix, hyperparameter table)."""

    iterations: int = 10_000
    """Most iterations; fewer where ``stopping`` ends the training before."""
    num_steps_per_env: int = 24
    """Control steps of each world between two updates."""
    save_interval: int = 100
    """Iterations between two checkpoints."""
    hidden_dims: tuple[int, ...] = (512, 256, 128)
    """Layers of actor and critic."""
    activation: Activation = "elu"
    obs_normalization: bool = False
    """Normalise observations by their running mean and deviation."""
    init_std: float = 1.0
    """Standard deviation of the untrained policy's actions."""
    num_learning_epochs: int = 5
    """Passes over the samples of an iteration."""
    num_mini_batches: int = 4
    clip_param: float = 0.2
    gamma: float = 0.99
    """Discount of the reward, for each control step."""
    lam: float = 0.95
    """Lambda of the generalised advantage estimate."""
    value_loss_coef: float = 1.0
    use_clipped_value_loss: bool = True
    entropy_coef: float = 0.01
    learning_rate: float = 1e-3
    max_grad_norm: float = 1.0
    schedule: Literal["adaptive", "fixed"] = "adaptive"
    """``adaptive``: the learning rate follows ``desired_kl``."""
    desired_kl: float = 0.01
    """KL divergence of an update that ``adaptive`` aims at."""
    final_entropy_coef: float | None = None
    """Entropy coefficient after ``annealing_iterations``, reached linearly; by default it stays."""
    final_std: float | None = None
    """Greatest standard deviation after ``annealing_iterations``; the limit falls to it linearly from ``init_std``.
    By default there is none."""
    annealing_iterations: int = 120
    symmetry: bool = False
    """Learn from each sample also mirrored, left for right."""

    def __post_init__(self) -> None:
        if not self.hidden_dims:
            raise Kine2GoError("hidden_dims is empty; name the size of at least one layer")
        check_ranges(self, iterations=(1, 1e9), num_steps_per_env=(1, 1e6), save_interval=(1, INFINITE))
        check_ranges(self, hidden_dims=(1, 1e5), num_learning_epochs=(1, 1e4), num_mini_batches=(1, 1e6))
        check_ranges(self, gamma=(0, 1), lam=(0, 1), annealing_iterations=(1, INFINITE))
        positive = ("init_std", "clip_param", "learning_rate", "max_grad_norm", "desired_kl", "final_std")
        check_ranges(self, **dict.fromkeys(positive, (1e-12, INFINITE)))
        weights = ("value_loss_coef", "entropy_coef", "final_entropy_coef")
        check_ranges(self, **dict.fromkeys(weights, (0, INFINITE)))

    def runner_settings(self, seed: int, privileged: bool = False) -> dict[str, Any]:
        """Return the dictionary that RSL-RL's runner takes; ``privileged`` gives the critic its own observations."""
        values = asdict(self)
        network = {name: values[name] for name in ("activation", "obs_normalization")}
        network |= {"class_name": "MLPModel", "hidden_dims": list(self.hidden_dims)}
        noise = {"class_name": "GaussianDistribution", "init_std": self.init_std, "std_type": "scalar"}
        symmetry = {**MIRRORED_SAMPLES} if self.symmetry else None
        return {
            "seed": seed,
            "num_steps_per_env": self.num_steps_per_env,
            "save_interval": self.save_interval,
            "logger": "tensorboard",
            "check_for_nan": False,
            "obs_groups": {"actor": ["policy"], "critic": ["policy", "privileged"] if privileged else ["policy"]},
            "actor": {**network, "distribution_cfg": noise},
            "critic": network,
            "algorithm": {
                "class_name": "PPO",
                **{name: values[name] for name in ALGORITHM_SETTINGS},
                "rnd_cfg": None,
                "symmetry_cfg": symmetry,
            },
        }


@dataclass(frozen=True)
class Preset:
    """All settings of a training: environment, learner, when it stops, and what it begins with."""

    preset: str = "paper"
    """Name of the preset that the settings began with: fast, paper, robust, generalist, finetune,
    no_state_estimation, or FILE.py:NAME for one of your own."""
    env: EnvConfig = field(default_factory=EnvConfig)
    ppo: PpoConfig = field(default_factory=PpoConfig)
    stopping: StoppingConfig = field(default_factory=StoppingConfig)
    initial_policy: str = ""
    """Policy folder whose networks training begins with, instead of new ones. They keep their size, whatever ``ppo``
    says, and must observe the same."""

    def override(self, values: dict[str, Any]) -> "Preset":
        """Return the preset with some settings replaced by their path, such as ``{"ppo.entropy_coef": 0.01}``.

        Raises:
            Kine2GoError: there is no such setting, or its value is wrong.
        """
        return override(self, values, self.preset)

    def on(self, device: str) -> "Preset":
        """Return the preset with the number of worlds chosen for a device, such as ``cpu``, where it is left open."""
        return replace(self, env=self.env.on(device))


PAPER = Preset("paper")

GENTLE_START = ResetConfig(reference_probability=1.0, joint_position=0.05)
"""Always on the reference, little perturbed."""

FAST = Preset(
    "fast",
    env=EnvConfig(
        num_worlds=0,
        episode_time=10.0,
        action=ActionConfig(mode="residual_ff"),
        motor=MotorConfig(stiffness=60.0, damping=2.0, friction=1.0),
        reset=GENTLE_START,
        terminations=with_limits(0.4, 1.0),
    ),
    ppo=PpoConfig(
        iterations=600,
        hidden_dims=(256, 128, 64),
        obs_normalization=True,
        init_std=0.4,
        entropy_coef=0.002,
        gamma=0.97,
        desired_kl=0.03,
        save_interval=20,
    ),
    stopping=StoppingConfig(interval=20),
)

ROBUST = replace(
    FAST,
    preset="robust",
    env=replace(
        FAST.env,
        randomization=randomized(
            base_mass=(-0.5, 1.5),
            base_com=(-0.02, 0.02),
            friction=(0.5, 1.2),
            stiffness=(0.9, 1.1),
            damping=(0.9, 1.1),
            strength=(0.9, 1.1),
            motor_offset=(-0.02, 0.02),
            joint_friction=(0.6, 1.4),
            latency=(0.01, 0.03),
            push_interval=(3.0, 6.0),
            push_speed=(0.1, 0.5),
        ),
        phase_sampling=PhaseSamplingConfig(uniform_share=0.5),
        privileged=True,
    ),
)
"""``fast`` with everything drawn that differs between robots, a critic that sees it, and pushes."""

NO_STATE_ESTIMATION = replace(
    FAST,
    preset="no_state_estimation",
    env=replace(
        FAST.env,
        observations=with_term(OBSERVATIONS, "linear_velocity_b", enabled=False),
        reference_observations=with_term(REFERENCE_OBSERVATIONS, "reference_position_h", enabled=False),
        privileged=True,
    ),
)
"""``fast`` without what a robot does not measure: where its base is and how fast it moves.

The critic, which only training needs, sees the velocity and the height.
"""

GENERALIST = replace(
    FAST,
    preset="generalist",
    env=replace(FAST.env, phase_sampling=PhaseSamplingConfig(uniform_share=0.5)),
    ppo=replace(FAST.ppo, iterations=1500, hidden_dims=(512, 256, 128), save_interval=50),
    stopping=replace(FAST.stopping, interval=100),
)
"""``fast`` for one policy of many clips: larger networks, and half of the episodes begin where clips are lost."""

FINETUNE = replace(
    FAST,
    preset="finetune",
    ppo=replace(FAST.ppo, iterations=200, learning_rate=1e-4, desired_kl=0.01),
    stopping=replace(FAST.stopping, interval=10),
)
"""``fast`` for a training that begins with another policy (``initial_policy``): small steps.

The first steps of a new optimiser are as large as the learning rate for every weight; those of ``fast`` undo what the
policy knows.
"""

PRESETS = {one.preset: one for one in (PAPER, FAST, ROBUST, GENERALIST, FINETUNE, NO_STATE_ESTIMATION)}


def find_preset(name: str) -> Preset:
    """Return a preset: one of ours by its name, or ``FILE.py:NAME``, which runs the file and takes that name from it.

    Raises:
        Kine2GoError: there is none of that name, or the file cannot be run.
    """
    if name in PRESETS:
        return PRESETS[name]
    file, colon, attribute = name.rpartition(":")
    if not colon or not file.endswith(".py"):
        raise Kine2GoError(f"unknown preset '{name}'; known are: {', '.join(PRESETS)}; your own is FILE.py:NAME")
    found = load_object(name)
    if not isinstance(found, Preset):
        raise Kine2GoError(f"{file}: '{attribute}' is no Preset")
    return replace(found, preset=f"{Path(file).resolve()}:{attribute}")


def base_preset(
    section: Any,
    where: str,
    error: type[Kine2GoError] = Kine2GoError,
    locate: Callable[[str], str] = lambda _: "",
) -> Preset:
    """Return the preset that the section ``train`` of a file names, ``fast`` if it names none.

    Args:
        section: What the file holds there, which may be anything.
        where: Name of the file.
        error: Type of error to raise.
        locate: Returns what the message adds to ``where`` for a key.

    Raises:
        Kine2GoError: there is no preset of that name.
    """
    name = section.get("preset", FAST.preset) if isinstance(section, dict) else FAST.preset
    try:
        return find_preset(name) if isinstance(name, str) else FAST
    except Kine2GoError as problem:
        raise error(f"{where}{locate('train.preset')}: {problem}") from None
