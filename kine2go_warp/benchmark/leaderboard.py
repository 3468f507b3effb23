"""The file that keeps the results of many policies on one dataset, and its picture."""

import json
import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kine2go_warp import __version__
from kine2go_warp.benchmark.config import BenchmarkConfig
from kine2go_warp.benchmark.policies import BenchmarkPolicy
from kine2go_warp.benchmark.run import CONDITIONS, SCORE, SURVIVAL, MotionResult
from kine2go_warp.benchmark.splits import VERSION
from kine2go_warp.errors import DatasetError
from kine2go_warp.files import atomic_file
from kine2go_warp.scores.plots import COLOURS, new_figure, save
from kine2go_warp.scores.report import without_nan
from kine2go_warp.scores.statistics import Estimate
from kine2go_warp.settings import from_dictionary


@dataclass(frozen=True)
class Entry:
    """One policy."""

    policy: str
    sha256: str
    software_version: str
    results: tuple[MotionResult, ...] = ()

    def mean(self, split: str, condition: str, name: str) -> float:
        """Return the mean of an estimate over the motions of a split, each of which counts the same; NaN for none."""
        return mean([one.estimates[name].value for one in self._of(split, condition, name)])

    def ratio(self, split: str, condition: str, name: str) -> float:
        """Return the mean over those motions of how many times the dataset's own mean a metric is."""
        return mean([one.estimates[name].value / one.data[name] for one in self._of(split, condition, name)])

    def _of(self, split: str, condition: str, name: str) -> list[MotionResult]:
        found = [one for one in self.results if (one.split, one.condition) == (split, condition)]
        return [one for one in found if name in one.estimates]


@dataclass(frozen=True)
class Leaderboard:
    """Results that can be compared: of one version, under the same settings, on the same rollouts."""

    settings: BenchmarkConfig
    motions: dict[str, str] = field(default_factory=dict)
    """Hash of the content of each motion."""
    entries: tuple[Entry, ...] = ()
    version: int = VERSION

    @classmethod
    def read(cls, path: Path, settings: BenchmarkConfig) -> "Leaderboard":
        """Read a file, or begin one.

        Raises:
            DatasetError: it cannot be read, or is of another version or other settings.
        """
        if not path.exists():
            return cls(settings)
        try:
            values = json.loads(path.read_text())
            config = from_dictionary(BenchmarkConfig, values["settings"], str(path), DatasetError)
            entries = tuple(
                Entry(**{**entry, "results": tuple(read_result(one) for one in entry["results"])})
                for entry in values["entries"]
            )
            board = cls(config, dict(values["motions"]), entries, values["version"])
        except (ValueError, TypeError, KeyError, AttributeError, OSError) as error:
            raise DatasetError(f"{path}: no leaderboard that can be read ({type(error).__name__}: {error})") from None
        if board.version != VERSION or board.settings != settings:
            raise DatasetError(f"{path}: holds results of another version or other settings; choose another file")
        return board

    def entry(self, policy: BenchmarkPolicy) -> Entry:
        """Return what is known of a policy; nothing of an earlier policy of this name."""
        for one in self.entries:
            if (one.policy, one.sha256) == (policy.name, policy.sha256):
                return one
        return Entry(policy.name, policy.sha256, __version__)

    def has(self, policy: BenchmarkPolicy, motion: str, content: str) -> bool:
        """Return whether a policy's results on a motion are here already."""
        known = any(one.motion == motion for one in self.entry(policy).results)
        return known and self.motions.get(motion) == content

    def with_results(self, policy: BenchmarkPolicy, content: str, results: list[MotionResult]) -> "Leaderboard":
        """Return the board with a policy's results on one motion.

        Raises:
            DatasetError: the board has this motion with other rollouts.
        """
        motion = results[0].motion
        if self.motions.get(motion, content) != content:
            raise DatasetError(f"{motion}: the leaderboard has it with other rollouts; choose another file")
        before = self.entry(policy)
        kept = tuple(one for one in before.results if one.motion != motion)
        entry = Entry(before.policy, before.sha256, __version__, (*kept, *results))
        others = tuple(one for one in self.entries if one.policy != policy.name)
        return Leaderboard(self.settings, {**self.motions, motion: content}, (*others, entry))

    def write(self, path: Path) -> None:
        """Write the file."""
        with atomic_file(path) as temporary:
            temporary.write_text(json.dumps(without_nan(asdict(self)), indent=1, allow_nan=False) + "\n")


def read_result(values: dict[str, Any]) -> MotionResult:
    """Return a result as it was before ``without_nan``."""

    def number(value: Any) -> float:
        return math.nan if value is None else float(value)

    estimates = {
        name: Estimate(number(one["value"]), number(one["low"]), number(one["high"]), int(one["count"]))
        for name, one in values["estimates"].items()
    }
    data = {name: number(value) for name, value in values["data"].items()}
    return MotionResult(str(values["motion"]), str(values["split"]), str(values["condition"]), estimates, data)


def draw(board: Leaderboard, path: Path) -> Path:
    """Draw the scores of all policies by split and condition, and return the picture's path."""
    figure = new_figure(9.0, 0.6 + 0.5 * max(4, len(board.entries)))
    panels = figure.subplots(1, 2, sharey=True)
    for axes, name in zip(panels, (SCORE, SURVIVAL), strict=True):
        for index, (split, condition) in enumerate(groups(board)):
            values = [entry.mean(split, condition, name) for entry in board.entries]
            places = np.arange(len(values)) + 0.2 * index
            axes.barh(places, values, 0.18, color=COLOURS[index], label=f"{split}, {condition}")
        axes.set_yticks(np.arange(len(board.entries)) + 0.3, [entry.policy for entry in board.entries])
        axes.set_xlim(0.0, 1.05)
        axes.set_xlabel(f"{name} [1]")
        axes.grid(axis="x", color="0.9")
    panels[0].invert_yaxis()
    panels[1].legend(fontsize="small")
    return save(figure, path)


def groups(board: Leaderboard) -> list[tuple[str, str]]:
    """Return the splits and conditions that a board has results of."""
    there = {one.split for entry in board.entries for one in entry.results}
    return [(split, condition) for split in ("train", "held_out") if split in there for condition in CONDITIONS]


def mean(values: list[float]) -> float:
    """Return the mean of the numbers there are, NaN for none."""
    return float(np.nanmean(values)) if not np.isnan(values).all() else float("nan")
