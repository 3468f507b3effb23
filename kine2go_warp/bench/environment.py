"""How fast the environment steps, where the time goes, and how plain MuJoCo compares."""

from dataclasses import replace
from typing import Any

import numpy as np
import torch
import warp as wp
from mujoco.rollout import rollout

from kine2go_warp.bench.measurement import BenchReport, Measurement, resident_memory, timed
from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.environment import ImitationEnvironment
from kine2go_warp.env.mujoco_engine import position_driven_model
from kine2go_warp.learning.vec_env import ImitationVecEnv, share_stream
from kine2go_warp.motions.clip import MotionClip
from kine2go_warp.robots.compiled import mujoco
from kine2go_warp.training.parallel import ParallelVecEnv

OUTPUT_NOISE = 0.4
"""Standard deviation of the random outputs that drive the robots: that of an untrained policy."""


def bench_environment(
    clip: MotionClip, config: EnvConfig, device: str, repeats: int, steps: int, processes: int
) -> BenchReport:
    """Step the environment with random outputs.

    Args:
        clip: What to track.
        config: Settings.
        device: Where to simulate.
        repeats: How often everything is measured, in turn with what it is compared with.
        steps: Control steps of each measurement.
        processes: If more than one, also measure as many processes that share the worlds.
    """
    share_stream(device)
    before = used_memory(device)
    environment = ImitationEnvironment([clip], config, device)
    memory = used_memory(device) - before
    outputs = random_outputs(environment)

    def synchronise() -> None:
        wp.synchronize_device(environment.device)

    def run() -> None:
        for step in range(steps):
            wp.copy(environment.action, outputs[step % len(outputs)])
            environment.step()

    without_physics = environment.capture_step(simulate=False)

    def run_without_physics() -> None:
        for _ in range(steps):
            wp.capture_launch(without_physics)

    native = NativeRunner(environment, steps) if environment.device.is_cpu else None
    parallel = ParallelRunner(clip, config, processes, steps) if processes > 1 and environment.device.is_cpu else None
    times: dict[str, list[float]] = {"step": [], "kernels": [], "native": [], "single": [], "parallel": []}
    run()
    for _ in range(repeats):
        times["step"].append(timed(run, synchronise))
        times["kernels"].append(timed(run_without_physics, synchronise))
        if native is not None:
            times["native"].append(timed(native.run))
        if parallel is not None:
            times["single"].append(timed(parallel.run_single))
            times["parallel"].append(timed(parallel.run_parallel))
    environment.restart(config.seed)
    measurements = summarise(times, config.num_worlds * steps, NativeRunner.WORLDS * steps, processes)
    measurements.append(Measurement("memory", "MB", (memory,), "resident set" if device == "cpu" else "of the device"))
    if parallel is not None:
        parallel.close()
    settings = {"worlds": config.num_worlds, "steps": steps, "repeats": repeats, "processes": processes}
    return BenchReport("env", device, settings, tuple(measurements))


def summarise(times: dict[str, list[float]], world_steps: int, native_steps: int, processes: int) -> list[Measurement]:
    """Return rates and ratios from the durations of each repeat."""

    def rates(name: str, count: int) -> tuple[float, ...]:
        return tuple(count / value for value in times[name])

    def ratios(one: str, other: str, factor: float = 1.0) -> tuple[float, ...]:
        return tuple(factor * a / b for a, b in zip(times[one], times[other], strict=True))

    shares = ratios("kernels", "step")
    found = [
        Measurement("environment", "steps/s", rates("step", world_steps), "control steps of all worlds"),
        Measurement("share of physics", "1", tuple(1.0 - share for share in shares), "solver and motors"),
        Measurement("share of kernels", "1", shares, "reference, rewards, resets, observations"),
    ]
    if times["native"]:
        note = "plain MuJoCo C, one thread, physics alone"
        found.append(Measurement("MuJoCo C", "steps/s", rates("native", native_steps), note))
        ratio = ratios("native", "step", world_steps / native_steps)
        found.append(Measurement("environment / MuJoCo C", "1", ratio, "both in this run, by repeat"))
    if times["parallel"]:
        found.append(Measurement("one process", "steps/s", rates("single", world_steps), "as RSL-RL steps it"))
        note = f"{processes} processes share the worlds"
        found.append(Measurement("processes", "steps/s", rates("parallel", world_steps), note))
        found.append(Measurement("processes / one process", "1", ratios("single", "parallel"), "by repeat"))
    return found


def used_memory(device: str) -> float:
    """Return the memory in use [MB]: of this process, or of the whole GPU."""
    if device == "cpu":
        return resident_memory()
    free, total = torch.cuda.mem_get_info(device)
    return (total - free) / 1e6


def random_outputs(environment: ImitationEnvironment, count: int = 8) -> list[wp.array[Any]]:
    """Return random outputs of the policy on the device."""
    rng = np.random.default_rng(0)
    shape = environment.action.shape
    draws = (rng.normal(0.0, OUTPUT_NOISE, shape) for _ in range(count))
    return [wp.array(draw, dtype=float, device=environment.device) for draw in draws]


class NativeRunner:
    """Steps the same model in plain MuJoCo with MuJoCo's own position actuators, from states of the environment."""

    WORLDS = 128
    """Their number does not change the rate."""

    def __init__(self, environment: ImitationEnvironment, steps: int, threads: int = 1) -> None:
        config = environment.config
        self.model = position_driven_model(environment.spec, config)
        self.data = [mujoco.MjData(self.model) for _ in range(threads)]
        joint_q = environment.robot.joint_q.numpy()[: self.WORLDS]
        states = []
        for row in range(self.WORLDS):
            mujoco.mj_resetData(self.model, self.data[0])
            placed = joint_q[row % len(joint_q)]
            self.data[0].qpos[:] = placed[[0, 1, 2, 6, 3, 4, 5, *range(7, 19)]]
            states.append(self.state())
        self.initial = np.array(states)
        targets = np.random.default_rng(0).normal(0.0, OUTPUT_NOISE, (self.WORLDS, steps, 12))
        targets = joint_q[np.arange(self.WORLDS) % len(joint_q), None, 7:] + config.action.scale * targets
        self.control = np.repeat(targets, config.substeps, axis=1)

    def state(self) -> np.ndarray:
        """Return MuJoCo's whole state."""
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.zeros(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data[0], state, kind)
        return state

    def run(self) -> None:
        """Step all worlds, each thread some of them one after another."""
        rollout(self.model, self.data, self.initial, self.control)


class ParallelRunner:
    """Steps one environment in this process, and the same one shared by several."""

    def __init__(self, clip: MotionClip, config: EnvConfig, processes: int, steps: int) -> None:
        self.single = ImitationVecEnv(ImitationEnvironment([clip], config, "cpu"))
        self.parallel = ParallelVecEnv([clip], replace(config), processes)
        self.actions = OUTPUT_NOISE * torch.randn(8, config.num_worlds, 12, generator=torch.Generator().manual_seed(0))
        self.steps = steps
        self.run_single()
        self.run_parallel()

    def run_single(self) -> None:
        """Step with one process."""
        for step in range(self.steps):
            self.single.step(self.actions[step % 8])

    def run_parallel(self) -> None:
        """Step with all processes."""
        for step in range(self.steps):
            self.parallel.step(self.actions[step % 8])

    def close(self) -> None:
        """End the other processes."""
        self.parallel.close()
