"""Opens an export with LeRobot itself and compares every row with the dataset. Needs lerobot[dataset] and zarr.

LeRobot wants other versions of Python, torch and NumPy than this project, so this script runs in an environment of its
own (docs/loading.md says how to make it) and imports nothing of kine2go_warp:

    python check_lerobot.py EXPORT DATASET
"""

import sys
from pathlib import Path

import lerobot
import numpy as np
import zarr
from lerobot.datasets.lerobot_dataset import LeRobotDataset

STATE = ("root_orientation", "root_linear_velocity", "root_angular_velocity", "joint_position", "joint_velocity")
INDICES = ("timestamp", "frame_index", "episode_index", "index", "task_index")


def expected_features(group: zarr.Group, trajectory: int, names: list[str]) -> dict[str, np.ndarray]:
    """What each feature of an episode should be, each of shape [length, num_columns]."""
    length = int(group["length"][trajectory])

    def rows(array: str) -> np.ndarray:
        return np.asarray(group[array][trajectory, :length]).reshape(length, -1)

    expected = {"observation.state": np.concatenate([rows(array) for array in STATE], axis=1)}
    for name in names:
        if name not in {"observation.state", *INDICES}:
            expected[name] = rows(name.removeprefix("policy."))
    return expected


def main(export: Path, store: Path) -> None:
    dataset = LeRobotDataset("local/go2", root=export)
    root = zarr.open_group(store, mode="r", use_consolidated=False)
    names = list(dataset.meta.features)
    compared = 0
    for episode in dataset.meta.episodes:
        (motion,) = episode["tasks"]
        expected = expected_features(root[motion], episode["trajectory"], names)
        first, stop = episode["dataset_from_index"], episode["dataset_to_index"]
        assert stop - first == episode["length"] == len(expected["action"])
        for frame in range(stop - first):
            row = dataset[first + frame]
            assert row["task"] == motion
            assert row["index"] == first + frame
            assert row["frame_index"] == frame
            assert row["episode_index"] == episode["episode_index"]
            assert abs(float(row["timestamp"]) - frame / dataset.fps) < 1e-5
            for name, values in expected.items():
                assert np.array_equal(np.atleast_1d(row[name].numpy()), values[frame]), (motion, frame, name)
                compared += values.shape[1]
    assert stop == len(dataset)
    for name in expected:
        everything = np.concatenate(
            [expected_features(root[one["tasks"][0]], one["trajectory"], names)[name] for one in dataset.meta.episodes]
        ).astype(float)
        for figure in ("mean", "std", "min", "max"):
            found = dataset.meta.stats[name][figure]
            np.testing.assert_allclose(found, getattr(np, figure)(everything, axis=0), rtol=1e-6, atol=1e-9)
    window = {"action": [step / dataset.fps for step in range(16)]}
    ahead = LeRobotDataset("local/go2", root=export, delta_timestamps=window)
    last = ahead[len(ahead) - 1]
    assert ahead[0]["action"].shape == (16, 12)
    assert int(last["action_is_pad"].sum()) == 15
    print(
        f"LeRobot {lerobot.__version__}: {len(dataset)} rows of {dataset.num_episodes} episodes, "
        f"{len(expected)} features, {compared} numbers equal"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
