"""Meshes of one's own instead of primitive shapes."""

import numpy as np
import pytest

from kine2go_warp.errors import RecordingError
from kine2go_warp.recordings.meshes import Meshes, asset
from kine2go_warp.recordings.motion import Style, record_motion
from tests.recordings.conftest import Recorded

COLLADA = "model/vnd.collada+xml"
TRIANGLE = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n"


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "meshes"
    folder.mkdir()
    for name in ("base.obj", "Hip.obj", "thigh.obj", "thigh_mirror.obj", "calf.OBJ", "notes.txt"):
        (folder / name).write_text(TRIANGLE + f"# {name}\n")
    return folder


def test_meshes_are_found_by_the_names_of_the_description(folder):
    files = Meshes.find(folder).files
    assert {link: path.name for link, path in files.items()} == {
        "trunk": "base.obj",
        "hip": "Hip.obj",
        "thigh": "thigh.obj",
        "calf": "calf.OBJ",
        "thigh_mirror": "thigh_mirror.obj",
    }


def test_missing_meshes_are_named_in_one_line(folder):
    (folder / "calf.OBJ").unlink()
    (folder / "Hip.obj").unlink()
    with pytest.raises(RecordingError, match=r"no mesh of hip, calf; expected .* hip\.dae"):
        Meshes.find(folder)
    with pytest.raises(RecordingError, match="no such folder"):
        Meshes.find(folder / "nowhere")


def test_meshes_are_instances_at_the_joints(motion, folder, tmp_path):
    record_motion(motion, tmp_path / "a.rrd", Style(trajectories=1, meshes=Meshes.find(folder)))
    recorded = Recorded(tmp_path / "a.rrd")
    (entity,) = {path.rpartition("/")[0] for path in recorded.entities if path.endswith("/robot/hips")}
    index = int(entity.split("/")[2])
    (one,) = motion.read([motion.references()[index]], None)
    for name, links in {"hips": [0, 3, 6, 9], "thigh_left": [1, 7], "calf_right": [5, 11]}.items():
        _, places = recorded.column(f"{entity}/{name}", "InstancePoses3D:translations")
        assert np.array_equal(np.array(places, np.float32), one.arrays["link_position"][:, links])
    right = bytes(recorded.fixed(f"{entity}/thigh_right", "Asset3D:blob")[0])
    assert right.endswith(b"# thigh_mirror.obj\n")
    assert bytes(recorded.fixed(f"{entity}/calf_right", "Asset3D:blob")[0]).endswith(b"# calf.OBJ\n")
    assert recorded.fixed(f"{entity}/calf_right", "Asset3D:media_type") == ["model/obj"]
    assert f"{entity}/legs" not in recorded.entities


def test_the_viewer_is_told_what_kind_a_mesh_is(tmp_path):
    (tmp_path / "calf.dae").write_text("<COLLADA/>")
    assert asset(tmp_path / "calf.dae").media_type.as_arrow_array().to_pylist() == [COLLADA]
