"""How fast motions are retargeted."""

from collections.abc import Sequence
from pathlib import Path

from kine2go_warp.bench.measurement import BenchReport, Measurement, timed
from kine2go_warp.motions.catalogue_entry import CatalogueEntry
from kine2go_warp.motions.config import RetargetConfig
from kine2go_warp.motions.inverse_kinematics import InverseKinematics
from kine2go_warp.motions.retarget import retarget
from kine2go_warp.motions.sources.base import forget_files
from kine2go_warp.robots import robot_named


def bench_retargeting(entries: Sequence[CatalogueEntry], folder: Path | None, repeats: int, robot: str) -> BenchReport:
    """Retarget motions in both modes on one core, each file read once."""
    spec, measurements, frames = robot_named(robot), [], 0
    for mode in ("plain", "contact"):
        solver, config = InverseKinematics(spec), RetargetConfig(mode=mode)
        frames = retarget_all(entries, folder, solver, config)
        durations = [timed(lambda: retarget_all(entries, folder, solver, config)) for _ in range(repeats)]  # noqa: B023
        measurements.append(Measurement(mode, "frames/s", tuple(frames / duration for duration in durations)))
    settings = {"robot": robot, "motions": len(entries), "frames": frames, "repeats": repeats}
    return BenchReport("retarget", "cpu", settings, tuple(measurements))


def retarget_all(
    entries: Sequence[CatalogueEntry], folder: Path | None, solver: InverseKinematics, config: RetargetConfig
) -> int:
    """Retarget motions, reading each file once, and return how many frames they have."""
    forget_files()
    return sum(retarget(entry, folder, solver, config).clip.num_frames for entry in entries)
