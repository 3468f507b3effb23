"""Behaviour cloning: learn a policy from a dataset alone, then let it walk beside the policy that made the data.

    uv run python examples/behaviour_cloning.py runs/demo/dataset.zarr runs/demo/policies/dog_trot

What the clone sees depends neither on absolute place nor on heading. ``observe`` computes it from rows of the dataset;
in the environment it is the environment's own observation, number by number the same. See docs/behaviour_cloning.md.
"""

import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import torch
import tyro
import warp as wp
from rich.console import Console
from rich.progress import track
from rich.table import Table
from tensordict import TensorDict
from torch import Tensor, nn

from kine2go_warp.cli.main import report
from kine2go_warp.dataset import Dataset, compute_statistics, load_rows, open_dataset
from kine2go_warp.dataset.statistics import moments_of
from kine2go_warp.dataset.torch_windows import WindowLoader
from kine2go_warp.device import start_warp
from kine2go_warp.env.config import ActionConfig, EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.errors import DatasetError, Kine2GoError
from kine2go_warp.files import atomic_file
from kine2go_warp.learning.inference import NoisyPolicy
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.vec_env import ImitationVecEnv
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.replay import environment_config
from kine2go_warp.scores.statistics import estimate_share

ROOT = ("root_position", "root_orientation", "root_linear_velocity", "root_angular_velocity")
REFERENCE = ("reference_root_position", "reference_root_orientation", "reference_joint_position")
ARRAYS = (*ROOT, "joint_position", "joint_velocity", *REFERENCE, "action", "action_mean")
HISTORY = 3
"""States that the clone sees, the present one included, each with the action before it. An action takes 20 ms to reach
the motors, longer than a row, so the present state alone does not tell what is on its way."""
AHEAD = (1, 2, 10)
"""Rows from now whose reference the clone sees."""
NOW = HISTORY
"""Place of the present row in a window: one more row is needed before the oldest state, for its action."""
WINDOW = NOW + 1 + max(AHEAD)

Rows = dict[str, Tensor]
"""Windows of the dataset: arrays by name, each of shape [batch, WINDOW, ...]."""


@dataclass(frozen=True)
class Settings:
    """Train a clone on a dataset, and compare it with the policy that the dataset was gathered from."""

    dataset: tyro.conf.Positional[Path]
    """A dataset made by 'kine2go gather', 'run' or 'demo'."""
    policy: tyro.conf.Positional[Path]
    """Folder of the policy that it was gathered from; its clip is the reference."""
    trajectories: int | None = None
    """Use the first so many trajectories of the motion; by default all."""
    validation: float = 0.1
    """Share of the trajectories that is kept from the training."""
    batches: int = 3000
    batch_size: int = 512
    learning_rate: float = 1e-3
    """At the beginning; it falls to zero along a cosine."""
    hidden: tuple[int, ...] = (256, 256)
    """Widths of the clone's layers."""
    worlds: int = 64
    """Rollouts of each policy in the comparison."""
    duration: float = 10.0
    """How long a rollout has to last, after the warm-up that the dataset leaves out [s]."""
    seed: int = 12345
    """Of training and comparison; another one than that of the data, so that the worlds are new."""
    json: Path | None = None
    """Write the figures here, too."""


def rotation_matrix(orientation: Tensor) -> Tensor:
    """Return rotation matrices, shape [..., 3, 3], of quaternions (w, x, y, z)."""
    w, x, y, z = orientation.unbind(-1)
    first = torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], dim=-1)
    second = torch.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], dim=-1)
    third = torch.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], dim=-1)
    return torch.stack([first, second, third], dim=-2)


def observe(window: Rows) -> Tensor:
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
        seen = moments_of(observe(loader.gather(torch.from_numpy(loader.starts[::16]))).numpy())
        for name, one in (("input", seen), ("action", action)):
            self.register_buffer(f"{name}_mean", torch.from_numpy(one.mean).float())
            self.register_buffer(f"{name}_deviation", torch.from_numpy(one.std).float().clamp(min=1e-3))
        widths = [len(seen.mean), *hidden]
        layers = [part for width in zip(widths, hidden, strict=False) for part in (nn.Linear(*width), nn.ELU())]
        self.layers = nn.Sequential(*layers, nn.Linear(widths[-1], len(action.mean)))

    def normalised(self, observation: Tensor) -> Tensor:
        """Return the action in standard deviations of the dataset's actions."""
        # A clamp, since the first observations of an episode are unlike anything in the data.
        return self.layers(((observation - self.input_mean) / self.input_deviation).clamp(-5.0, 5.0))

    def forward(self, observation: Tensor) -> Tensor:
        """Return the action, shape [batch, 12]."""
        return self.action_mean + self.action_deviation * self.normalised(observation)

    def loss(self, window: Rows) -> Tensor:
        """Return the mean squared error in normalised units.

        The target is the mean of the policy's distribution. The sampled action is the same plus noise that nobody can
        foretell, which the clone would only have to average away; but the noise that has been is seen in ``before``.
        """
        target = (window["action_mean"][:, NOW] - self.action_mean) / self.action_deviation
        return nn.functional.mse_loss(self.normalised(observe(window)), target)


def endless(loader: WindowLoader) -> Iterator[Rows]:
    """Yield batches, epoch after epoch."""
    while True:
        yield from loader


@torch.no_grad()
def mean_loss(clone: Clone, loader: WindowLoader) -> float:
    """Return the loss over all windows."""
    losses = [(clone.loss(window).item(), len(window["action"])) for window in loader]
    return sum(loss * count for loss, count in losses) / sum(count for _, count in losses)


def train(dataset: Dataset, settings: Settings) -> tuple[Clone, list[float]]:
    """Train on a part of the trajectories; return the clone, and its loss on the others before and after."""
    torch.manual_seed(settings.seed)
    training, validation = dataset.split(settings.validation)
    loader = WindowLoader(load_rows(training, ARRAYS), WINDOW, settings.batch_size, settings.seed)
    held_out = WindowLoader(load_rows(validation, ARRAYS), WINDOW, 2048, shuffle=False, drop_last=False)
    clone = Clone(training, loader, settings.hidden)
    optimiser = torch.optim.AdamW(clone.parameters(), settings.learning_rate, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings.batches)
    losses, batches = [mean_loss(clone, held_out)], endless(loader)
    for _ in progress(settings.batches, "training"):
        optimiser.zero_grad()
        clone.loss(next(batches)).backward()
        optimiser.step()
        schedule.step()
    return clone, [*losses, mean_loss(clone, held_out)]


@dataclass(frozen=True)
class Figures:
    """How one policy did in the environment."""

    policy: str
    rollouts: int
    survival: tuple[float, float, float]
    """Share of the rollouts that lasted, and its 95 % interval."""
    joint_rmse: float
    """Root mean square error of the joint positions until a fall [rad]."""
    root_error: float
    """Mean distance of the root from its reference until a fall [m]."""


def walk(name: str, env: ImitationVecEnv, act: Callable[[TensorDict], Tensor], warm_up: int, rows: int) -> Figures:
    """Let a policy act in all worlds. A world counts until it fails for the first time."""
    environment = env.environment
    standing = torch.ones(env.num_envs, dtype=torch.bool)
    joint_errors, root_errors = [], []
    observation = env.get_observations()
    for row in progress(warm_up + rows, name):
        observation, *_ = env.step(act(observation))
        standing &= env.buffers.reason == 0
        if row >= warm_up:
            reference, joint_q = environment.reference, wp.to_torch(environment.robot.joint_q)
            joint_errors.append((joint_q[:, 7:] - wp.to_torch(reference.joint_position))[standing] ** 2)
            root_errors.append((joint_q[:, :3] - wp.to_torch(reference.root)[:, :3])[standing].norm(dim=-1))
    share = estimate_share([standing.numpy()])
    rmse, error = torch.cat(joint_errors).mean().sqrt().item(), torch.cat(root_errors).mean().item()
    return Figures(name, share.count, (share.value, share.low, share.high), rmse, error)


def compare(clone: Clone, policy: PolicyFolder, gathered_in: EnvConfig, attributes: dict, settings: Settings) -> list:
    """Let original and clone walk in the same new worlds, drawn as those of the dataset; return their figures."""
    record = policy.read_record()
    warm_up, rows = (round(time * gathered_in.control_rate) for time in (attributes["warm_up"], settings.duration))
    episode_time = (warm_up + rows + 2) / gathered_in.control_rate
    config = replace(gathered_in, num_worlds=settings.worlds, seed=settings.seed, episode_time=episode_time)
    # The output of this form is the dataset's action, so the environment's last output is the action before.
    action = ActionConfig("default_pose", GO2.action_scale, latency=config.action.latency)
    for_clone = replace(config, action=action, history_length=HISTORY, steps_ahead=AHEAD)
    clips = policy.read_clips(record)[:1]
    env, clone_env = (ImitationVecEnv(ImitationEnvironment(clips, one, "cpu")) for one in (config, for_clone))
    original = NoisyPolicy(env, record.preset, policy.latest_checkpoint(), settings.seed)
    noise = torch.linspace(*attributes["noise"], settings.worlds)[:, None]
    figures = [walk("original", env, lambda seen: original(seen, 0.0)[0], warm_up, rows)]
    env.environment.restart(settings.seed)
    figures += [walk("original with noise", env, lambda seen: original(seen, noise)[1], warm_up, rows)]
    with torch.no_grad():
        return [*figures, walk("clone", clone_env, lambda seen: clone(seen["policy"]), warm_up, rows)]


def progress(steps: int, name: str) -> Iterator[int]:
    """Count with a bar on a terminal."""
    console = Console(stderr=True)
    yield from track(range(steps), name, console=console, transient=True, disable=not console.is_terminal)


def run(settings: Settings) -> None:
    """Train, compare, print and save.

    Raises:
        Kine2GoError: the dataset or the policy cannot be used, or they do not belong together.
    """
    start_warp()
    torch.set_num_threads(1)
    policy, dataset = PolicyFolder(settings.policy), open_dataset(settings.dataset)
    name = policy.read_clips(policy.read_record())[0].name
    attributes = dataset.motion(name).attributes
    if attributes.get("policy_sha256") != policy.checkpoint_hash():
        raise DatasetError(f"{settings.dataset}/{name}: was not gathered from the policy in {settings.policy}")
    gathered_in = environment_config(attributes, f"{settings.dataset}/{name}")
    count = settings.trajectories
    dataset = dataset.select([name], where=lambda one: count is None or one.index < count)
    started = time.perf_counter()
    clone, losses = train(dataset, settings)
    seconds = time.perf_counter() - started
    figures = compare(clone, policy, gathered_in, attributes["gather_settings"], settings)

    used = f"{len(dataset.references)} trajectories, {dataset.num_rows} rows"
    print(f"{used}: validation loss {losses[0]:.3f} -> {losses[1]:.4f} in {seconds:.0f} s")
    table = Table(title=f"{name}: {settings.worlds} rollouts of {settings.duration:g} s each", title_justify="left")
    for heading in ("policy", "survival (95 %)", r"joint RMSE \[rad]", r"root error \[cm]"):
        table.add_column(heading, justify="left" if heading == "policy" else "right")
    for one in figures:
        share, low, high = (f"{100 * value:.0f}" for value in one.survival)
        table.add_row(one.policy, f"{share} % ({low}-{high})", f"{one.joint_rmse:.4f}", f"{100 * one.root_error:.1f}")
    Console().print(table)
    if settings.json is not None:
        values = {"trajectories": len(dataset.references), "rows": dataset.num_rows, "seconds": seconds}
        values |= {"validation_loss": losses, "policies": [asdict(one) for one in figures]}
        with atomic_file(settings.json) as temporary:
            temporary.write_text(json.dumps(values, indent=2) + "\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script and return its exit status: 2 for an error that the user can mend."""
    try:
        run(tyro.cli(Settings, description=Settings.__doc__, args=arguments))
    except Kine2GoError as error:
        return report(str(error))
    return 0


if __name__ == "__main__":
    sys.exit(main())
