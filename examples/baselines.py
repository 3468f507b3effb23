"""Baselines for the benchmark, learned from a dataset alone: nearest neighbour, goal-conditioned clone, offline RL.

They become ONNX files with manifests, so that ``kine2go dataset benchmark`` runs them as it runs anybody's.
"""

import importlib
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from rich.progress import track
from torch import Tensor, nn

from kine2go_warp.benchmark.observation import recorded_observations
from kine2go_warp.benchmark.run import first_action, references
from kine2go_warp.benchmark.splits import split_of
from kine2go_warp.cli.main import run_script
from kine2go_warp.dataset import Dataset, open_dataset
from kine2go_warp.deployment.export import quiet_exporter
from kine2go_warp.errors import DatasetError, MissingExtraError
from kine2go_warp.files import atomic_file
from kine2go_warp.rollouts.worlds import STATES, Scene

FEATURES = (
    *("height", "gravity", "linear_velocity", "angular_velocity", "joint_position", "joint_velocity", "action-1"),
    *("goal_position+1", "goal_rotation+1", "goal_joint_position+1", "goal_joint_velocity+1"),
    *("goal_position+10", "goal_rotation+10", "goal_joint_position+10"),
)
"""What all see: the robot's state, its last action, and the reference one and ten rows ahead."""


@dataclass(frozen=True)
class Settings:
    """Learn the baselines from the motions of a dataset that are not held out."""

    dataset: tyro.conf.Positional[Path]
    """A dataset made by 'kine2go dataset gather', 'run' or 'demo'."""
    out: Path = Path("baselines")
    """Folder for the ONNX files and their manifests."""
    held_out: bool = False
    """Learn from the motions that the benchmark holds out, too; results on them say nothing of new motions then."""
    offline_rl: bool = False
    """Learn by implicit Q-learning from actions and rewards, too; takes d3rlpy ('uv run --with d3rlpy python ...')."""
    batches: int = 10000
    batch_size: int = 512
    hidden_layers: tuple[int, ...] = (256, 256)
    seed: int = 1


@dataclass(frozen=True)
class Recorded:
    """Rows of a dataset to learn from, trajectory after trajectory."""

    seen: Tensor
    """Observations, shape [num_rows, size]."""
    mean: Tensor
    """Means of the policy's actions, shape [num_rows, 12]."""
    action: Tensor
    """Actions as they were done, with the policy's noise, shape [num_rows, 12]."""
    reward: Tensor
    """What each earned, shape [num_rows]."""
    last: Tensor
    """Whether a row is the last of its trajectory, shape [num_rows]."""


def recorded(dataset: Dataset, held_out: bool) -> Recorded:
    """Return the rows of a dataset's motions.

    Raises:
        DatasetError: all motions are held out.
    """
    names = [name for name in dataset.motions if held_out or split_of(name) == "train"]
    if not names:
        raise DatasetError(f"{dataset.path}: all of its motions are held out; learn from them with --held-out")
    found = []
    for name in track(names, "reading", transient=True, disable=not sys.stdout.isatty()):
        data = dataset.select([name]).load(name)
        rows = {array: data.trajectories.rows[array] for array in (*STATES, "action", "action_mean", "reward")}
        there = np.isfinite(rows["root_position"]).all(axis=-1)
        seen = recorded_observations(
            rows | references(data), first_action(Scene.of(dataset.path, data, dataset.robot)), FEATURES
        )
        last = np.arange(rows["reward"].shape[1]) == there.sum(axis=1, keepdims=True) - 1
        values = (seen, rows["action_mean"], rows["action"], rows["reward"].sum(axis=-1), last)
        found.append([torch.from_numpy(part[there]) for part in values])
    return Recorded(*(torch.cat(parts) for parts in zip(*found, strict=True)))


class Normalised(nn.Module):
    """A policy that sees its observation in standard deviations of the training data."""

    middle: Tensor
    spread: Tensor

    def __init__(self, seen: Tensor) -> None:
        super().__init__()
        self.register_buffer("middle", seen.mean(dim=0))
        self.register_buffer("spread", seen.std(dim=0).clamp(min=1e-3))

    def normalise(self, observation: Tensor) -> Tensor:
        """Return the observation without unit; what is unlike anything in the data is held back."""
        return ((observation - self.middle) / self.spread).clamp(-5.0, 5.0)


class NearestNeighbour(Normalised):
    """Does what the dataset's policy did in the most similar row."""

    keys: Tensor
    half_norm: Tensor
    actions: Tensor

    def __init__(self, seen: Tensor, mean: Tensor) -> None:
        super().__init__(seen)
        keys = self.normalise(seen)
        self.register_buffer("keys", keys.T.contiguous())
        self.register_buffer("half_norm", 0.5 * keys.square().sum(dim=1))
        self.register_buffer("actions", mean)

    def forward(self, observation: Tensor) -> Tensor:
        """Return the action, shape [batch, 12]."""
        nearest = (self.normalise(observation) @ self.keys - self.half_norm).argmax(dim=1)
        return self.actions[nearest]


class Clone(Normalised):
    """A small network from observation to action."""

    action_middle: Tensor
    action_spread: Tensor

    def __init__(self, seen: Tensor, mean: Tensor, hidden: Sequence[int]) -> None:
        super().__init__(seen)
        widths = [seen.shape[1], *hidden]
        layers = [part for width in zip(widths, hidden, strict=False) for part in (nn.Linear(*width), nn.ELU())]
        self.layers = nn.Sequential(*layers, nn.Linear(widths[-1], mean.shape[1]))
        self.register_buffer("action_middle", mean.mean(dim=0))
        self.register_buffer("action_spread", mean.std(dim=0).clamp(min=1e-3))

    def forward(self, observation: Tensor) -> Tensor:
        """Return the action, shape [batch, 12]."""
        return self.action_middle + self.action_spread * self.layers(self.normalise(observation))


def train(clone: Clone, seen: Tensor, mean: Tensor, settings: Settings) -> float:
    """Fit a clone; return its last loss, the mean squared error in standard deviations of the actions."""
    optimiser = torch.optim.AdamW(clone.parameters(), lr=1e-3, weight_decay=1e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, settings.batches)
    loss = torch.zeros(())
    for _ in track(range(settings.batches), "training", transient=True, disable=not sys.stdout.isatty()):
        chosen = torch.randint(len(seen), (settings.batch_size,))
        loss = ((clone(seen[chosen]) - mean[chosen]) / clone.action_spread).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    return loss.item()


def import_d3rlpy() -> Any:
    """Return the module d3rlpy, which is no dependency of this project: it asks for older packages.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return importlib.import_module("d3rlpy")
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"{error.name} is not installed; run 'uv run --with d3rlpy python examples/baselines.py ... --offline-rl'"
        ) from None


class OfflineRl(Normalised):
    """The policy that d3rlpy's implicit Q-learning found."""

    action_middle: Tensor
    action_range: Tensor

    def __init__(self, data: Recorded, settings: Settings) -> None:
        """Learn it, from observations without unit and actions from -1 to 1."""
        super().__init__(data.seen)
        d3rlpy = import_d3rlpy()
        low, high = data.action.amin(dim=0), data.action.amax(dim=0)
        self.register_buffer("action_middle", (high + low) / 2)
        self.register_buffer("action_range", (high - low).clamp(min=1e-3) / 2)
        encoder = d3rlpy.models.VectorEncoderFactory(list(settings.hidden_layers))
        encoders = {f"{part}_encoder_factory": encoder for part in ("actor", "critic", "value")}
        learner = d3rlpy.algos.IQLConfig(gamma=0.97, **encoders).create(device="cpu")
        learner.create_impl(data.seen.shape[1:], data.action.shape[1])
        seen = self.normalise(data.seen).numpy()
        actions = ((data.action - self.action_middle) / self.action_range).numpy()
        rewards, begins = data.reward[:, None].numpy(), torch.nonzero(~data.last).flatten().numpy()
        alike = {"terminals": np.zeros((settings.batch_size, 1), np.float32), "transitions": ()}
        alike["intervals"] = np.ones((settings.batch_size, 1), np.float32)
        for _ in track(range(settings.batches), "offline RL", transient=True, disable=not sys.stdout.isatty()):
            now = begins[torch.randint(len(begins), (settings.batch_size,)).numpy()]
            of_now = {"observations": seen[now], "actions": actions[now], "rewards": rewards[now]}
            of_next = {"next_observations": seen[now + 1], "next_actions": actions[now + 1]}
            learner.update(d3rlpy.dataset.TransitionMiniBatch(**of_now, **of_next, **alike))
        self.policy = learner.impl.policy

    def forward(self, observation: Tensor) -> Tensor:
        """Return the action, shape [batch, 12]."""
        return self.action_middle + self.action_range * self.policy(self.normalise(observation)).squashed_mu


def write(policy: nn.Module, size: int, path: Path) -> None:
    """Write a policy as ONNX, with the manifest that the benchmark reads."""
    with atomic_file(path) as temporary, quiet_exporter():
        batch = ({0: torch.export.Dim("worlds")},)
        example = (torch.zeros(2, size),)
        torch.onnx.export(policy.eval(), example, str(temporary), dynamic_shapes=batch, external_data=False)
    with atomic_file(path.with_suffix(".json")) as temporary:
        temporary.write_text(json.dumps({"name": path.stem, "observation": FEATURES}, indent=1) + "\n")


def run(settings: Settings) -> None:
    """Learn, write and say what to run next."""
    torch.set_num_threads(1)
    torch.manual_seed(settings.seed)
    if settings.offline_rl:
        import_d3rlpy().seed(settings.seed)
    data = recorded(open_dataset(settings.dataset), settings.held_out)
    clone = Clone(data.seen, data.mean, settings.hidden_layers)
    loss = train(clone, data.seen, data.mean, settings)
    print(f"{len(data.seen):,} rows; the clone's last loss is {loss:.4f}")
    policies: dict[str, nn.Module] = {"nearest_neighbour": NearestNeighbour(data.seen, data.mean), "clone": clone}
    if settings.offline_rl:
        policies["offline_rl"] = OfflineRl(data, settings)
    files = [settings.out / f"{name}.onnx" for name in policies]
    for policy, path in zip(policies.values(), files, strict=True):
        write(policy, data.seen.shape[1], path)
    print(f"next: kine2go dataset benchmark {settings.dataset} --policy {' '.join(map(str, files))}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script and return its exit status: 2 for an error that the user can mend."""
    return run_script(run, Settings, arguments)


if __name__ == "__main__":
    sys.exit(main())
