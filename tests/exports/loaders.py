"""Reads exports with the loaders of the programs that they are for, and compares every number with the Zarr store.

Some of these programs want other versions of Python, torch and NumPy than this project. So this file imports nothing of
kine2go_warp, and runs in environments of its own, which it makes with uv:

    python -m tests.exports.loaders DATASET FOLDER [TARGET ...]     # all targets, as a table in Markdown
    python tests/exports/loaders.py check TARGET EXPORT DATASET     # one of them, in its environment
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import zarr

Rows = dict[str, np.ndarray]

CLONES = "KINE2GO_CLONES"
"""Environment variable: a folder with clones of the programs that are in no package registry."""


def matrices(wxyz: np.ndarray) -> np.ndarray:
    """Rotation matrices, by the formula with the skew matrix and not that of the package."""
    wxyz = wxyz.astype(float) / np.linalg.norm(wxyz.astype(float), axis=1, keepdims=True)
    w, v = wxyz[:, :1], wxyz[:, 1:]
    skew = np.zeros((len(v), 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    skew -= skew.transpose(0, 2, 1)
    return np.eye(3) + 2.0 * w[:, :, None] * skew + 2.0 * skew @ skew


def rotation_vectors(turns: np.ndarray) -> np.ndarray:
    """Rotation vectors of rotation matrices that turn by less than half a turn."""
    axis = np.stack([turns[:, i, j] - turns[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1) / 2.0
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, (np.trace(turns, axis1=1, axis2=2)[:, None] - 1.0) / 2.0)
    return axis * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)


def trajectory_rows(group: zarr.Group, index: int) -> Rows:
    """Row arrays of a trajectory, and what the learning views should be."""
    length = int(group["length"][index])
    rows = {
        name: np.asarray(array[index, :length])
        for name, array in group.arrays()
        if array.metadata.dimension_names[:2] == ("trajectory", "frame")
    }
    base, goal = matrices(rows["root_orientation"]), matrices(rows["reference_root_orientation"])
    yaw = np.arctan2(base[:, 1, 0], base[:, 0, 0])
    level = matrices(np.stack([np.cos(yaw / 2), 0 * yaw, 0 * yaw, np.sin(yaw / 2)], axis=1))

    def seen(frame: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        return np.einsum("tji,tj->ti", frame, vectors.astype(float))

    position = rows["root_position"]
    state = [
        position[:, 2:], seen(base, np.tile([0, 0, -1], (length, 1))), seen(base, rows["root_linear_velocity"]),
        seen(base, rows["root_angular_velocity"]), rows["joint_position"], rows["joint_velocity"],
    ]  # fmt: skip
    target = [
        seen(level, rows["reference_root_position"].astype(float) - position),
        rotation_vectors(base.transpose(0, 2, 1) @ goal),
        seen(level, rows["reference_root_linear_velocity"]), seen(level, rows["reference_root_angular_velocity"]),
        rows["reference_joint_position"], rows["reference_joint_velocity"],
    ]  # fmt: skip
    turning = seen(base, rows["root_angular_velocity"])
    return rows | {
        "state": np.concatenate(state, axis=1),
        "goal": np.concatenate(target, axis=1),
        "sum": rows["reward"].sum(axis=1),
        "qpos": np.concatenate([position, rows["root_orientation"], rows["joint_position"]], axis=1),
        "qvel": np.concatenate([rows["root_linear_velocity"], turning, rows["joint_velocity"]], axis=1),
    }


def trajectories(store: Path, motion: str) -> Iterator[Rows]:
    """All trajectories of a motion."""
    group = zarr.open_group(store, mode="r", use_consolidated=False)[motion]
    yield from (trajectory_rows(group, index) for index in range(group["length"].shape[0]))


def motions_of(export: Path) -> list[str]:
    return json.loads((export / "export.json").read_text())["motions"]


class Comparison:
    """Counts the numbers that are equal; the first that is not ends it."""

    def __init__(self) -> None:
        self.numbers = 0

    def equal(self, found: Any, expected: np.ndarray, tolerance: float = 0.0) -> None:
        np.testing.assert_allclose(np.asarray(found, float), np.asarray(expected, float), rtol=0, atol=tolerance)
        self.numbers += np.size(expected)


DERIVED = 1e-5
"""Tolerance of what is computed from the rows: they hold 24 bits, and velocities and positions reach tens."""


def check_lerobot(export: Path, store: Path) -> int:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    dataset, compare = LeRobotDataset("local/go2", root=export), Comparison()
    root = zarr.open_group(store, mode="r", use_consolidated=False)
    total: dict[str, list[np.ndarray]] = {}
    for episode in dataset.meta.episodes:
        rows = trajectory_rows(root[episode["motion"]], episode["trajectory"])
        length = episode["length"]
        wanted = {"observation.state": rows.pop("state"), "observation.environment_state": rows.pop("goal")}
        rows = {name: values for name, values in rows.items() if name not in ("sum", "qpos", "qvel")}
        wanted |= {f"policy.{name}" if name == "action_mean" else name: values for name, values in rows.items()}
        assert set(wanted) == {name for name in dataset.meta.features if "index" not in name and name != "timestamp"}
        found = [dataset[episode["dataset_from_index"] + frame] for frame in range(length)]
        assert {row["task"] for row in found} == set(episode["tasks"])
        assert [int(row["frame_index"]) for row in found] == list(range(length))
        assert {int(row["episode_index"]) for row in found} == {episode["episode_index"]}
        np.testing.assert_allclose(
            [float(row["timestamp"]) for row in found], np.arange(length) / dataset.fps, atol=1e-5
        )
        for name, values in wanted.items():
            read = np.stack([np.ravel(row[name]) for row in found])
            compare.equal(read, values.reshape(length, -1), DERIVED * name.startswith("observation"))
            total.setdefault(name, []).append(values.reshape(length, -1).astype(float))
    for name, parts in total.items():
        for figure in ("mean", "std", "min", "max"):
            expected = getattr(np, figure)(np.concatenate(parts), axis=0)
            np.testing.assert_allclose(dataset.meta.stats[name][figure], expected, rtol=1e-5, atol=1e-5)
    ahead = LeRobotDataset("local/go2", root=export, delta_timestamps={"action": [k / dataset.fps for k in range(16)]})
    assert ahead[0]["action"].shape == (16, 12)
    assert int(ahead[len(ahead) - 1]["action_is_pad"].sum()) == 15
    return compare.numbers


def check_minari(export: Path, store: Path) -> int:
    os.environ["MINARI_DATASETS_PATH"] = str(export)
    import minari

    compare = Comparison()
    for motion in motions_of(export):
        dataset = minari.load_dataset(f"go2/{motion}-v0")
        expected = [rows for rows in trajectories(store, motion) if len(rows["action"]) > 1]
        assert dataset.total_episodes == len(expected)
        assert dataset.total_steps == sum(len(rows["action"]) - 1 for rows in expected)
        for episode, rows in zip(dataset.iterate_episodes(), expected, strict=True):
            compare.equal(episode.observations, np.concatenate([rows["state"], rows["goal"]], axis=1), DERIVED)
            assert dataset.observation_space.contains(episode.observations[0])
            compare.equal(episode.actions, rows["action"][:-1])
            compare.equal(episode.rewards, rows["sum"][:-1], DERIVED)
            assert not episode.terminations.any()
            assert list(np.flatnonzero(episode.truncations)) == [len(rows["action"]) - 2]
        assert len(dataset.sample_episodes(2)) == 2
    return compare.numbers


def check_d4rl(export: Path, store: Path) -> int:
    import h5py

    compare = Comparison()
    for motion in motions_of(export):
        with h5py.File(export / f"{motion}.hdf5") as file:
            data = {name: values[:] for name, values in file.items() if isinstance(values, h5py.Dataset)}
        parts = list(trajectories(store, motion))
        observed = [np.concatenate([rows["state"], rows["goal"]], axis=1) for rows in parts]
        compare.equal(data["observations"], np.concatenate([one[:-1] for one in observed]), DERIVED)
        compare.equal(data["next_observations"], np.concatenate([one[1:] for one in observed]), DERIVED)
        compare.equal(data["actions"], np.concatenate([rows["action"][:-1] for rows in parts]))
        compare.equal(data["rewards"], np.concatenate([rows["sum"][:-1] for rows in parts]), DERIVED)
        ends = np.cumsum([len(one) - 1 for one in observed]) - 1
        assert list(np.flatnonzero(data["timeouts"])) == list(ends)
        assert not data["terminals"].any()
    return compare.numbers


def check_robomimic(export: Path, store: Path) -> int:
    from robomimic.utils.dataset import SequenceDataset
    from robomimic.utils.obs_utils import initialize_obs_utils_with_obs_specs

    keys, values = ["state", "environment_state"], ["actions", "rewards", "dones"]
    initialize_obs_utils_with_obs_specs({"obs": {"low_dim": keys}})
    compare = Comparison()
    for motion in motions_of(export):

        def opened(motion: str = motion, **settings: Any) -> SequenceDataset:
            path = str(export / f"{motion}.hdf5")
            return SequenceDataset(path, obs_keys=keys, dataset_keys=values, hdf5_cache_mode="all", **settings)

        data = opened()
        parts, first = list(trajectories(store, motion)), 0
        for rows in parts:
            count = len(rows["action"]) - 1
            items = [data[first + step] for step in range(count)]
            compare.equal(np.concatenate([item["actions"] for item in items]), rows["action"][:-1])
            compare.equal([float(np.ravel(item["rewards"])[0]) for item in items], rows["sum"][:-1], DERIVED)
            assert [float(np.ravel(item["dones"])[0]) for item in items] == [0.0] * (count - 1) + [1.0]
            for key, name in zip(keys, ("state", "goal"), strict=True):
                compare.equal(np.concatenate([item["obs"][key] for item in items]), rows[name][:-1], DERIVED)
                compare.equal(np.concatenate([item["next_obs"][key] for item in items]), rows[name][1:], DERIVED)
            first += count
        assert len(data) == first
        assert opened(seq_length=16)[0]["actions"].shape == (16, 12)
        sides = [opened(filter_by_attribute=side).n_demos for side in ("train", "valid")]
        assert sum(sides) == len(parts)
        assert min(sides) >= 1
    return compare.numbers


def check_motivo(export: Path, store: Path) -> int:
    sys.path.insert(0, str(Path(os.environ[CLONES]) / "humenv"))
    from humenv.misc.motionlib import MotionBuffer

    keys = ["qpos", "qvel", "observation", "goal", "action"]
    buffer, compare = MotionBuffer(str(export / "motions.txt"), base_path=str(export), keys=keys), Comparison()
    every = [rows for motion in motions_of(export) for rows in trajectories(store, motion)]
    assert list(buffer.get_motion_ids()) == list(range(len(every)))
    for number, rows in enumerate(every):
        found = buffer.get(number)
        for key, name in zip(keys, ("qpos", "qvel", "state", "goal", "action"), strict=True):
            compare.equal(found[key], rows[name], 0.0 if key == "action" else DERIVED)
    assert buffer.sample(64)["observation"].shape == (64, 34)
    return compare.numbers


def check_bfm_zero(export: Path, store: Path) -> int:
    for clone in ("humenv", "BFM-Zero"):
        sys.path.insert(0, str(Path(os.environ[CLONES]) / clone))
    from humanoidverse.agents.buffers.load_data import load_expert_trajectories

    buffer = load_expert_trajectories(export / "motions.txt", export, seq_length=8, device="cpu")
    every = [rows for motion in motions_of(export) for rows in trajectories(store, motion)]
    assert buffer.lengths.tolist() == [len(rows["action"]) for rows in every]
    compare = Comparison()
    for key, name in {"observation": "state", "goal": "goal", "action": "action", "qpos": "qpos"}.items():
        compare.equal(buffer.storage[key].numpy(), np.concatenate([rows[name] for rows in every]), DERIVED)
    return compare.numbers


def check_parquet(export: Path, store: Path) -> int:
    from datasets import load_dataset

    compare = Comparison()
    table = load_dataset(str(export), split="train")
    assert table.features["action"].length == 12
    assert table.features["action"].feature.dtype == "float32"
    whole = table.with_format("numpy")[:]
    every = [rows for motion in motions_of(export) for rows in trajectories(store, motion)]
    assert len(table) == sum(len(rows["action"]) for rows in every)
    for name, source in {
        "observation.state": "state",
        "observation.environment_state": "goal",
        "reward": "sum",
    }.items():
        compare.equal(whole[name], np.concatenate([rows[source] for rows in every]), DERIVED)
    for name in set(every[0]) - {"state", "goal", "sum", "reward", "qpos", "qvel"}:
        expected = np.concatenate([rows[name] for rows in every])
        compare.equal(whole[name], expected.reshape(len(expected), -1).squeeze())
    first = next(iter(load_dataset(str(export), split="train", streaming=True)))
    compare.equal(first["action"], every[0]["action"][0])
    about = load_dataset(str(export), "trajectories", split="train")
    assert len(about) == len(every)
    assert set(about["motion"]) == set(motions_of(export))
    return compare.numbers


def motion_files(export: Path, store: Path) -> Iterator[tuple[Path, Rows]]:
    """Every file of an export for trackers, and the rows that should be in it."""
    for motion in motions_of(export):
        for index, rows in enumerate(trajectories(store, motion)):
            (path,) = (export / motion).glob(f"trajectory-{index:04d}.*")
            yield path, rows


def bodies(rows: Rows, name: str) -> np.ndarray:
    """An array of base and of the twelve links that joints move."""
    return np.concatenate([rows[f"root_{name}"][:, None], rows[f"link_{name}"][:, :12]], axis=1)


XYZW = [1, 2, 3, 0]
POSE = ("root_position", "root_orientation", "joint_position")


def check_mjlab(export: Path, store: Path) -> int:
    import torch
    from mjlab.tasks.tracking.mdp.commands import MotionLoader

    compare = Comparison()
    for path, rows in motion_files(export, store):
        motion = MotionLoader(str(path), torch.arange(13))
        assert list(np.load(path)["body_names"])[:5] == ["base", "FL_hip", "FL_thigh", "FL_calf", "FR_hip"]
        assert float(np.load(path)["fps"][0]) == 60.0
        compare.equal(motion.joint_pos, rows["joint_position"])
        compare.equal(motion.joint_vel, rows["joint_velocity"])
        for found, name in (
            (motion.body_pos_w, "position"), (motion.body_quat_w, "orientation"),
            (motion.body_lin_vel_w, "linear_velocity"), (motion.body_ang_vel_w, "angular_velocity"),
        ):  # fmt: skip
            compare.equal(found, bodies(rows, name))
    return compare.numbers


def check_mimickit(export: Path, store: Path) -> int:
    sys.path.insert(0, str(Path(os.environ[CLONES]) / "MimicKit" / "mimickit"))
    import anim.motion_lib
    from anim.mjcf_char_model import MJCFCharModel

    compare = Comparison()
    for motion in motions_of(export):
        model = export / f"{motion}.xml"
        model.write_text(str(zarr.open_group(store, mode="r", use_consolidated=False)[motion].attrs["robot_xml"]))
        robot = MJCFCharModel("cpu")
        robot.load(str(model))
        listed = export / f"{motion}.yaml"
        paths = [path for path, _ in motion_files(export, store) if path.parent.name == motion]
        listed.write_text("motions:\n" + "".join(f'  - file: "{path}"\n    weight: 1.0\n' for path in paths))
        library = anim.motion_lib.MotionLib(str(listed), robot, "cpu")
        # Its frames as they are loaded: between frames it interpolates, and takes the middle of close orientations.
        every = list(trajectories(store, motion))
        assert library.get_num_motions() == len(every)
        root, turn, joints = (np.concatenate([rows[name] for rows in every]) for name in POSE)
        compare.equal(library._frame_root_pos, root)
        found = library._frame_root_rot.numpy()
        sign = np.sign(np.sum(found * turn[:, XYZW], axis=1, keepdims=True))
        compare.equal(found * sign, turn[:, XYZW], 1e-6)
        compare.equal(library.joint_rot_to_dof(library._frame_joint_rot), joints, 2.1e-5)
        np.testing.assert_allclose(
            library.get_motion_lengths(), [(len(rows["action"]) - 1) / 60 for rows in every], rtol=1e-6
        )
    return compare.numbers


def check_protomotions(export: Path, store: Path) -> int:
    sys.path.insert(0, str(Path(os.environ[CLONES]) / "ProtoMotions"))
    from protomotions.components.motion_lib import MotionLib, MotionLibConfig

    compare = Comparison()
    for path, rows in motion_files(export, store):
        library = MotionLib(MotionLibConfig(motion_file=str(path)), device="cpu")
        compare.equal(library.gts, bodies(rows, "position"))
        compare.equal(library.grs, bodies(rows, "orientation")[..., XYZW])
        compare.equal(library.gvs, bodies(rows, "linear_velocity"))
        compare.equal(library.gavs, bodies(rows, "angular_velocity"))
        compare.equal(library.dps, rows["joint_position"])
        compare.equal(library.dvs, rows["joint_velocity"])
        assert abs(float(library.motion_dt[0]) - 1.0 / 60.0) < 1e-6
    return compare.numbers


def check_humanoidverse(export: Path, store: Path) -> int:
    import joblib

    compare = Comparison()
    for path, rows in motion_files(export, store):
        ((name, motion),) = joblib.load(path).items()
        assert name == path.stem
        compare.equal(motion["root_trans_offset"], rows["root_position"])
        compare.equal(motion["root_rot"], rows["root_orientation"][:, XYZW])
        compare.equal(motion["dof"], rows["joint_position"])
        compare.equal(motion["pose_aa"][:, 0], rotation_vectors(matrices(rows["root_orientation"])), DERIVED)
        compare.equal(motion["pose_aa"][:, 1:].sum(axis=2), rows["joint_position"])
    return compare.numbers


def check_amp(export: Path, store: Path) -> int:
    """There is no loader in a package registry: the columns are read with json."""
    order = [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
    compare = Comparison()
    for path, rows in motion_files(export, store):
        frames = np.array(json.loads(path.read_text())["Frames"])
        assert frames.shape[1] == 61
        base = matrices(rows["root_orientation"])
        feet = rows["link_position"][:, 12:].astype(float) - rows["root_position"][:, None]
        feet = np.einsum("tji,tfj->tfi", base, feet)[:, [1, 0, 3, 2]]
        compare.equal(frames[:, 0:3], rows["root_position"])
        compare.equal(frames[:, 3:7], rows["root_orientation"][:, XYZW])
        compare.equal(frames[:, 7:19], rows["joint_position"][:, order])
        compare.equal(frames[:, 19:31], feet.reshape(len(feet), -1), DERIVED)
        compare.equal(frames[:, 31:37], rows["state"][:, 4:10], DERIVED)
        compare.equal(frames[:, 37:49], rows["joint_velocity"][:, order])
        moved = np.gradient(feet, axis=0).reshape(len(feet), -1) * 60.0
        assert np.corrcoef(frames[:, 49:61].ravel(), moved.ravel())[0, 1] > 0.95
    return compare.numbers


def check_unitree(export: Path, store: Path) -> int:
    import pandas

    compare = Comparison()
    for path, rows in motion_files(export, store):
        table = pandas.read_csv(path)
        compare.equal(table[["x", "y", "z"]], rows["root_position"], 1e-7)
        compare.equal(table[["qw", "qx", "qy", "qz"]], rows["root_orientation"], 1e-7)
        assert list(table.columns[8:11]) == ["FR_hip_joint", "FR_thigh_joint", "FR_calf_joint"]
        group = zarr.open_group(store, mode="r", use_consolidated=False)[path.parent.name]
        compare.equal(table[list(group.attrs["joint_names"])], rows["joint_position"], 1e-6)
    return compare.numbers


@dataclass(frozen=True)
class Loader:
    """The loader of a target."""

    check: Callable[[Path, Path], int]
    """Returns how many numbers were compared."""
    package: str
    """Whose version is printed."""
    packages: tuple[str, ...] = ()
    """What its environment needs besides zarr."""
    alone: tuple[str, ...] = ()
    """Packages that are installed without what they ask for."""
    clone: str = ""
    """Folder in ``CLONES`` of what is in no package registry."""
    form: str = ""
    """Format of the export, where it has another name."""

    @property
    def name(self) -> str:
        """What is printed: package and version, or the clone's name and revision."""
        if not self.clone:
            return f"{self.package} {version(self.package)}"
        revision = Path(os.environ[CLONES], self.clone, "REVISION")
        if revision.exists():
            return f"{self.clone} {revision.read_text().strip()}"
        command = ["git", "-C", str(revision.parent), "log", "-1", "--format=%h (%cs)"]
        return f"{self.clone} {subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()}"


ROBOMIMIC_NEEDS = ("h5py", "tqdm", "tensorboard", "tensorboardX", "psutil", "imageio", "termcolor", "torch")
HUMENV_NEEDS = ("h5py", "tqdm", "gymnasium", "mujoco", "dm_control")
LOADERS = {
    "lerobot": Loader(check_lerobot, "lerobot", ("lerobot[dataset]",)),
    "minari": Loader(check_minari, "minari", ("minari[hdf5]", "pillow")),
    "robomimic": Loader(check_robomimic, "robomimic", ROBOMIMIC_NEEDS, ("robomimic",)),
    "d4rl": Loader(check_d4rl, "h5py", ("h5py",)),
    "motivo": Loader(check_motivo, "", HUMENV_NEEDS, clone="humenv"),
    "bfm_zero": Loader(check_bfm_zero, "", (*HUMENV_NEEDS, "tensordict"), clone="BFM-Zero", form="motivo"),
    "parquet": Loader(check_parquet, "datasets", ("datasets",)),
    "mjlab": Loader(check_mjlab, "mjlab", ("mjlab",)),
    "mimickit": Loader(check_mimickit, "", ("torch", "pyyaml", "wandb", "gymnasium", "tensorboardX"), clone="MimicKit"),
    "protomotions": Loader(check_protomotions, "", ("torch", "omegaconf", "scipy", "easydict"), clone="ProtoMotions"),
    "humanoidverse": Loader(check_humanoidverse, "joblib", ("joblib",)),
    "amp": Loader(check_amp, "numpy"),
    "unitree": Loader(check_unitree, "pandas", ("pandas",)),
}


def check(target: str, export: Path, store: Path) -> None:
    """Run one check and print what it found as JSON."""
    loader, start = LOADERS[target], time.perf_counter()
    numbers = loader.check(export, store)
    found = {"loader": loader.name, "numbers": numbers}
    print(json.dumps(found | {"seconds": time.perf_counter() - start}))


def python_of(target: str, folder: Path) -> Path:
    """The Python of a target's environment, which is made where it is missing."""
    loader, home = LOADERS[target], folder / f"{target}-env"
    python = home / "bin" / "python"
    if not (home / "whole").exists():
        for command in (
            ["venv", "--quiet", "--clear", "--python", "3.12", str(home)],
            ["pip", "install", "--quiet", "--python", str(python), "zarr", *loader.packages],
            *(
                [["pip", "install", "--quiet", "--python", str(python), "--no-deps", *loader.alone]]
                * bool(loader.alone)
            ),
        ):
            subprocess.run(["uv", *command], check=True)
        (home / "whole").touch()
    return python


def main(store: Path, folder: Path, targets: list[str]) -> None:
    """Export, read back, and print a table in Markdown."""
    from kine2go_warp.exports.export import export_dataset

    print("| target | loader | numbers compared | export [s] | size [MB] | reading and comparing [s] |")
    print("|---|---|---|---|---|---|")
    for target in targets or LOADERS:
        form = LOADERS[target].form or target
        out, start = folder / form, time.perf_counter()
        export_dataset(store, form, out, overwrite=True)
        seconds = time.perf_counter() - start
        size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) / 1e6
        command = [python_of(target, folder), Path(__file__), "check", target, out, store]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"| `{target}` | failed: {done.stderr.strip().splitlines()[-1]} | | {seconds:.1f} | {size:.1f} | |")
            continue
        found = json.loads(done.stdout.strip().splitlines()[-1])
        print(
            f"| `{target}` | {found['loader']} | {found['numbers']:,} | {seconds:.1f} | {size:.1f} | "
            f"{found['seconds']:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1] == "check":
        check(sys.argv[2], Path(sys.argv[3]), Path(sys.argv[4]))
    else:
        main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
