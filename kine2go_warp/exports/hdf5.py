"""HDF5 for learning from data: Minari, D4RL, robomimic, and the motion buffers of Meta Motivo and BFM-Zero.

All but the buffers hold transitions (``features.Transitions``). Each motion is a file of its own.
"""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from kine2go_warp.dataset.motion import Motion, Trajectory
from kine2go_warp.errors import ExportError
from kine2go_warp.exports.features import GOAL, REWARD, STATE, Field, joined, stored, transitions
from kine2go_warp.exports.target import Output, Target, check_finite, learning_fields, task_sentence, write_json
from kine2go_warp.rotations import conjugate, rotate

MINARI_VERSION = "0.5.0"
"""Of Minari's format, which every later 0.5 reads."""

TRANSITION_RULE = (
    "T rows of a trajectory are T observations and T - 1 transitions: action[t] was chosen in observation[t], "
    "reward[t] and observation[t + 1] came of it. The last row is where the trajectory ended, by its end (truncated) "
    "or early (terminated)."
)

FLAT_RULE = f"{TRANSITION_RULE} Observations are `observation.state` and `observation.environment_state` side by side."


def transition_fields(motion: Motion) -> list[Field]:
    """Return what transitions hold of a row."""
    return [*learning_fields(motion), joined(motion, [REWARD], "reward")]


def save(group: h5py.Group, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays by name, compressed without loss."""
    for name, values in arrays.items():
        group.create_dataset(name, data=values, compression="gzip", shuffle=True)


def checked(output: Output, trajectories: Iterator[Trajectory]) -> Iterator[Trajectory]:
    """Yield the trajectories that have a transition.

    Raises:
        ExportError: a value is not a finite number.
    """
    for one in trajectories:
        check_finite(output, one)
        if one.length > 1:
            yield one


def columns(output: Output, *names: str) -> list[str]:
    """Return the names of the numbers of some fields, one after the other."""
    return [column for name in names for field in output.fields if field.name == name for column in field.columns]


def box(size: int) -> str:
    """Return a space of numbers without bounds as Minari keeps it."""
    bounds = {"low": [-float("inf")] * size, "high": [float("inf")] * size}
    return json.dumps({"type": "Box", "dtype": "float32", "shape": [size], **bounds})


def dataset_name(output: Output, motion: str) -> str:
    """Return the name by which Minari loads a motion."""
    return f"{output.dataset.attributes['robot']}/{motion}-v0"


def write_minari(output: Output, name: str, trajectories: Iterator[Trajectory]) -> None:
    """Write a motion as a dataset of Minari: observations are state and goal, one after the other."""
    folder = output.folder / dataset_name(output, name) / "data"
    folder.mkdir(parents=True, exist_ok=True)
    motion, steps, episodes = output.dataset.motion(name), 0, 0
    with h5py.File(folder / "main_data.hdf5", "w", track_order=True) as file:
        for one in checked(output, trajectories):
            found = transitions(one)
            group = file.create_group(f"episode_{episodes}")
            group.attrs.update(
                {"id": episodes, "total_steps": len(found.action), "trajectory": one.index, "motion": name}
            )
            save(
                group,
                {
                    "observations": np.concatenate([found.state, found.goal], axis=1),
                    "actions": found.action,
                    "rewards": found.reward,
                    "terminations": found.terminated,
                    "truncations": found.truncated,
                },
            )
            episodes, steps = episodes + 1, steps + len(found.action)
    observed = columns(output, "observation.state", "observation.environment_state")
    write_json(
        {
            "dataset_id": dataset_name(output, name),
            "minari_version": MINARI_VERSION,
            "data_format": "hdf5",
            "observation_space": box(len(observed)),
            "action_space": box(len(columns(output, "action"))),
            "total_episodes": episodes,
            "total_steps": steps,
            "dataset_size": round((folder / "main_data.hdf5").stat().st_size / 1e6, 1),
            "description": task_sentence(motion),
            "algorithm_name": "PPO, a policy that tracks the motion",
            "licence": str(motion.attributes.get("licence", "unknown")),
            "observation_columns": observed,
            "action_columns": columns(output, "action"),
        },
        folder / "metadata.json",
    )


def write_d4rl(output: Output, name: str, trajectories: Iterator[Trajectory]) -> None:
    """Write a motion as D4RL has it: the transitions of all trajectories one after the other."""
    parts: dict[str, list[NDArray[Any]]] = {}
    for one in checked(output, trajectories):
        found = transitions(one)
        observed = np.concatenate([found.state, found.goal], axis=1)
        for key, values in {
            "observations": observed[:-1],
            "next_observations": observed[1:],
            "actions": found.action,
            "rewards": found.reward,
            "terminals": found.terminated,
            "timeouts": found.truncated,
            "infos/trajectory": np.full(len(found.action), one.index),
        }.items():
            parts.setdefault(key, []).append(values)
    if not parts:
        raise ExportError(f"{output.dataset.path}/{name}: no trajectory has two rows")
    with h5py.File(output.folder / f"{name}.hdf5", "w") as file:
        save(file, {key: np.concatenate(values) for key, values in parts.items()})


def write_robomimic(output: Output, name: str, trajectories: Iterator[Trajectory]) -> None:
    """Write a motion as robomimic has it: a demonstration a trajectory, with masks for training and validation."""
    _, held_out = output.dataset.split(0.1)
    validation = {one.index for one in held_out.references if one.motion == name}
    masks: dict[str, list[str]] = {"train": [], "valid": []}
    with h5py.File(output.folder / f"{name}.hdf5", "w") as file:
        data, total = file.create_group("data"), 0
        for number, one in enumerate(checked(output, trajectories)):
            found = transitions(one)
            group = data.create_group(f"demo_{number}")
            group.attrs.update({"num_samples": len(found.action), "trajectory": one.index})
            observed = {"state": found.state, "environment_state": found.goal}
            save(group.create_group("obs"), {key: values[:-1] for key, values in observed.items()})
            save(group.create_group("next_obs"), {key: values[1:] for key, values in observed.items()})
            dones = (found.terminated | found.truncated).astype(np.int64)
            states = simulator_state(one)[:-1]
            save(group, {"actions": found.action, "rewards": found.reward, "dones": dones, "states": states})
            masks["valid" if one.index in validation else "train"].append(f"demo_{number}")
            total += len(found.action)
        data.attrs["total"] = total
        about = {
            "env_name": f"kine2go/{name}",
            "type": 1,
            "env_kwargs": {"task": task_sentence(output.dataset.motion(name))},
        }
        data.attrs["env_args"] = json.dumps(about)
        for mask, names in masks.items():
            file.create_dataset(f"mask/{mask}", data=np.array(names, dtype="S"))


def simulator_state(one: Trajectory) -> NDArray[np.float32]:
    """Return positions and velocities as MuJoCo has them, shape [num_rows, 37].

    The base's orientation is (w, x, y, z), its linear velocity in the world frame, its angular one in that of the base.
    """
    rows = one.arrays
    turning = rotate(conjugate(rows["root_orientation"]), rows["root_angular_velocity"])
    position = [rows["root_position"], rows["root_orientation"], rows["joint_position"]]
    velocity = [rows["root_linear_velocity"], turning, rows["joint_velocity"]]
    return np.concatenate([*position, *velocity], axis=1).astype(np.float32)


def buffer_fields(motion: Motion) -> list[Field]:
    """Return what buffers of motions hold of a row, besides the simulator's state."""
    return [joined(motion, STATE, "observation"), joined(motion, GOAL, "goal"), stored(motion, "action")]


def write_motivo(output: Output, name: str, trajectories: Iterator[Trajectory]) -> None:
    """Write a motion as episodes of a motion buffer; ``motion_id`` numbers the trajectories of all motions."""
    first, _ = output.before(name)
    with h5py.File(output.folder / f"{name}.hdf5", "w") as file:
        count = 0
        for number, one in enumerate(checked(output, trajectories)):
            state = simulator_state(one)
            group = file.create_group(f"ep_{number}")
            save(group, {field.name: field.values(one.arrays) for field in output.fields})
            last = np.arange(one.length)[:, None] == one.length - 1
            ended = bool(one.values["terminated"])
            save(
                group,
                {
                    "qpos": state[:, :19],
                    "qvel": state[:, 19:],
                    "motion_id": np.full((one.length, 1), first + number),
                    "done": last,
                    "terminated": last & ended,
                    "truncated": last & (not ended),
                },
            )
            count += 1
        file.attrs["num_episodes"] = count


def list_buffers(output: Output) -> None:
    """Write the list of files that the loaders of buffers take."""
    (output.folder / "motions.txt").write_text("".join(f"{name}.hdf5\n" for name in output.motions))


MINARI = Target(
    title="Minari datasets, one a motion",
    write=write_minari,
    fields=transition_fields,
    time_rule=FLAT_RULE,
    loading="""\
import os

os.environ["MINARI_DATASETS_PATH"] = "{folder}"
import minari

dataset = minari.load_dataset("{robot}/{motion}-v0")
episode = dataset[0]
print(episode.observations.shape, episode.actions.shape)  # (T, 70) (T - 1, 12)
""",
)

D4RL = Target(
    title="D4RL's flat HDF5, a file a motion",
    write=write_d4rl,
    fields=transition_fields,
    time_rule=FLAT_RULE,
    loading="""\
import h5py

with h5py.File("{motion}.hdf5") as file:
    data = {name: file[name][:] for name in ("observations", "actions", "rewards", "next_observations", "terminals")}
""",
)

ROBOMIMIC = Target(
    title="robomimic HDF5, a file a motion",
    write=write_robomimic,
    fields=transition_fields,
    time_rule=TRANSITION_RULE + " `obs/state` is `observation.state`, `obs/environment_state` likewise.",
    loading="""\
from robomimic.utils.dataset import SequenceDataset
from robomimic.utils.obs_utils import initialize_obs_utils_with_obs_specs

keys = ["state", "environment_state"]
initialize_obs_utils_with_obs_specs({"obs": {"low_dim": keys}})
data = SequenceDataset("{motion}.hdf5", obs_keys=keys, dataset_keys=["actions", "rewards", "dones"], seq_length=16)
""",
)

MOTIVO = Target(
    title="motion buffers of Meta Motivo (humenv) and BFM-Zero, a file a motion",
    write=write_motivo,
    finish=list_buffers,
    fields=buffer_fields,
    time_rule="A row is a control step; `action` was chosen in it; `done` is true in the last one. `qpos` and `qvel` "
    "are MuJoCo's: the orientation is (w, x, y, z), the linear velocity of the base in the world frame, its angular "
    "velocity in the frame of the base.",
    loading="""\
from humenv.misc.motionlib import MotionBuffer

buffer = MotionBuffer("motions.txt", base_path=".", keys=["qpos", "qvel", "observation", "action"])
batch = buffer.sample(256)
""",
)
