"""The command that benchmarks policies of any origin on a dataset."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from kine2go_warp.benchmark.config import BenchmarkConfig
from kine2go_warp.cli.commands import limit_threads
from kine2go_warp.cli.data import DatasetPath, Device, MotionNames, check_data
from kine2go_warp.cli.texts import say
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.files import check_place

if TYPE_CHECKING:
    from kine2go_warp.benchmark.leaderboard import Leaderboard


@dataclass(frozen=True)
class Benchmark:
    """Roll policies out from a dataset's initial states, and score them against its own rollouts.

    Example: kine2go dataset benchmark runs/demo/dataset.zarr --policy clone.onnx nearest.py:Nearest
    """

    dataset: DatasetPath
    """A dataset made by 'kine2go dataset gather' or 'kine2go run'."""
    motions: MotionNames = ()
    """Names of its motions; by default all of them."""
    policy: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY [POLICY ...]")] = ()
    """An .onnx file with its manifest beside it, a policy folder or an exported policy of ours, or file.py:NAME."""
    leaderboard: Path = Path("leaderboard.json")
    """File that results are merged into; what it has is not simulated again. The picture lies beside it."""
    device: Device = None
    config: tyro.conf.OmitArgPrefixes[BenchmarkConfig] = field(default_factory=BenchmarkConfig)

    def run(self) -> int:
        """Simulate what is missing, motion by motion, write, draw, and print a table."""
        if not self.policy:
            raise Kine2GoError("name at least one policy, as in --policy clone.onnx")
        if self.leaderboard.is_dir():
            raise Kine2GoError(f"{self.leaderboard}: is a folder; name a file for the results")
        check_place(self.leaderboard)

        from kine2go_warp.dataset import open_dataset

        dataset = open_dataset(self.dataset)
        names = dataset.chosen(self.motions)
        for name in names:
            check_data(dataset.motion(name))

        from kine2go_warp.benchmark.leaderboard import Leaderboard, draw
        from kine2go_warp.benchmark.policies import load_policy
        from kine2go_warp.benchmark.run import benchmark_motion
        from kine2go_warp.cli.progress import Progress
        from kine2go_warp.dataset.content import motion_content
        from kine2go_warp.device import choose_device

        limit_threads()
        board = Leaderboard.read(self.leaderboard, self.config)
        device = choose_device(self.device)
        with Progress() as progress:
            for policy in [load_policy(one) for one in self.policy]:
                progress.stage(policy.name, "benchmark")
                for name in names:
                    content = motion_content(self.dataset, name)
                    if board.has(policy, name, content):
                        continue
                    found = benchmark_motion(dataset, name, policy, self.config, device, progress.advanced)
                    board = board.with_results(policy, content, found)
                    board.write(self.leaderboard)
        picture = draw(board, self.leaderboard.with_suffix(".png"))
        print_board(board)
        say(f"{self.leaderboard}: all metrics with intervals, motion by motion; {picture}: scores and survival")
        return 0


def print_board(board: "Leaderboard") -> None:
    """Print a line for each policy, split and condition: how many times the dataset's own mean each metric is."""
    from kine2go_warp.benchmark.leaderboard import groups
    from kine2go_warp.benchmark.run import METRIC_NAMES, SCORE, SURVIVAL
    from kine2go_warp.cli.tables import print_table
    from kine2go_warp.tables import make_table, number_text

    rows = []
    for entry in board.entries:
        for split, condition in groups(board):
            score, survival = (number_text(entry.mean(split, condition, name)) for name in (SCORE, SURVIVAL))
            ratios = (number_text(entry.ratio(split, condition, name)) for name in METRIC_NAMES)
            rows.append((entry.policy, split, condition, score, survival, *ratios))
    headings = ("policy", "motions", "start", "score", "survival", *(f"{name} / data" for name in METRIC_NAMES))
    print_table(make_table("policies against the dataset's own rollouts", headings, rows, headings[:3]))
