"""The command that measures speed."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import tyro

from kine2go_warp.cli.data import CatalogueFile, Device, Robot, data_folder
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.robots import DEFAULT_ROBOT

if TYPE_CHECKING:
    from kine2go_warp.bench.measurement import BenchReport
    from kine2go_warp.motions.clip import MotionClip

Stage = Literal["env", "train", "retarget", "gather", "load", "sweep"]


CPU_SWEEP = (20, 128, 512, 2048)
"""Numbers of worlds of a sweep on a CPU; a GPU takes more besides."""


@dataclass(frozen=True)
class Bench:
    """Measure how fast stages are on this machine.

    Example: kine2go bench retarget
    """

    stages: tyro.conf.Positional[tuple[Stage, ...]]
    """env: the environment with random actions, and plain MuJoCo C on the same model; train: PPO; retarget: all
    motions that are there; gather: rollouts from simulation to dataset; load: random windows of --dataset; sweep: env
    and train with several numbers of worlds, against plain MuJoCo C on all cores."""
    data: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None
    """Folder of the source clips; by default the environment variable KINE2GO_DATA, without which the bundled clip
    alone is measured."""
    catalogue: CatalogueFile = None
    clip: Annotated[Path | None, tyro.conf.arg(metavar="CLIP")] = None
    """Clip that env, train and gather track; by default the bundled one, for which placo is needed."""
    device: Device = None
    num_worlds: int | None = None
    """Worlds simulated at once; by default 512 on a CPU and 8192 on a GPU."""
    preset: Literal["fast", "paper", "robust"] = "fast"
    """Settings of environment and learner."""
    processes: int = 1
    """Processes that share the simulation on a CPU; with more than one, env compares them with one."""
    steps: int = 24
    """Control steps of each measurement of env."""
    rows: int = 571
    """Rows of a rollout of gather."""
    dataset: Annotated[Path | None, tyro.conf.arg(metavar="DATASET")] = None
    """Dataset to load."""
    robot: Robot = DEFAULT_ROBOT
    worlds: tuple[int, ...] = ()
    """Numbers of worlds of sweep; by default from 20 to 2048 on a CPU, to 65536 on a GPU."""
    picture: Path | None = None
    """File that sweep draws its rates into."""
    repeats: int = 5
    """How often everything is measured."""
    json: bool = False
    """Print JSON instead of tables."""

    def run(self) -> int:
        """Measure and print medians and spreads."""
        from kine2go_warp.cli.tables import console, print_bench

        if not self.stages:
            raise Kine2GoError(f"name at least one of {', '.join(get_args(Stage))}")
        if min(self.repeats, self.steps, self.processes, self.rows) < 1:
            raise Kine2GoError("repeats, steps, processes and rows must be at least 1")
        if any(count < 1 for count in self.worlds):
            raise Kine2GoError(f"worlds is {list(self.worlds)}; each must be at least 1")
        if self.num_worlds is not None and self.num_worlds < 1:
            raise Kine2GoError(f"num-worlds is {self.num_worlds}; it must be at least 1")
        reports = [self._measure(stage) for stage in self.stages]
        if self.json:
            console().print_json(json.dumps([report.as_record() for report in reports]))
        else:
            for report in reports:
                print_bench(report)
        return 0

    def _measure(self, stage: Stage) -> "BenchReport":
        """Run one benchmark."""
        from kine2go_warp.cli.commands import limit_threads
        from kine2go_warp.motions.catalogue import load_catalogue

        if stage == "retarget":
            from kine2go_warp.bench.retargeting import bench_retargeting

            folder = data_folder(self.data)
            entries = [entry for entry in load_catalogue(self.catalogue).values() if entry.is_there(folder)]
            return bench_retargeting(entries, folder, self.repeats, self.robot)

        if stage == "load":
            from kine2go_warp.dataset import open_dataset

            if self.dataset is None:
                raise Kine2GoError("load needs --dataset")
            open_dataset(self.dataset)
            from kine2go_warp.bench.loading import bench_loading

            limit_threads()
            return bench_loading(self.dataset, self.repeats)

        from kine2go_warp.bench.environment import bench_environment
        from kine2go_warp.bench.gathering import bench_gathering
        from kine2go_warp.bench.training import bench_training
        from kine2go_warp.device import choose_device
        from kine2go_warp.learning.presets import find_preset

        limit_threads()
        device = choose_device(self.device)
        num_worlds = self.num_worlds or (512 if device == "cpu" else 8192)
        preset = find_preset(self.preset)
        preset = replace(preset, env=replace(preset.env, num_worlds=num_worlds))
        clip = self._tracked()
        if stage == "env":
            return bench_environment(clip, preset.env, device, self.repeats, self.steps, self.processes)
        if stage == "sweep":
            from kine2go_warp.bench.sweep import bench_sweep, draw_sweep

            counts = self.worlds or (CPU_SWEEP if device == "cpu" else (*CPU_SWEEP, 4096, 8192, 16384, 32768, 65536))
            report = bench_sweep(clip, preset, device, counts, self.repeats, self.steps)
            if self.picture is not None:
                draw_sweep(report, self.picture)
            return report
        if stage == "gather":
            num_worlds = self.num_worlds or (64 if device == "cpu" else 4096)
            return bench_gathering(clip, device, self.repeats, num_worlds, self.rows)
        return bench_training(clip, preset, device, self.repeats, self.processes)

    def _tracked(self) -> "MotionClip":
        """Return the clip given, or the bundled one on the robot."""
        from kine2go_warp.motions.clip import MotionClip

        if self.clip is not None:
            return MotionClip.load(self.clip)
        from kine2go_warp.motions.catalogue import motion_named
        from kine2go_warp.motions.config import RetargetConfig
        from kine2go_warp.motions.inverse_kinematics import InverseKinematics
        from kine2go_warp.motions.retarget import retarget
        from kine2go_warp.robots import robot_named

        solver = InverseKinematics(robot_named(self.robot))
        return retarget(motion_named("dog_trot"), None, solver, RetargetConfig()).clip
