"""Two baselines for the benchmark, learned from a dataset alone: a nearest neighbour and a goal-conditioned clone.

Both become ONNX files with manifests, so that ``kine2go dataset benchmark`` runs them as it runs anybody's.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

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
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file
from kine2go_warp.rollouts.worlds import STATES, Scene

FEATURES = (
    *("height", "gravity", "linear_velocity", "angular_velocity", "joint_position", "joint_velocity", "action-1"),
    *("goal_position+1", "goal_rotation+1", "goal_joint_position+1", "goal_joint_velocity+1"),
    *("goal_position+10", "goal_rotation+10", "goal_joint_position+10"),
)
"""What both see: the robot's state, its last action, and the reference one and ten rows ahead."""


@dataclass(frozen=True)
class Settings:
    """Learn the baselines from the motions of a dataset that are not held out."""

    dataset: tyro.conf.Positional[Path]
    """A dataset made by 'kine2go dataset gather', 'run' or 'demo'."""
    out: Path = Path("baselines")
    """Folder for the ONNX files and their manifests."""
    held_out: bool = False
    """Learn from the motions that the benchmark holds out, too; results on them say nothing of new motions then."""
    batches: int = 2000
    batch_size: int = 512
    hidden_layers: tuple[int, ...] = (256, 256)
    seed: int = 1


def training_pairs(dataset: Dataset, held_out: bool) -> tuple[Tensor, Tensor]:
    """Return observations, shape [num_rows, size], and the means of the policy's actions there, [num_rows, 12].

    Raises:
        DatasetError: all motions are held out.
    """
    names = [name for name in dataset.motions if held_out or split_of(name) == "train"]
    if not names:
        raise DatasetError(f"{dataset.path}: all of its motions are held out; learn from them with --held-out")
    observations, actions = [], []
    for name in track(names, "reading", transient=True, disable=not sys.stdout.isatty()):
        data = dataset.select([name]).load(name)
        rows = {array: data.trajectories.rows[array] for array in (*STATES, "action", "action_mean")}
        there = np.isfinite(rows["root_position"]).all(axis=-1)
        seen = recorded_observations(
            rows | references(data), first_action(Scene.of(dataset.path, data, dataset.robot)), FEATURES
        )
        observations.append(seen[there])
        actions.append(rows["action_mean"][there])
    return torch.from_numpy(np.concatenate(observations)), torch.from_numpy(np.concatenate(actions))


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
    seen, mean = training_pairs(open_dataset(settings.dataset), settings.held_out)
    clone = Clone(seen, mean, settings.hidden_layers)
    loss = train(clone, seen, mean, settings)
    print(f"{len(seen):,} rows; the clone's last loss is {loss:.4f}")
    files = [settings.out / "nearest_neighbour.onnx", settings.out / "clone.onnx"]
    for policy, path in zip((NearestNeighbour(seen, mean), clone), files, strict=True):
        write(policy, seen.shape[1], path)
    print(f"next: kine2go dataset benchmark {settings.dataset} --policy {' '.join(map(str, files))}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the script and return its exit status: 2 for an error that the user can mend."""
    return run_script(run, Settings, arguments)


if __name__ == "__main__":
    sys.exit(main())
