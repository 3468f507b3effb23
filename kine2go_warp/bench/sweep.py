"""How speed, memory and start depend on the number of worlds, against plain MuJoCo C on all cores."""

import os
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
import warp as wp
from torch.utils._python_dispatch import TorchDispatchMode

from kine2go_warp.bench.environment import NativeRunner, random_outputs, used_memory
from kine2go_warp.bench.measurement import BenchReport, Measurement, timed
from kine2go_warp.bench.training import bench_training
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.learning.presets import Preset
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.scores.plots import new_figure, save

SLOWEST_KERNELS = 10
"""Kernels that are listed by the share of their time."""
ENVIRONMENT, TRAINING, NATIVE = "environment", "training", "MuJoCo C"


def bench_sweep(
    clip: MotionClip, preset: Preset, device: str, counts: tuple[int, ...], repeats: int, steps: int
) -> BenchReport:
    """Measure several numbers of worlds, one after the other in one process.

    The start is the time from the settings to the end of the first step; where the cache of kernels is empty, that of
    the first number is a cold one.

    Args:
        clip: What to track.
        preset: Settings of environment and learner.
        device: Where to simulate.
        counts: Numbers of worlds.
        repeats: How often everything is measured, in turn with what it is compared with.
        steps: Control steps of each measurement.
    """
    share_stream(device)
    found: list[Measurement] = []
    cores = len(os.sched_getaffinity(0))
    for count in counts:
        config = replace(preset.env, num_worlds=count).on(device)
        before, started = used_memory(device), time.perf_counter()
        environment = ImitationEnvironment([clip], config, device)
        outputs = random_outputs(environment)

        def run(environment: ImitationEnvironment = environment, outputs: list[wp.array[Any]] = outputs) -> None:
            for step in range(steps):
                wp.copy(environment.action, outputs[step % len(outputs)])
                environment.step()

        def synchronise(environment: ImitationEnvironment = environment) -> None:
            wp.synchronize_device(environment.device)

        environment.step()
        synchronise()
        start, memory = time.perf_counter() - started, used_memory(device) - before
        native = NativeRunner(environment, steps, threads=cores)
        run()
        times = [(timed(run, synchronise), timed(native.run)) for _ in range(repeats)]
        waits = host_waits(ImitationVecEnv(environment))
        kernels = kernel_shares(environment) if environment.device.is_cuda else {}
        del environment, outputs, run, synchronise, native
        trained = bench_training(clip, replace(preset, env=config), device, repeats, 1)
        for name, unit, values, note in (
            ("start", "s", (start,), "build, kernels, graph, first step"),
            ("step", "ms", tuple(1e3 * ours / steps for ours, _ in times), ""),
            (ENVIRONMENT, "steps/s", tuple(count * steps / ours for ours, _ in times), ""),
            (TRAINING, "steps/s", trained.values_of("training"), "learning included"),
            (NATIVE, "steps/s", tuple(NativeRunner.WORLDS * steps / c for _, c in times), f"{cores} threads, physics"),
            ("memory", "MB", (memory,), "environment"),
            ("memory, training", "MB", trained.values_of("memory"), "environment and learner"),
            ("host waits", "1", (float(waits),), "of a step as RSL-RL makes it"),
            *((f"kernel {kernel}", "1", (share,), "of a step's kernels") for kernel, share in kernels.items()),
        ):
            found.append(Measurement(f"{count} worlds: {name}", unit, values, note))
    settings = {"preset": preset.preset, "repeats": repeats, "steps": steps, "seed": str(preset.env.seed)}
    settings |= {"constraint rows a world": preset.env.max_constraints, "worlds": ", ".join(map(str, counts))}
    return BenchReport("sweep", device, settings, tuple(found))


class HostWaits(TorchDispatchMode):
    """Counts the operations of torch whose result the host reads, on any device."""

    READING = ("_local_scalar_dense", "nonzero", "masked_select", "is_nonzero", "equal", "unique")

    def __init__(self) -> None:
        super().__init__()
        self.count = 0

    def __torch_dispatch__(self, function, types, arguments=(), keywords=None):  # noqa: ANN001, ANN204
        self.count += function.overloadpacket.__name__ in self.READING
        return function(*arguments, **(keywords or {}))


def host_waits(env: ImitationVecEnv) -> int:
    """Return how often a step, as RSL-RL makes it, waits for the device."""
    actions = torch.zeros(env.num_envs, env.num_actions, device=env.device)
    with HostWaits() as waits:
        env.step(actions)
    return waits.count


def kernel_shares(environment: ImitationEnvironment) -> dict[str, float]:
    """Return the share of a step's time that its slowest kernels take on a GPU, launched one by one."""
    eager = ImitationEnvironment(environment.clips, environment.config, str(environment.device), use_graph=False)
    eager.step()
    wp.timing_begin(cuda_filter=wp.TIMING_KERNEL)
    eager.step()
    return shares_of([(one.name, one.elapsed) for one in wp.timing_end()])


def shares_of(launches: list[tuple[str, float]]) -> dict[str, float]:
    """Return the shares of the slowest kernels in the time of all launches, which are given by name and time."""
    times: Counter[str] = Counter()
    for name, elapsed in launches:
        times[name] += elapsed  # pyright: ignore[reportArgumentType]
    return {name: elapsed / times.total() for name, elapsed in times.most_common(SLOWEST_KERNELS)}


def draw_sweep(report: BenchReport, path: Path) -> None:
    """Draw the rates over the number of worlds, with the range of the repeats."""
    figure = new_figure(7.0, 4.5)
    axes = figure.subplots()
    for name in (ENVIRONMENT, TRAINING, NATIVE):
        rows = [one for one in report.measurements if one.name.endswith(f" worlds: {name}")]
        counts = [int(one.name.split()[0]) for one in rows]
        middle = [one.median for one in rows]
        spread = [[one.median - one.spread[0] for one in rows], [one.spread[1] - one.median for one in rows]]
        axes.errorbar(counts, middle, spread, marker="o", capsize=3.0, label=name)
        axes.set(xscale="log", yscale="log")
        axes.set_xticks(counts, [f"{count:,}" for count in counts])
        axes.set_xticks([], minor=True)
    axes.set(xlabel="worlds", ylabel="control steps of all worlds [1/s]")
    axes.set_title(f"{report.as_record()['machine']['device']}, preset {report.settings['preset']}")
    axes.grid(which="both", alpha=0.3)
    axes.legend()
    save(figure, path)
