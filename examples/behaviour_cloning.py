"""Behaviour cloning: learn a policy from a dataset alone, then let it walk beside the policy that made the data.

What the clone sees depends neither on absolute place nor on heading. ``observe`` computes it from rows of the dataset;
in the environment it is the environment's own observation, number by number the same. See docs/behaviour_cloning.md.
"""

import itertools
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
import tyro
from rich.progress import track
from tensordict import TensorDict
from torch import Tensor, nn

from kine2go_warp.cli.main import run_script
from kine2go_warp.dataset import OBSERVATION_ARRAYS, Dataset, compute_statistics, load_rows, open_dataset
from kine2go_warp.dataset.statistics import compute_moments
from kine2go_warp.dataset.torch_windows import Batch, WindowLoader
from kine2go_warp.device import start_warp
from kine2go_warp.env.config import ActionConfig, EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.terms.randomization import randomized
from kine2go_warp.env.terms.terminations import with_limits
from kine2go_warp.errors import DatasetError, Kine2GoError
from kine2go_warp.files import atomic_file
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.rollout import Actor, roll_out
from kine2go_warp.rollouts.row_writer import AsyncRowWriter
from kine2go_warp.rollouts.worlds import environment_config
from kine2go_warp.scores.statistics import estimate_share

REFERENCE = ("reference_root_position", "reference_root_orientation", "reference_joint_position")
ARRAYS = (*OBSERVATION_ARRAYS, "root_position", *REFERENCE, "action_mean")
HISTORY = 3
"""States that the clone sees, each with the action before it: an action takes 20 ms, longer than a row, to act."""
AHEAD = (1, 2, 10)
"""Rows from now whose reference the clone sees."""
LOST = (1.0, 1.0)
"""Distance [m] and angle [rad] from the reference from which a pushed robot does not count as coming back."""
NOW, WINDOW = HISTORY, HISTORY + 1 + max(AHEAD)
"""Place of the present row in a window, with a row before the oldest state for its action; and length of a window."""


@dataclass(frozen=True)
class Settings:
    """Train a clone on a dataset, and compare it with the policy that the dataset was gathered from."""

    dataset: tyro.conf.Positional[Path]
    """A dataset made by 'kine2go dataset gather', 'run' or 'demo'."""
    policy: tyro.conf.Positional[Path]
    """Folder of the policy that it was gathered from; its clip is the reference."""
    trajectories: int | None = None
    """Train on the first so many of those left for training; by default on all of them."""
    validation: float = 0.1
    """Share of the motion's trajectories that is kept from the training, the same ones however many are trained on."""
    batches: int = 2000
    batch_size: int = 512
    hidden_layers: tuple[int, ...] = (256, 256)
    worlds: int = 64
    """Rollouts of each policy in the comparison."""
    duration: float = 10.0
    """How long a rollout has to last, after the warm-up that the dataset leaves out [s]."""
    seed: int = 12345
    """Of training and comparison; another one than that of the data, so that the worlds are new."""
    push_speed: float | None = None
    """Push the robots at this speed [m/s] in the comparison, instead of as in the dataset. A robot is lost then when it
    is farther than 1 m or turned by more than 1 rad from its reference."""
    json: Path | None = None
    """Write the metrics to this file, too."""

    def __post_init__(self) -> None:
        if min(self.batches, self.worlds, self.duration) <= 0 or (
            self.trajectories is not None and self.trajectories < 1
        ):
            raise Kine2GoError("trajectories, batches, worlds and duration must be positive")
        if self.push_speed is not None and self.push_speed < 0:
            raise Kine2GoError(f"push_speed is {self.push_speed}; it must be at least 0")


def rotation_matrix(orientation: Tensor) -> Tensor:
    """Return rotation matrices, shape [..., 3, 3], of quaternions (w, x, y, z)."""
    w, x, y, z = orientation.unbind(-1)
    first = (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y))
    second = (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x))
    third = (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))
    return torch.stack([*first, *second, *third], dim=-1).unflatten(-1, (3, 3))


def observe(window: Batch) -> Tensor:
    """Return what the robot can know at row ``NOW`` of each window, shape [batch, 198].

    The order is that of the environment's observation: states from new to old (direction of gravity, linear and angular
    velocity in the base frame; joints less the default pose; joint velocities; the action before), then the reference
    from near to far (place, forward and left axis in the robot's heading frame; joints less the default pose).
    """
    default = torch.tensor(GO2.default_joint_position)
    old = [NOW - age for age in range(HISTORY)]
    to_world = rotation_matrix(window["root_orientation"][:, old])
    velocities = torch.stack([window["root_linear_velocity"], window["root_angular_velocity"]], dim=-2)[:, old]
    joints = (window["joint_position"][:, old] - default, window["joint_velocity"][:, old])
    before = window["action"][:, [row - 1 for row in old]]
    states = torch.cat([-to_world[..., 2, :], (velocities @ to_world).flatten(-2), *joints, before], dim=-1)

    coming = [NOW + ahead for ahead in AHEAD]
    offset = window["reference_root_position"][:, coming] - window["root_position"][:, [NOW]]
    axes = rotation_matrix(window["reference_root_orientation"][:, coming])[..., :2]
    x, y, z = torch.cat([offset[..., None], axes], dim=-1).unbind(-2)
    cosine, sine = nn.functional.normalize(to_world[:, [0], :2, 0], dim=-1).split(1, dim=-1)
    seen = torch.stack([cosine * x + sine * y, cosine * y - sine * x, z], dim=-1).flatten(-2)
    targets = torch.cat([seen, window["reference_joint_position"][:, coming] - default], dim=-1)
    return torch.cat([states.flatten(1), targets.flatten(1)], dim=-1)


class Clone(nn.Module):
    """A small network from observation to action, with its normalisation inside."""

    def __init__(self, dataset: Dataset, loader: WindowLoader, hidden: Sequence[int]) -> None:
        """Build an untrained network, normalised with the statistics of the training data."""
        super().__init__()
        action = compute_statistics(dataset, ["action_mean"])["action_mean"]
        seen = compute_moments(observe(loader.gather(torch.from_numpy(loader.starts[::16]))).numpy())
        self.input_mean, self.action_mean = (torch.from_numpy(one.mean).float() for one in (seen, action))
        deviations = (torch.from_numpy(one.std).float().clamp(min=1e-3) for one in (seen, action))
        self.input_deviation, self.action_deviation = deviations
        widths = [len(seen.mean), *hidden]
        layers = [part for width in zip(widths, hidden, strict=False) for part in (nn.Linear(*width), nn.ELU())]
        self.layers = nn.Sequential(*layers, nn.Linear(widths[-1], len(action.mean)))

    def forward(self, observation: Tensor) -> Tensor:
        """Return the action, shape [batch, 12]."""
        # A clamp, since the first observations of an episode are unlike anything in the data.
        normalised = ((observation - self.input_mean) / self.input_deviation).clamp(-5.0, 5.0)
        return self.action_mean + self.action_deviation * self.layers(normalised)

    @torch.no_grad()
    def act(self, observation: TensorDict, noise: Tensor | float) -> tuple[Tensor, Tensor]:
        """Return the action twice, as mean and as sample: the clone has no noise."""
        assert noise == 0.0
        action = self(observation["policy"])
        return action, action

    def loss(self, window: Batch) -> Tensor:
        """Return the mean squared error in standard deviations of the dataset's actions."""
        # ``action`` is this mean plus noise that nobody can foretell. Earlier noise, however, is seen in the input.
        error = self(observe(window)) - window["action_mean"][:, NOW]
        return (error / self.action_deviation).square().mean()


def train(training: Dataset, validation: Dataset, settings: Settings) -> tuple[Clone, tuple[float, float]]:
    """Train on some trajectories; return the clone, and its loss on others before and after."""
    torch.manual_seed(settings.seed)
    loader = WindowLoader(load_rows(training, ARRAYS), WINDOW, settings.batch_size, settings.seed)
    others = WindowLoader(load_rows(validation, ARRAYS), WINDOW, batch_size=1)
    held_out = others.gather(torch.from_numpy(others.starts))
    clone = Clone(training, loader, settings.hidden_layers)
    optimiser = torch.optim.AdamW(clone.parameters(), lr=1e-3, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings.batches)
    before = clone.loss(held_out).item()
    batches = itertools.islice(itertools.chain.from_iterable(itertools.repeat(loader)), settings.batches)
    for window in track(batches, "training", settings.batches, transient=True, disable=not sys.stdout.isatty()):
        optimiser.zero_grad()
        clone.loss(window).backward()
        optimiser.step()
        schedule.step()
    return clone, (before, clone.loss(held_out).item())


@dataclass(frozen=True)
class Metrics:
    """Metrics of one policy: root mean square joint error [rad] and mean root error [m], over all rows recorded."""

    policy: str
    rollouts: int
    survival: tuple[float, float, float]
    """Share of the rollouts that lasted, and its 95 % interval."""
    joint_rmse: float
    root_error: float


def walk(name: str, env: ImitationVecEnv, actor: Actor, noise: Tensor | float, warm_up: int, rows: int) -> Metrics:
    """Roll a policy out in all worlds from the beginning of their episodes on, and measure after the warm-up."""
    with TemporaryDirectory() as folder, AsyncRowWriter(Path(folder) / "rows") as writer:
        recorded = roll_out(env, actor, noise, rows, writer, warm_up)
        seen = recorded.rows(np.arange(env.num_envs))
    share = estimate_share([recorded.failure == ""])
    joints = seen["joint_position"] - seen["reference_joint_position"]
    root = np.linalg.norm(seen["root_position"] - seen["reference_root_position"], axis=-1)
    rmse, error = float(np.sqrt(np.nanmean(joints**2))), float(np.nanmean(root))
    return Metrics(name, share.count, (share.value, share.low, share.high), rmse, error)


def pushed(config: EnvConfig, speed: float) -> EnvConfig:
    """Return the environment with pushes at a speed [m/s], as often as before, in which lost robots alone end early."""
    drawn = randomized(config.randomization, push_speed=(speed, speed))
    return replace(config, randomization=drawn, terminations=with_limits(*LOST, config.terminations))


def compare(
    clone: Clone, policy: PolicyFolder, config: EnvConfig, gathered: dict[str, Any], settings: Settings
) -> list[Metrics]:
    """Let original and clone walk in the same new worlds, drawn as those of the dataset; return their metrics."""
    warm_up, rows = (round(time * config.control_rate) for time in (gathered["warm_up"], settings.duration))
    config = replace(config, num_worlds=settings.worlds, seed=settings.seed)
    if settings.push_speed is not None:
        config = pushed(config, settings.push_speed)
    config = replace(config, episode_time=(warm_up + rows + 2) / config.control_rate)
    # The output of this form is the dataset's action, so the environment's last output is the action before.
    action = ActionConfig("default_offset", GO2.action_scale, latency=config.action.latency)
    for_clone = replace(config, action=action, history_length=HISTORY, steps_ahead=AHEAD)
    record = policy.read_record()
    clips = policy.read_clips(record)[:1]
    environments = (ImitationEnvironment(clips, one, "cpu", record_loads=True) for one in (config, for_clone))
    env, clone_env = (ImitationVecEnv(environment) for environment in environments)
    original = NoisyPolicy(env, record.preset, policy.latest_checkpoint(), settings.seed)
    noise = torch.linspace(*gathered["action_noise_scale"], steps=settings.worlds)[:, None]
    metrics = [walk("original", env, original, 0.0, warm_up, rows)]
    env.environment.restart(settings.seed)
    metrics += [walk("original with noise", env, original, noise, warm_up, rows)]
    return [*metrics, walk("clone", clone_env, clone.act, 0.0, warm_up, rows)]


def run(settings: Settings) -> None:
    """Train, compare, print and save; a Kine2GoError is raised where dataset and policy do not fit."""
    start_warp()
    torch.set_num_threads(1)
    policy, dataset = PolicyFolder(settings.policy), open_dataset(settings.dataset)
    name = policy.read_clips(policy.read_record())[0].name
    attributes = dataset.motion(name).attributes
    if attributes.get("policy_sha256") != policy.checkpoint_hash():
        raise DatasetError(f"{settings.dataset}/{name}: was not gathered from the policy in {settings.policy}")
    config = environment_config(attributes, f"{settings.dataset}/{name}")
    training, validation = dataset.select([name]).split(settings.validation)
    chosen = training.references[: settings.trajectories]
    training = training.select(where=lambda one: one in chosen)
    started = time.perf_counter()
    clone, losses = train(training, validation, settings)
    seconds = time.perf_counter() - started
    metrics = compare(clone, policy, config, attributes["gather_settings"], settings)
    trained = f"validation loss {losses[0]:.3f} -> {losses[1]:.4f} in {seconds:.0f} s"
    print(f"{len(chosen)} trajectories, {training.num_rows} rows: {trained}")
    print(f"{name}, {settings.worlds} rollouts of {settings.duration:g} s each:")
    print(f"{'policy':20} {'survival (95 %)':>16} {'joint RMSE':>11} {'root error':>11}")
    for one in metrics:
        survival = "{:.0%} ({:.0%}-{:.0%})".format(*one.survival)
        print(f"{one.policy:20} {survival:>16} {one.joint_rmse:7.4f} rad {100 * one.root_error:8.1f} cm")
    if settings.json is not None:
        values = {"trajectories": len(chosen), "rows": training.num_rows, "seconds": seconds, "losses": losses}
        values["policies"] = [asdict(one) for one in metrics]
        with atomic_file(settings.json) as temporary:
            temporary.write_text(json.dumps(values, indent=2) + "\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script and return its exit status: 2 for an error that the user can mend."""
    return run_script(run, Settings, arguments)


if __name__ == "__main__":
    sys.exit(main())
