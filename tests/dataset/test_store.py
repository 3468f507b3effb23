"""The store as a consumer meets it: with xarray and nothing of this package."""

import json
import platform
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import zarr

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import REJECTED, add_reviews, new_review
from kine2go_warp.dataset.schema import DIVERSITY_ARRAYS, QUALITY_ARRAYS, ROW_ARRAYS, SUB_GROUPS, TRAJECTORY_ARRAYS
from kine2go_warp.dataset.store import motion_names
from kine2go_warp.dataset.summary import summarise
from kine2go_warp.dataset.trajectories import Trajectories
from kine2go_warp.dataset.writer import DatasetWriter, SimulationAttributes
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import GO2
from kine2go_warp.rotations import continuous
from kine2go_warp.tables import counted

xarray = pytest.importorskip("xarray")

SIMULATION = SimulationAttributes(60.0, 4, 60.0, 2.0)

SIZES = {"axis": 3, "quaternion": 4, "joint": 12, "link": 16, "foot": 4, "term": 5}


def made_up(rng, count=3, rows=20):
    """Trajectories of the right shapes; the second one is shorter."""
    shapes = {"trajectory": count, "frame": rows, **SIZES}
    arrays = {
        array.name: rng.normal(size=[shapes[dimension] for dimension in array.dims]).astype(np.float32)
        for array in ROW_ARRAYS
    }
    for name in ("root_orientation", "reference_root_orientation", "link_orientation"):
        arrays[name] /= np.linalg.norm(arrays[name], axis=-1, keepdims=True)
    draws = {
        "length": np.array([rows, rows - 5, rows], dtype=np.int32),
        "heading": rng.uniform(-3, 3, count),
        "seed": rng.integers(0, 2**32, count, dtype=np.uint32),
        "start_phase": rng.random(count),
        "terminated": np.zeros(count, dtype=np.int32),
        "noise": np.ones(count),
        **{array.name: np.full(count, float(array.name.endswith("scale")), array.dtype) for array in DIVERSITY_ARRAYS},
    }
    sizes = {**shapes, "coordinate": 19, "velocity": 18, "slot": 3}
    groups = {
        group: {
            array.name: rng.normal(size=[sizes[dimension] for dimension in array.dims]).astype(array.dtype)
            for array in members
        }
        for group, members in SUB_GROUPS.items()
    }
    return Trajectories(arrays, draws, groups)


@pytest.fixture
def store(tmp_path, rng):
    path = tmp_path / "dataset.zarr"
    writer = DatasetWriter(path, GO2)
    for motion in ("one", "two"):
        writer.write(motion, made_up(rng), SIMULATION, {"rejected": {"distance": 2}, "licence": "CC0"})
    return path


def test_xarray_alone_opens_labelled_self_explaining_data(store):
    data = xarray.open_zarr(store, group="one")
    assert dict(data.sizes) == {"trajectory": 3, "frame": 20, **SIZES}
    knee = data["joint_position"].sel(joint="FL_calf_joint")
    assert knee.dims == ("trajectory", "frame")
    assert knee.attrs["units"] == "rad"
    np.testing.assert_allclose(data["time"], np.arange(20) / 60.0)
    assert "time" in data.coords
    assert list(data["quaternion"].values) == ["w", "x", "y", "z"]
    assert list(data["foot"].values) == ["FL", "FR", "RL", "RR"]
    assert data.attrs["licence"] == "CC0"
    for array in (*ROW_ARRAYS, *TRAJECTORY_ARRAYS):
        assert data[array.name].dims == array.dims, array.name
        assert data[array.name].attrs["description"] == array.description


def test_the_whole_tree_opens_at_once(store):
    tree = xarray.open_datatree(store, engine="zarr")
    assert set(tree.children) == {"one", "two"}
    assert tree.attrs["format"] == "kine2go"
    assert tree.attrs["action_scale"] == 0.25
    assert tree.attrs["control_frequency"] == 60.0
    assert tree.attrs["physics_substeps"] == 4
    assert tree.attrs["sdk_motor_order"][0] == "FR_hip_joint"
    for array in QUALITY_ARRAYS:
        assert tree["one/quality"][array.name].dims == array.dims


def test_a_consumer_needs_nothing_of_this_package(store):
    script = (
        "import sys, xarray; data = xarray.open_zarr(sys.argv[1], group='two');"
        "print(float(data['action'].isel(trajectory=0).mean()));"
        "assert not any(name.startswith('kine2go') for name in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script, str(store)], check=True, cwd=store.parent, capture_output=True)


def test_what_is_written_comes_back_bit_for_bit_with_nan_beyond_each_length(tmp_path, rng):
    written = made_up(rng)
    DatasetWriter(tmp_path / "dataset.zarr", GO2).write("one", written, SIMULATION, {"rejected": {}})
    back = open_dataset(tmp_path / "dataset.zarr", include_rejected=True).load("one").trajectories
    for name, values in written.rows.items():
        np.testing.assert_array_equal(back.rows[name][[0, 2]], values[[0, 2]])
        np.testing.assert_array_equal(back.rows[name][1, :15], values[1, :15])
        assert np.all(np.isnan(back.rows[name][1, 15:]))


def test_a_motion_is_few_files(store):
    files = [path for path in (store / "one").rglob("*") if path.is_file()]
    members = sum(len(arrays) for arrays in SUB_GROUPS.values())
    arrays = len(ROW_ARRAYS) + len(TRAJECTORY_ARRAYS) + members + len(SIZES) + 2
    groups = 1 + len(SUB_GROUPS)
    assert len(files) <= 2 * arrays + groups, "metadata and one shard an array"


def test_no_object_arrays_and_no_pickles(store):
    """Case 15-labels-utf32 as well: no text of fixed length."""
    for _, array in zarr.open_group(store / "one", mode="r").arrays():
        assert array.dtype.kind in "fiuT"
        assert array.metadata.to_dict()["data_type"] in {"float32", "float64", "int32", "uint32", "string"}


def test_no_data_type_is_unknown_outside_python(store):
    """Types that the core specification does not name are records in the metadata; readers in other languages fail."""
    types = [json.loads(path.read_text()).get("data_type") for path in store.rglob("zarr.json")]
    assert {kind for kind in types if kind} == {"float32", "float64", "int32", "uint32", "string"}


def test_a_motion_can_be_saved_as_netcdf(store, tmp_path):
    data = xarray.open_zarr(store, group="one")
    data.to_netcdf(tmp_path / "one.nc")
    with xarray.open_dataset(tmp_path / "one.nc") as back:
        assert back["joint"].values.tolist() == list(GO2.joint_names)
        np.testing.assert_array_equal(back["action"], data["action"])
        np.testing.assert_array_equal(back["seed"], data["seed"])
        assert json.loads(back.attrs["rejected"]) == {"distance": 2}


def test_a_motion_alone_says_how_to_read_it(store):
    attributes, root = (xarray.open_zarr(store, group=group).attrs for group in ("one", None))
    names = ("conventions", "action_rule", "joint_names", "default_joint_position", "action_scale", "stiffness",
             "damping", "control_frequency", "physics_substeps", "robot_model_sha256", "sdk_motor_order")  # fmt: skip
    assert {name: attributes[name] for name in names} == {name: root[name] for name in names}


def test_the_summary_counts_what_was_rejected_in_a_review(store):
    motion = Motion(store, "one")
    (looked_at,) = motion.read(motion.references()[:1], None)
    add_reviews(store, [new_review(looked_at, REJECTED, "limps", "Ada")])
    assert [one.rejected_in_review for one in summarise(store)][:2] == [1, 0]


@pytest.mark.parametrize(
    ("count", "noun", "words"),
    [(1, "trajectory", "1 trajectory"), (2000, "trajectory", "2,000 trajectories"), (0, "motion", "0 motions"),
     (2, "push", "2 pushes")],
)  # fmt: skip
def test_numbers_of_things_are_said_as_people_do(count, noun, words):
    assert counted(count, noun) == words


def test_the_summary_is_computed_from_the_rows(store):
    first = summarise(store)[0]
    assert (first.motion, first.accepted, first.total, first.rejected_in_review) == ("one", 3, 5, 0)
    assert (first.shortest, first.longest) == (pytest.approx(15 / 60), pytest.approx(20 / 60))
    rows = open_dataset(store, include_rejected=True).load("one").trajectories.rows
    error = rows["joint_position"].astype(float) - rows["reference_joint_position"]
    expected = np.mean([np.sqrt(np.nanmean(one**2)) for one in error])
    assert first.joint_rmse == pytest.approx(expected)


def test_a_failed_write_leaves_the_old_motion_and_nothing_else(store, rng, monkeypatch):
    before = open_dataset(store, include_rejected=True).load("one").trajectories.rows["action"]

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("kine2go_warp.dataset.writer.write_members", fail)
    with pytest.raises(OSError, match="No space"):
        DatasetWriter(store, GO2).write("one", made_up(rng), SIMULATION, {"rejected": {}})
    after = open_dataset(store, include_rejected=True).load("one").trajectories.rows["action"]
    np.testing.assert_array_equal(after, before)
    assert [path.name for path in store.parent.iterdir()] == [store.name]


def test_leftovers_of_a_killed_process_are_removed(store):
    leftover = store.with_name(f".tmp-{store.name}-{platform.node()}-4194999-new-one")
    leftover.mkdir()
    DatasetWriter(store, GO2)
    assert not leftover.exists()


def test_what_is_not_a_dataset_is_refused(tmp_path):
    with pytest.raises(DatasetError, match="no dataset here"):
        motion_names(tmp_path)
    with pytest.raises(DatasetError, match="not a dataset"):
        DatasetWriter(tmp_path, GO2)
    zarr.open_group(tmp_path / "other.zarr", mode="w", zarr_format=3)
    with pytest.raises(DatasetError, match="not a dataset of kine2go"):
        DatasetWriter(tmp_path / "other.zarr", GO2)
    (tmp_path / "broken.zarr").mkdir()
    (tmp_path / "broken.zarr" / "zarr.json").write_text("{")
    with pytest.raises(DatasetError, match="not a Zarr store"):
        motion_names(tmp_path / "broken.zarr")


def test_another_format_version_is_refused(store):
    zarr.open_group(store, mode="a").attrs["format_version"] = "99"
    with pytest.raises(DatasetError, match="dataset format 99"):
        motion_names(store)


def test_a_missing_motion_and_a_truncated_shard_are_named(store):
    with pytest.raises(DatasetError, match="holds no motion 'three'; it has: one, two"):
        open_dataset(store, include_rejected=True).load("three")
    shard = next(path for path in (store / "one" / "action").rglob("*") if path.is_file() and path.name != "zarr.json")
    shard.write_bytes(shard.read_bytes()[:100])
    with pytest.raises(DatasetError, match="one/action: cannot be read"):
        open_dataset(store, include_rejected=True).load("one")


def test_quaternions_become_continuous_without_turning(rng):
    quaternions = rng.normal(size=(4, 30, 4))
    quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
    smooth = continuous(quaternions, axis=1)
    np.testing.assert_allclose(np.abs(np.sum(smooth * quaternions, axis=-1)), 1.0)
    assert np.all(np.sum(smooth[:, 1:] * smooth[:, :-1], axis=-1) >= 0.0)
    assert np.all(smooth[:, 0, 0] >= 0.0)


def test_opening_gives_no_warning(store, recwarn):
    xarray.open_zarr(store, group="one")
    xarray.open_datatree(store, engine="zarr")
    assert not [warning for warning in recwarn if "onsolidated" in str(warning.message)]


def test_the_index_knows_of_motions_added_and_replaced(store, rng):
    writer = DatasetWriter(store, GO2)
    writer.write("one", made_up(rng, rows=11), SIMULATION, {"rejected": {}})
    writer.write("three", made_up(rng), SIMULATION, {"rejected": {}})
    tree = xarray.open_datatree(store, engine="zarr")
    assert set(tree.children) == {"one", "two", "three"}
    assert tree["one"].sizes["frame"] == 11


def test_a_kill_before_the_index_is_written_leaves_a_store_that_opens(store, rng, monkeypatch):
    writer = DatasetWriter(store, GO2)

    def be_killed(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(DatasetWriter, "_write_index", be_killed)
    with pytest.raises(KeyboardInterrupt):
        writer.write("three", made_up(rng), SIMULATION, {"rejected": {}})
    assert motion_names(store) == ["one", "three", "two"]
    assert set(xarray.open_datatree(store, engine="zarr").children) == {"one", "two", "three"}


def test_a_motion_simulated_otherwise_is_refused(store, rng):
    other = replace(SIMULATION, stiffness=30.0)
    with pytest.raises(DatasetError, match=r"holds motions with stiffness 60\.0, and three has 30\.0"):
        DatasetWriter(store, GO2).write("three", made_up(rng), other, {"rejected": {}})
    assert motion_names(store) == ["one", "two"]


def test_a_store_appears_with_its_first_motion(tmp_path):
    writer = DatasetWriter(tmp_path / "dataset.zarr", GO2)
    assert writer.motions() == []
    assert list(tmp_path.iterdir()) == []


def test_a_robot_that_is_another_is_refused(store, rng):
    other = replace(GO2, action_scale=0.5)
    with pytest.raises(DatasetError, match="action_scale"):
        DatasetWriter(store, other).write("three", made_up(rng), SIMULATION, {"rejected": {}})


def test_damaged_metadata_of_a_motion_is_named(store):
    (store / "one" / "zarr.json").write_text("{")
    with pytest.raises(DatasetError, match="one: cannot be read"):
        open_dataset(store, include_rejected=True).load("one")
    assert DatasetWriter(store, GO2).attributes("one") == {}
