"""How much watching a training slows it."""

import contextlib
import io
import tempfile
import time
from pathlib import Path

import torch

from kine2go_warp.bench.measurement import BenchReport, Measurement
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.parallel import ParallelVecEnv
from kine2go_warp.learning.presets import Preset
from kine2go_warp.learning.runner import ImitationRunner, TrainingProgress
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.learning.watching import Audience, Watcher
from kine2go_warp.motions.clip import MotionClip

WARM_UP = 2
"""Iterations that are not counted."""
BLOCK = 3
"""Iterations of a block: few, so that what else the machine does meets neighbours alike."""
SETTLE = 1.0
"""Pause after a block, in which what was seen is drawn to the end [s]."""


def bench_watching(
    clip: MotionClip, preset: Preset, device: str, repeats: int, processes: int, audience: Audience
) -> BenchReport:
    """Train in blocks, in turn watched and not, and compare neighbours.

    Every control step of a watched block is shown, without the pauses that there are otherwise.

    Args:
        clip: What to track.
        preset: Settings of environment and learner.
        device: Where to train.
        repeats: Pairs of blocks.
        processes: Processes that share the simulation.
        audience: Who watches.
    """
    share_stream(device)
    torch.manual_seed(0)
    if processes > 1:
        env = ParallelVecEnv([clip], preset.env, processes)
    else:
        env = ImitationVecEnv(ImitationEnvironment([clip], preset.env, device))
    watcher = Watcher(env, audience, 0, interval=0.0)
    times: list[float] = []
    rates: dict[bool, list[float]] = {False: [], True: []}
    efforts: dict[bool, list[float]] = {False: [], True: []}
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        runner = ImitationRunner(env, preset.ppo, Path(folder), preset.env.seed)

        def iteration_done(progress: TrainingProgress) -> None:
            started = time.perf_counter()
            if env.on_step is not None:
                watcher.iteration_done(progress)
            seeing = time.perf_counter() - started
            times.append(progress.collect_time + progress.learn_time + seeing)

        def block(iterations: int, is_watched: bool) -> float:
            """Return the control steps of all worlds in a second."""
            env.on_step = watcher.step_done if is_watched else None
            times.clear()
            before = time.process_time()
            runner.train(runner.current_learning_iteration + iterations, iteration_done)
            time.sleep(SETTLE)
            efforts[is_watched].append((time.process_time() - before) / iterations)
            return len(times) * preset.env.num_worlds * preset.ppo.num_steps_per_env / sum(times)

        block(WARM_UP, True)
        efforts[True].clear()
        for repeat in range(repeats):
            for is_watched in (False, True) if repeat % 2 == 0 else (True, False):
                rates[is_watched].append(block(BLOCK, is_watched))
    env.close()
    slower = tuple(1.0 - watched / alone for watched, alone in zip(rates[True], rates[False], strict=True))
    more = tuple(watched / alone - 1.0 for watched, alone in zip(efforts[True], efforts[False], strict=True))
    measurements = (
        Measurement("training", "steps/s", tuple(rates[False])),
        Measurement("training, watched", "steps/s", tuple(rates[True])),
        Measurement("slowdown", "1", slower, "of neighbouring blocks"),
        Measurement("additional processor time", "1", more, "of this process, what others do left aside"),
    )
    settings = {"worlds": preset.env.num_worlds, "iterations a block": BLOCK, "repeats": repeats}
    return BenchReport("train --rerun", device, {**settings, "processes": processes}, measurements)
