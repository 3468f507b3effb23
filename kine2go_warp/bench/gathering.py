"""How fast rollouts are gathered and written, and whether the simulation waits for the disk."""

import tempfile
from pathlib import Path
from typing import Any

from kine2go_warp.bench.measurement import BenchReport, Measurement
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.learning.policy import PolicyFolder
from kine2go_warp.learning.presets import FAST
from kine2go_warp.metrics import FILTER_METRICS
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import GatherResult, gather
from kine2go_warp.training.train import train

NO_LIMIT = 1e9


def bench_gathering(clip: MotionClip, device: str, repeats: int, num_worlds: int, rows: int) -> BenchReport:
    """Gather rollouts of a policy after one iteration, none of them rejected for how it tracks.

    Args:
        clip: What to track.
        device: Where to simulate.
        repeats: How often.
        num_worlds: Rollouts at once.
        rows: Rows of each.
    """
    limits: dict[str, Any] = {metric.setting: NO_LIMIT for metric in FILTER_METRICS}
    results: list[GatherResult] = []
    size = 0
    with tempfile.TemporaryDirectory() as folder:
        policy = PolicyFolder(Path(folder) / "policy")
        train([clip], FAST.override({"env.num_worlds": 16, "ppo.iterations": 1}), policy.path, device)
        for seed in range(repeats):
            config = GatherConfig(trajectories=num_worlds, rows=rows, seed=seed, max_attempts=1.0, **limits)
            store = Path(folder) / f"{seed}.zarr"
            results.append(gather(policy, DatasetWriter(store, clip.spec), config, device))
            size = sum(path.stat().st_size for path in store.rglob("*") if path.is_file())
    accepted = max(results[-1].accepted, 1)
    measurements = (
        Measurement("gathering", "rows/s", tuple(one.rows_per_second for one in results), "simulated and recorded"),
        Measurement("written to the disk", "MB/s", tuple(one.megabytes_per_second for one in results)),
        Measurement("waiting for the disk", "1", tuple(one.waiting_share for one in results), "share of that time"),
        Measurement("writing the dataset", "s", tuple(one.write_time for one in results), "afterwards"),
        Measurement("size of a trajectory", "kB", (size / 1e3 / accepted,), f"compressed, of {rows} rows"),
    )
    settings = {"worlds": num_worlds, "rows": rows, "repeats": repeats}
    return BenchReport("gather", device, settings, measurements)
