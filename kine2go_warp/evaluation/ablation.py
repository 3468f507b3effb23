"""Trainings that differ in a few settings each, over several clips and seeds: a loop of ``train`` and ``evaluate``.

Each training has a policy folder of its own, ``OUT/CLIP/VARIANT/seed-N``, with its TensorBoard log and, in
``ablation.json``, what its evaluation found.
"""

import json
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.evaluation.config import EvalConfig
from kine2go_warp.files import atomic_file
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import Preset, base_preset
from kine2go_warp.learning.stopping import TARGETS
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.settings import check_ranges, content_hash, from_dictionary, to_dictionary
from kine2go_warp.tables import make_table, markdown
from kine2go_warp.toml import place_in, read_toml

BUNDLED = Path(__file__).with_suffix(".toml")
RESULT_FILE = "ablation.json"
DETERMINISTIC, STOCHASTIC = "deterministic, plain", "stochastic, plain"

COLUMNS = (
    ("tracked [%]", DETERMINISTIC, "tracked", 100.0),
    ("survival [%]", DETERMINISTIC, "survival", 100.0),
    ("noisy survival [%]", STOCHASTIC, "survival", 100.0),
    ("joint RMSE [rad]", DETERMINISTIC, "joint_rmse", 1.0),
    ("root error [cm]", DETERMINISTIC, "root_error", 100.0),
    ("action rate [rad]", DETERMINISTIC, "action_rate", 1.0),
    ("saturated [%]", DETERMINISTIC, "torque_saturation", 100.0),
    ("power [W]", DETERMINISTIC, "power", 1.0),
)
"""Title, condition, name of the value, and factor to the title's unit."""


@dataclass(frozen=True)
class Variant:
    """A training under some changed settings."""

    name: str
    about: str
    """What is changed, in words."""
    preset: Preset


@dataclass(frozen=True)
class AblationConfig:
    """Settings of an ablation."""

    steps: int = 245_760
    """Environment steps of each training."""
    until_targets: bool = False
    """Whether a training stops as soon as its policy tracks, as its preset says, and at the latest after ``steps``."""
    seeds: int = 3
    """Trainings of each variant and clip, with the seeds 1, 2, ..."""
    rollouts: int = 16
    """Rollouts of each policy under each condition."""

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            Kine2GoError: a value is outside.
        """
        check_ranges(self, steps=(1, 10**12), seeds=(1, 10_000), rollouts=(1, 1_000_000))

    @property
    def evaluation(self) -> EvalConfig:
        """How policies are evaluated: 20 s within the limits of gathering."""
        return EvalConfig(worlds=self.rollouts, max_distance=0.4, max_angle=0.5)

    def preset(self, variant: Variant, seed: int, device: str) -> Preset:
        """Return the settings of one training, which has at most as many steps as all others."""
        preset = variant.preset.on(device)
        iterations = round(self.steps / (preset.env.num_worlds * preset.ppo.num_steps_per_env))
        interval = preset.stopping.interval if self.until_targets else 0
        return preset.override({"env.seed": seed, "ppo.iterations": max(1, iterations), "stopping.interval": interval})


@dataclass(frozen=True)
class Trial:
    """One training that is wanted, and where its policy lies."""

    variant: Variant
    clip: MotionClip
    seed: int
    policy: PolicyFolder

    @property
    def label(self) -> str:
        """What it is, in a few words."""
        return f"{self.clip.name} {self.variant.name} seed {self.seed}"


def load_variants(path: Path, wanted: Sequence[str] = ()) -> list[Variant]:
    """Read variants from a TOML file.

    Args:
        path: The file: ``preset = NAME``, settings of all variants in ``[base]``, those that one changes in
            ``[variants.NAME]``.
        wanted: Names of those to return, by default all.

    Raises:
        Kine2GoError: the file cannot be read, a setting is wrong, or there is no variant of a name.
    """
    values, text = read_toml(path)
    base = base_preset(values, str(path))
    base = from_dictionary(Preset, values.get("base", {}), str(path), locate=partial(place_in, text), base=base)
    sections = values.get("variants")
    if not isinstance(sections, dict) or not sections or not all(isinstance(one, dict) for one in sections.values()):
        raise Kine2GoError(f"{path}: names no variants; write a section [variants.NAME] for each")
    for name in wanted:
        if name not in sections:
            raise Kine2GoError(f"{path}: unknown variant '{name}'; known are: {', '.join(sections)}")
    found = []
    for name, section in sections.items():
        about = str(section.pop("about", ""))

        def locate(key: str, name: str = name) -> str:
            return place_in(text, f"variants.{name}.{key}" if key else f"variants.{name}")

        preset = from_dictionary(Preset, section, str(path), Kine2GoError, locate, base)
        if name in wanted or not wanted:
            found.append(Variant(name, about, preset))
    return found


def trials(
    clips: Sequence[MotionClip], variants: Sequence[Variant], config: AblationConfig, out: Path
) -> Iterator[Trial]:
    """Yield the trainings, variant by variant, so that those that are done can be compared."""
    for variant in variants:
        for clip in clips:
            for seed in range(1, config.seeds + 1):
                yield Trial(variant, clip, seed, PolicyFolder(out / clip.name / variant.name / f"seed-{seed}"))


def run_trial(trial: Trial, config: AblationConfig, device: str, **training: Any) -> None:
    """Train and evaluate a policy, or what is missing of that, and keep what the evaluation found.

    Args:
        trial: The training.
        config: Settings.
        device: Where to train.
        training: Further arguments of ``train``, such as ``processes`` and ``on_progress``.

    Raises:
        TrainingInterrupted: ``should_stop`` said so; the same call continues.
    """
    from kine2go_warp.evaluation.evaluate import evaluate
    from kine2go_warp.training.train import train

    policy, preset = trial.policy, config.preset(trial.variant, trial.seed, device)
    record = train([trial.clip], preset, policy.path, device, overwrite=True, **training)
    key = content_hash(policy.checkpoint_hash(), to_dictionary(config.evaluation))
    if (read_result(policy) or {}).get("key") == key:
        return
    rows = config.evaluation.rows(preset.env.control_rate, trial.clip)
    values = {}
    for one in evaluate(policy, config.evaluation, device):
        found = {name: one.estimate(name).value for name in one.metrics}
        found |= {"survival": one.survival.value, "tracked": float(one.length.mean()) / rows}
        # Rollouts that end at once have no metrics; JSON knows no NaN.
        values[one.condition] = {name: value for name, value in found.items() if value == value}  # noqa: PLR0124
    made = {"iterations": record.iterations, "core_seconds": record.core_seconds, "stopped": record.stop_reason}
    result = {"key": key, "variant": trial.variant.name, "seed": trial.seed, **made, **values}
    with atomic_file(policy.path / RESULT_FILE) as temporary:
        temporary.write_text(json.dumps(result, indent=1) + "\n")


def read_result(policy: PolicyFolder) -> dict[str, Any] | None:
    """Return what the evaluation of a policy found, none if there is nothing that can be read."""
    try:
        return json.loads((policy.path / RESULT_FILE).read_text())
    except (OSError, ValueError):
        return None


def ablation_table(motion: str, variants: Sequence[Variant], out: Path) -> str:
    """Return a Markdown table of one motion: medians over seeds, with least and greatest of what differs most."""
    made = ("iterations", "core [s]", "targets reached")
    headings, rows = ("variant", *(column[0] for column in COLUMNS), *made, "seeds"), []
    for variant in variants:
        folders = sorted((out / motion / variant.name).glob(f"seed-*/{RESULT_FILE}"))
        found = [result for path in folders if (result := read_result(PolicyFolder(path.parent))) is not None]
        if found:
            cells = [cell(found, *column) for column in COLUMNS]
            cells += [spread_of([result[name] for result in found]) for name in ("iterations", "core_seconds")]
            reached = sum(result["stopped"] == TARGETS for result in found)
            rows.append((f"`{variant.name}`", *cells, reached, len(found)))
    return f"`{motion}`\n\n{markdown(make_table('', headings, rows))}"


def cell(found: Sequence[dict[str, Any]], _title: str, condition: str, name: str, factor: float) -> str:
    """Return the median of one value over the seeds of a variant."""
    values = [factor * result[condition][name] for result in found if name in result[condition]]
    if not values:
        return "-"
    return spread_of(values) if name == "tracked" else number(statistics.median(values))


def spread_of(values: Sequence[float]) -> str:
    """Return the median of some values, and the least and the greatest where they differ."""
    spread = f" ({number(min(values))} to {number(max(values))})" if min(values) < max(values) else ""
    return number(statistics.median(values)) + spread


def number(value: float) -> str:
    """Return a number with about three significant digits."""
    digits = 3 if abs(value) < 0.2 else 2 if abs(value) < 2.0 else 1 if abs(value) < 100.0 else 0
    return f"{value:.{digits}f}" if value else "0"
