"""Settings of the environment. Defaults are the paper's (appendix, hyperparameter table), with one exception.

The table perturbs the base's initial position by 1 m, which is as far as an episode may stray before it ends; the base
begins at its reference here.
"""

from dataclasses import dataclass, field, replace
from typing import Literal

from kine2go_warp.env.terms.base import check_names
from kine2go_warp.env.terms.observations import (
    OBSERVATIONS,
    PRIVILEGED_OBSERVATIONS,
    REFERENCE_OBSERVATIONS,
    ObservationTerm,
)
from kine2go_warp.env.terms.randomization import RANDOMIZATION, RandomizationTerm, active, check_randomization
from kine2go_warp.env.terms.rewards import REWARDS, RewardTerm
from kine2go_warp.env.terms.terminations import TERMINATIONS, TerminationTerm
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.robots import MotorLimits, RobotSpec
from kine2go_warp.settings import check_ranges

CPU_WORLDS, CUDA_WORLDS = 256, 4096
"""Worlds where the settings leave their number to the device."""

INFINITE = float("inf")


@dataclass(frozen=True)
class ActionConfig:
    """How the policy's action becomes a joint target."""

    mode: Literal["default_offset", "residual_ff", "residual", "absolute"] = "default_offset"
    """``default_offset``: default pose + scale * action (the paper). ``residual_ff``: the coming reference with its
    velocity fed forward + scale * action; ``residual``: without the velocity. ``absolute``: the action itself, in
    radians. The recorded action means the same in all."""
    scale: float = 0.25
    """Radians for an action of 1."""
    clip: float = 100.0
    """Actions are clipped to this magnitude."""
    latency: float = 0.02
    """Time from an action to its effect at the motors, rounded to physics substeps [s]."""

    def __post_init__(self) -> None:
        check_ranges(self, scale=(1e-9, INFINITE), clip=(1e-9, INFINITE), latency=(0, 1))


@dataclass(frozen=True)
class MotorConfig:
    """The motors' PD law."""

    stiffness: float = 30.0
    """Of the Go2's motors; another robot's have ``RobotSpec.stiffness_factor`` times as much [N m/rad]."""
    damping: float = 1.5
    """The same with ``damping_factor`` [N m s/rad]."""
    torque_speed: bool = True
    """Torques end where the motors' do at the joint's speed. Without it the URDF's limits hold at any speed."""
    friction: float = 0.0
    """Coulomb friction of the joints, as a multiple of what was measured on the robot; the paper has none."""

    def gains(self, spec: RobotSpec) -> tuple[float, float]:
        """Return stiffness [N m/rad] and damping [N m s/rad] of a robot's motors."""
        return spec.stiffness_factor * self.stiffness, spec.damping_factor * self.damping

    def limits(self, spec: RobotSpec) -> MotorLimits:
        """Return the largest torques of a robot's motors."""
        return spec.motor_limits if self.torque_speed else MotorLimits.constant(spec.joint_effort)

    def joint_friction(self, spec: RobotSpec) -> tuple[float, ...]:
        """Return the friction of a robot's joints [N m], shape [12]."""
        return tuple(self.friction * torque for torque in spec.joint_friction)

    def __post_init__(self) -> None:
        check_ranges(self, stiffness=(0, INFINITE), damping=(0, INFINITE), friction=(0, INFINITE))


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

    def __post_init__(self) -> None:
        widths = ("joint_position", "joint_velocity", "tilt", "linear_velocity", "angular_velocity")
        check_ranges(self, reference_probability=(0, 1), **dict.fromkeys(widths, (0, INFINITE)))


@dataclass(frozen=True)
class PhaseSamplingConfig:
    """Where in a clip episodes begin: everywhere alike by default, or more often where the robot fails."""

    bins: int = 20
    """Stretches into which each clip is cut."""
    uniform_share: float = 1.0
    """Share of episodes that begin anywhere alike; the others begin where failures are frequent."""
    memory: float = 0.998
    """What is left of a count after one control step."""
    lookback: float = 0.25
    """Time before a failure at which its cause is presumed [s]."""

    def __post_init__(self) -> None:
        check_ranges(self, bins=(1, 1e6), uniform_share=(0, 1), memory=(0, 1 - 1e-9), lookback=(0, INFINITE))

    @property
    def is_weighted(self) -> bool:
        """Whether failures count at all."""
        return self.uniform_share < 1.0


@dataclass(frozen=True)
class TerrainConfig:
    """The ground. The reference is lifted onto it."""

    kind: Literal["flat", "waves", "steps", "slopes"] = "flat"
    """``waves``: crossing sine waves; ``steps``: square plateaus; ``slopes``: ridges with straight flanks."""
    height: float = 0.06
    """From the lowest to the highest point [m]; for ``steps`` also the greatest step."""
    length: float = 2.0
    """From crest to crest, or the side of a plateau [m]."""
    spacing: float = 0.1
    """Between two points of the height field [m]."""
    spread: float = 5.0
    """Episodes begin at random within this distance of the middle, along both axes [m]."""
    seed: int = 1
    """Seed of the plateaus' heights."""

    def __post_init__(self) -> None:
        check_ranges(self, height=(1e-9, INFINITE), length=(1e-9, INFINITE), spacing=(1e-9, INFINITE))
        check_ranges(self, spread=(0, INFINITE), seed=(0, 2**31 - 1))

    @property
    def is_flat(self) -> bool:
        """Whether a plane is all there is."""
        return self.kind == "flat"


@dataclass(frozen=True)
class SolverConfig:
    """MuJoCo Warp's constraint solver.

    The default capacity for constraints holds random falls of 256 robots with a margin: at most 32 rows a world were
    seen on flat ground, 77 on steps and slopes of 15 cm.
    """

    iterations: int = 5
    line_search_iterations: int = 8
    tolerance: float = 1e-6
    max_contacts: int | None = None
    """Capacity of the contact buffer for each world; the worlds share it. By default as many as can occur."""
    max_constraints: int | None = None
    """Capacity of the constraint buffer for each world. By default 48 on flat ground, else 96."""
    friction: float = 0.8
    """Coefficient of friction between robot and floor."""
    self_contact: bool = False
    """Whether the robot's shapes collide with one another, not with the ground alone; more contacts to solve."""
    stop_time: float = 0.01
    """Time constant of the joints' stops [s], which are critically damped whatever the inertia; at least two physics
    steps. A joint at the motors' full speed goes 0.08 rad beyond its limit."""

    def __post_init__(self) -> None:
        check_ranges(self, iterations=(1, 1e4), line_search_iterations=(1, 1e4), tolerance=(0, 1))
        check_ranges(self, max_contacts=(1, 1e6), max_constraints=(1, 1e6), friction=(0, INFINITE))
        check_ranges(self, stop_time=(1e-4, 1.0))


@dataclass(frozen=True)
class EnvConfig:
    """Settings of the imitation environment."""

    num_worlds: int = 8192
    """Worlds simulated at once; 0 chooses by the device: 256 on a CPU, 4096 on a GPU."""
    seed: int = 1
    control_rate: float = 60.0
    """[Hz]"""
    substeps: int = 4
    """Physics steps in one control step."""
    episode_time: float = 20.0
    """Longest episode [s]."""
    end_hold: float = 0.5
    """Time for which an episode goes on beyond the end of a motion that is played once [s]."""
    history_length: int = 3
    """States in an observation, the present one included."""
    steps_ahead: tuple[int, ...] = (1, 2, 10, 30)
    """Future control steps whose reference is observed."""
    action: ActionConfig = field(default_factory=ActionConfig)
    motor: MotorConfig = field(default_factory=MotorConfig)
    rewards: tuple[RewardTerm, ...] = REWARDS
    """Terms that add up to the reward."""
    observations: tuple[ObservationTerm, ...] = OBSERVATIONS
    """What the policy sees of the robot, at ``history_length`` control steps."""
    reference_observations: tuple[ObservationTerm, ...] = REFERENCE_OBSERVATIONS
    """What it sees of the reference, at each of ``steps_ahead``."""
    privileged_observations: tuple[ObservationTerm, ...] = PRIVILEGED_OBSERVATIONS
    """What only the critic sees, with ``privileged``."""
    reset: ResetConfig = field(default_factory=ResetConfig)
    terminations: tuple[TerminationTerm, ...] = TERMINATIONS
    """Conditions that end an episode."""
    initial_limit_scale: float = 1.0
    """Limits of distance and rotation when training begins, as multiples of their values."""
    limit_anneal_time: float = 0.0
    """Simulated time of each world within which they fall to those values [s]."""
    randomization: tuple[RandomizationTerm, ...] = RANDOMIZATION
    """What differs between the worlds."""
    phase_sampling: PhaseSamplingConfig = field(default_factory=PhaseSamplingConfig)
    terrain: TerrainConfig = field(default_factory=TerrainConfig)
    privileged: bool = False
    """Give the critic what no real robot knows: contact forces, and what was drawn for the world."""
    solver: SolverConfig = field(default_factory=SolverConfig)

    def __post_init__(self) -> None:
        check_ranges(self, num_worlds=(0, 1e6), seed=(0, 2**31 - 1), control_rate=(1, 1e4), episode_time=(1e-3, 1e6))
        check_ranges(self, substeps=(1, 1000), history_length=(1, 1000), steps_ahead=(0, 1e5), end_hold=(0, 1e6))
        check_ranges(self, initial_limit_scale=(1, INFINITE), limit_anneal_time=(0, INFINITE))
        if any(ahead < 1 for ahead in self.steps_ahead):
            raise Kine2GoError(f"steps_ahead is {list(self.steps_ahead)}; each must be at least 1")
        check_names(self.rewards, "reward")
        check_names((*self.observations, *self.reference_observations), "observation")
        check_names(self.privileged_observations, "privileged observation")
        check_names(self.terminations, "termination")
        check_randomization(self.randomization)
        if not any(term.enabled for term in self.observations):
            raise Kine2GoError("observations are all switched off; a policy must see something of the robot")

    @property
    def active_rewards(self) -> tuple[RewardTerm, ...]:
        """The reward terms that count, in the order in which they are added up."""
        return tuple(term for term in self.rewards if term.weight != 0.0)

    @property
    def reward_names(self) -> tuple[str, ...]:
        """Names of the reward terms that count."""
        return tuple(term.name for term in self.active_rewards)

    @property
    def largest_reward(self) -> float | None:
        """Largest reward of a control step, None where the maximum of a term is not known."""
        maxima = [0.0 if term.weight < 0.0 else term.maximum for term in self.active_rewards]
        if any(maximum is None for maximum in maxima):
            return None
        weights = (term.weight for term in self.active_rewards)
        return (
            sum(weight * (maximum or 0.0) for weight, maximum in zip(weights, maxima, strict=True)) / self.control_rate
        )

    @property
    def active_terminations(self) -> tuple[TerminationTerm, ...]:
        """The conditions that end episodes; the reason of an end is 1 + the place in them."""
        return tuple(term for term in self.terminations if term.enabled)

    @property
    def reason_names(self) -> tuple[str, ...]:
        """Names of the reasons why an episode ends, indexed by the reason, which is 0 (no text) while it goes on."""
        return ("", *(term.name for term in self.active_terminations))

    @property
    def fault_reasons(self) -> tuple[int, ...]:
        """Reasons that are the simulation's fault, not the policy's."""
        return tuple(reason for reason, term in enumerate(self.active_terminations, 1) if term.is_fault)

    @property
    def anneals_limits(self) -> bool:
        """Whether limits of failure change at all."""
        return self.initial_limit_scale > 1.0

    @property
    def draws_bodies(self) -> bool:
        """Whether masses differ between the worlds."""
        return any(term.range and term.drawn.when == "world" for term in self.randomization)

    def on(self, device: str) -> "EnvConfig":
        """Return the settings with the number of worlds chosen for a device, such as ``cpu``, where it is left open."""
        if self.num_worlds:
            return self
        return replace(self, num_worlds=CUDA_WORLDS if device.startswith("cuda") else CPU_WORLDS)

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
    def end_hold_steps(self) -> int:
        """Control steps for which an episode goes on beyond the end of a clip played once."""
        return round(self.end_hold * self.control_rate)

    @property
    def limit_anneal_steps(self) -> int:
        """Control steps within which the limits of failure fall to their values."""
        return round(self.limit_anneal_time * self.control_rate)

    @property
    def max_constraints(self) -> int:
        """Capacity of the constraint buffer for each world."""
        return self.solver.max_constraints or (48 if self.terrain.is_flat else 96) + 32 * self.solver.self_contact

    @property
    def delay_substeps(self) -> int:
        """Action latency in physics substeps, where it is not drawn."""
        return round(self.action.latency / self.substep_duration)

    @property
    def delay_range(self) -> tuple[int, int]:
        """Least and greatest action latency in physics substeps."""
        drawn = [value for term in active(self.randomization, "latency") for value in term.range]
        substeps = [round(value / self.substep_duration) for value in drawn or [self.action.latency]]
        return min(substeps), max(substeps)
