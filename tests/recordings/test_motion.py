"""The recording of a motion, read back."""

import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.dataset.reviews import REJECTED, add_reviews, new_review
from kine2go_warp.errors import DatasetError
from kine2go_warp.metrics import CONTACT_FORCE
from kine2go_warp.recordings.layout import motion_layout
from kine2go_warp.recordings.motion import Style, closest_to_limits, record_motion
from kine2go_warp.recordings.pushes import SHOWN_ROWS, log_pushes
from kine2go_warp.recordings.robot import RobotDrawer
from kine2go_warp.recordings.stream import Columns, recording_file
from kine2go_warp.recordings.summary import pushes_text
from kine2go_warp.recordings.trajectory import (
    FORCE_SCALE,
    STEPS_AHEAD,
    log_trajectory,
    steps_ahead,
    trajectory_entity,
)
from kine2go_warp.robots import GO2
from kine2go_warp.robots.kinematics import foot_positions
from kine2go_warp.robots.spec import LEG_JOINTS
from tests.recordings.conftest import Recorded

RERUN = str(Path(sys.executable).with_name("rerun"))


@pytest.fixture
def path(motion, tmp_path):
    record_motion(motion, tmp_path / "recordings" / "made_up.rrd")
    return tmp_path / "recordings" / "made_up.rrd"


def test_the_recording_is_whole(path):
    result = subprocess.run([RERUN, "rrd", "verify", str(path)], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert [file.name for file in path.parent.iterdir()] == ["made_up.rrd"]


def test_the_most_doubtful_trajectory_is_whole_before_the_others_and_the_tabs_come_last(motion, path):
    """What a viewer can show first it reads first."""
    command = [RERUN, "rrd", "print", str(path)]
    messages = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    layouts = [number for number, line in enumerate(messages) if line.startswith("BlueprintActivationCommand")]
    shown = [one.index for one, _ in closest_to_limits(motion, None)]
    assert len(shown) > 1
    places = [
        [number for number, line in enumerate(messages) if f"/{trajectory_entity(index)}/" in line] for index in shown
    ]
    assert len(layouts) == 2
    assert layouts[0] < places[0][0]
    for before, after in pairwise(places):
        assert before[-1] < after[0]
    assert places[-1][-1] < layouts[1] == len(messages) - 1


def test_root_and_joints_are_those_of_the_dataset_bit_for_bit(motion, path):
    recorded = Recorded(path)
    for one in motion.read(motion.references(), None):
        entity = f"/{trajectory_entity(one.index)}"
        time, places = recorded.column(f"{entity}/robot/base", "Transform3D:translation")
        assert np.array_equal(np.array(places, np.float32)[:, 0], one.arrays["root_position"])
        np.testing.assert_allclose(time, motion.time[: one.length], atol=1e-9)
        _, turns = recorded.column(f"{entity}/robot/base", "Transform3D:quaternion")
        assert np.array_equal(np.array(turns, np.float32)[:, 0][:, [3, 0, 1, 2]], one.arrays["root_orientation"])
        for number, leg in enumerate(GO2.legs):
            _, values = recorded.column(f"{entity}/plots/joints/{leg.name}", "Scalars:scalars")
            part = slice(3 * number, 3 * number + 3)
            assert np.array_equal(np.array(values)[:, :3], one.arrays["reference_joint_position"][:, part])
            assert np.array_equal(np.array(values)[:, 3:], one.arrays["joint_position"][:, part])
            names = recorded.fixed(f"{entity}/plots/joints/{leg.name}", "SeriesLines:names")
            assert names[3:] == list(LEG_JOINTS)


def test_feet_are_drawn_where_the_dataset_has_them_and_marked_while_they_bear_weight(clean_dataset, tmp_path):
    motion = Motion(clean_dataset, "dog_trot")
    record_motion(motion, tmp_path / "a.rrd")
    recorded = Recorded(tmp_path / "a.rrd")
    (one,) = motion.read(motion.references()[:1], None)
    _, centres = recorded.column("/trajectories/000/robot/feet", "Ellipsoids3D:centers")
    assert np.array_equal(np.array(centres, np.float32), one.arrays["link_position"][:, 12:])
    colours = np.array(recorded.column("/trajectories/000/robot/feet", "Ellipsoids3D:colors")[1])
    stands = np.linalg.norm(one.arrays["foot_contact_force"], axis=-1) > CONTACT_FORCE
    assert stands.any()
    assert set(colours[stands]) == {0xFF8C00FF}
    assert 0xFF8C00FF not in colours[~stands]
    vectors = np.array(recorded.column("/trajectories/000/forces", "Arrows3D:vectors")[1])
    np.testing.assert_allclose(vectors[stands], FORCE_SCALE * one.arrays["foot_contact_force"][stands], rtol=1e-5)
    assert not vectors[~stands].any()


def test_targets_are_the_reference_of_later_rows_and_fewer_towards_the_end(motion, path):
    recorded = Recorded(path)
    (one,) = motion.read(motion.references()[:1], None)
    _, strips = recorded.column("/trajectories/000/targets", "LineStrips3D:strips")
    # Of the steps 1, 2, 10 and 30 the last is beyond the 20 rows; each target is two lines.
    assert [len(row) for row in strips] == [6] * 10 + [4] * 8 + [2, 0]
    reference = foot_positions(GO2, one.arrays["reference_joint_position"])
    for row in range(10):
        for place, step in enumerate(STEPS_AHEAD[:3]):
            left, right = np.array(strips[row][2 * place]), np.array(strips[row][2 * place + 1])
            root = one.arrays["reference_root_position"][row + step]
            ends = np.stack([left[0], right[0], left[-1], right[-1]])
            # Turning about the root keeps the feet's distances to it.
            np.testing.assert_allclose(
                np.linalg.norm(ends - root, axis=-1), np.linalg.norm(reference[row + step], axis=-1), atol=1e-5
            )


def test_errors_are_shares_of_the_limits_and_the_worst_trajectory_comes_first(motion, path):
    recorded = Recorded(path)
    shown = closest_to_limits(motion, None)
    assert [usage.worst_limit_ratio for _, usage in shown] == sorted(
        (usage.worst_limit_ratio for _, usage in shown), reverse=True
    )
    for one, usage in shown:
        _, shares = recorded.column(f"/{trajectory_entity(one.index)}/plots/errors", "Scalars:scalars")
        distance = np.linalg.norm(one.arrays["root_position"] - one.arrays["reference_root_position"], axis=-1)
        np.testing.assert_allclose(np.array(shares)[:, 0], distance / usage.limits[0], rtol=1e-5)
        joints = one.arrays["joint_position"] - one.arrays["reference_joint_position"]
        rmse = np.sqrt(np.mean(joints**2, axis=-1))
        np.testing.assert_allclose(np.array(shares)[:, 2], rmse / usage.limits[2], rtol=1e-5)
        _, limit = recorded.column(f"/{trajectory_entity(one.index)}/plots/limit", "Scalars:scalars")
        assert set(np.ravel(limit)) == {1.0}


def test_leg_distance_is_drawn_with_the_depth_at_which_the_filter_rejects(clean_dataset, tmp_path):
    motion = Motion(clean_dataset, "dog_trot")
    record_motion(motion, tmp_path / "a.rrd")
    (one,) = motion.read(motion.references()[1:2], None)
    recorded = Recorded(tmp_path / "a.rrd")
    _, curves = recorded.column("/trajectories/001/plots/leg_distance", "Scalars:scalars")
    assert np.array_equal(np.array(curves, np.float32)[:, 0], one.arrays["leg_distance"])
    assert set(np.array(curves)[:, 1]) == {-motion.attributes["gather_settings"]["max_leg_overlap"]}
    assert recorded.fixed("/trajectories/001/plots/leg_distance", "SeriesLines:names") == ["least distance", "limit"]


def test_the_text_tells_quality_draw_and_verdict(motion, tmp_path):
    (one,) = motion.read(motion.references()[1:2], None)
    add_reviews(motion.path, [new_review(one, REJECTED, "drags a leg", "Ada")])
    record_motion(motion, tmp_path / "a.rrd")
    (text,) = Recorded(tmp_path / "a.rrd").fixed("/trajectories/001/text", "TextDocument:text")
    assert "rejected by Ada: drags a leg" in text
    for name in motion.trajectory_arrays:
        if name != "length" and not name.startswith("initial_state"):
            assert name.rpartition("/")[2].replace("_", " ") in text
    (listed,) = Recorded(tmp_path / "a.rrd").fixed("/list", "TextDocument:text")
    assert listed.count("\n| ") == 1 + 3


def test_fewer_trajectories_are_those_closest_to_a_limit(motion, tmp_path):
    worst = closest_to_limits(motion, None)[0][0].index
    assert record_motion(motion, tmp_path / "a.rrd", Style(trajectories=1)) == 1
    entities = {entity for entity in Recorded(tmp_path / "a.rrd").entities if entity.startswith("/trajectories")}
    assert {entity.split("/")[2] for entity in entities} == {f"{worst:03d}"}


def test_a_trajectory_of_twenty_seconds_takes_less_than_three_megabytes(clean_dataset, tmp_path):
    # 150 rows of real data are there; what they cost beyond the first 50 they cost again and again.
    motion = Motion(clean_dataset, "dog_trot")
    ((one, usage),) = closest_to_limits(motion, 1)
    sizes = {}
    for rows in (50, 150):
        part = replace(one, length=rows, arrays={name: values[:rows] for name, values in one.arrays.items()})
        with recording_file("a", "", tmp_path / "a.rrd") as recording:
            recording.send_blueprint(motion_layout("a", [(part, usage)], GO2))
            log_trajectory(recording, motion, part, usage, RobotDrawer(GO2), "")
        sizes[rows] = (tmp_path / "a.rrd").stat().st_size
    assert sizes[150] + (1200 - 150) * (sizes[150] - sizes[50]) / 100 < 3e6


def test_a_motion_without_limits_is_shown_all_the_same(motion, tmp_path):
    store = shutil.copytree(motion.path, tmp_path / "copy.zarr")
    metadata = store / "made_up" / "zarr.json"
    metadata.write_text(metadata.read_text().replace("gather_settings", "other_settings"))
    (store / "zarr.json").write_text((store / "zarr.json").read_text().replace("gather_settings", "other_settings"))
    record_motion(Motion(store, "made_up"), tmp_path / "a.rrd")
    recorded = Recorded(tmp_path / "a.rrd")
    assert recorded.fixed("/trajectories/000/plots/errors", "SeriesLines:names")[0] == "root distance [m]"
    assert "/trajectories/000/plots/limit" not in recorded.entities


@pytest.mark.parametrize("settings", [{}, {"env": {}}, {"env": {"steps_ahead": "no"}}, {"env": {"steps_ahead": [0]}}])
def test_steps_that_are_not_known_are_those_of_the_paper(settings):
    assert steps_ahead({"training_settings": settings}) == STEPS_AHEAD
    assert steps_ahead({"training_settings": {"env": {"steps_ahead": [3, 5]}}}) == (3, 5)


def test_a_motion_without_trajectories_is_refused_and_leaves_nothing(motion, tmp_path, monkeypatch):
    monkeypatch.setattr(Motion, "references", lambda _: [])
    with pytest.raises(DatasetError, match="no trajectory to record"):
        record_motion(motion, tmp_path / "a.rrd")
    assert not list(tmp_path.glob("*.rrd"))


@pytest.fixture
def pushed(clean_dataset):
    """A trajectory of real rows, pushed twice by hand, and one that was not pushed."""
    motion = Motion(clean_dataset, "dog_trot")
    one, other = (replace(one, arrays=dict(one.arrays)) for one in motion.read(motion.references()[:2], None))
    for trajectory, rows in ((one, (10, 140)), (other, ())):
        trajectory.arrays["push"] = np.zeros_like(trajectory.arrays["push"])
        trajectory.arrays["push"][list(rows)] = [0.3, -0.4, 0.0]
    return motion, one, other


def record_pushes(trajectory, motion, path):
    with recording_file("pushes", "", path) as recording:
        log_pushes(Columns(recording, "robot", motion.time[: trajectory.length]), trajectory.arrays)
    return Recorded(path)


def test_a_push_is_an_arrow_for_a_while_a_mark_and_a_text(pushed, tmp_path):
    motion, one, _ = pushed
    recorded = record_pushes(one, motion, tmp_path / "a.rrd")
    time, vectors = recorded.column("/robot/push", "Arrows3D:vectors")
    rows = np.searchsorted(motion.time, time - 1e-6).tolist()
    there = [row for row, vector in zip(rows, vectors, strict=True) if vector]
    assert there == [*range(10, 10 + SHOWN_ROWS), *range(140, one.length)]
    assert vectors[rows.index(10 + SHOWN_ROWS)] == [], "then it goes"
    np.testing.assert_allclose(vectors[rows.index(15)][0], [0.45, -0.6, 0.0], rtol=1e-6)
    assert ["push 0.50 m/s"] in recorded.column("/robot/push", "Arrows3D:labels")[1]
    marks = recorded.fixed("/robot/pushes", "Points3D:positions")
    assert np.array_equal(np.array(marks, np.float32), one.arrays["root_position"][[10, 140]])
    moments, _ = recorded.column("/robot/plots/push", "Scalars:scalars")
    np.testing.assert_allclose(moments, motion.time[[10, 140]], atol=1e-9)
    text = pushes_text(one.arrays["push"], motion.time)
    assert text == f"2 pushes: 0.50 m/s at {motion.time[10]:.2f} s, 0.50 m/s at {motion.time[140]:.2f} s"


def test_a_trajectory_without_pushes_shows_none(pushed, tmp_path):
    motion, _, other = pushed
    assert not any("push" in entity for entity in record_pushes(other, motion, tmp_path / "a.rrd").entities)
    assert pushes_text(other.arrays["push"], motion.time) == "No pushes."
    del other.arrays["push"]
    assert not any("push" in entity for entity in record_pushes(other, motion, tmp_path / "b.rrd").entities)
