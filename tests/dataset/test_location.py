"""A dataset on a server is read as one in a folder, or refused in one clear line."""

import json
import os
import re
import shutil
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

from kine2go_warp.cli.main import main
from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.location import RemotePath, located
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

pytest.importorskip("aiohttp")
pytest.importorskip("fsspec")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("served") / "dataset.zarr"
    rng = np.random.default_rng(0)
    for motion in ("one", "two"):
        DatasetWriter(path, GO2).write(motion, made_up(rng), SIMULATION, {"rejected": {}, "licence": "CC0"})
    return path


@contextmanager
def serving(folder: Path, ranges: bool = True, breaks_at: str = "\0"):
    """Serve a folder; files whose path matches ``breaks_at`` are sent by half, after which the server hangs up."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_HEAD(self):
            self.respond(with_body=False)

        def do_GET(self):
            self.respond(with_body=True)

        def respond(self, with_body):
            path = folder.parent / self.path.lstrip("/")
            if not path.is_file():
                self.send_error(404)
                return
            content, status, where = path.read_bytes(), 200, None
            wanted = re.fullmatch(r"bytes=(\d*)-(\d*)", self.headers.get("Range", ""))
            if ranges and wanted:
                first, last = wanted.groups()
                start = int(first) if first else len(content) - int(last)
                stop = min(int(last) + 1, len(content)) if first and last else len(content)
                where, content, status = f"bytes {start}-{stop - 1}/{len(content)}", content[start:stop], 206
            self.send_response(status)
            self.send_header("Content-Length", str(len(content)))
            if ranges:
                self.send_header("Accept-Ranges", "bytes")
            if where:
                self.send_header("Content-Range", where)
            self.end_headers()
            if with_body and re.search(breaks_at, self.path):
                self.wfile.write(content[: len(content) // 2])
                self.wfile.flush()
                self.close_connection = True
                self.connection.shutdown(2)
            elif with_body:
                self.wfile.write(content)

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}/{folder.name}"
        server.shutdown()


def assert_equal_to_the_folder(url, folder):
    here, there = open_dataset(folder), open_dataset(url)
    assert there.motions == here.motions == ["one", "two"]
    assert there.rate == 60.0
    assert there.robot == here.robot
    assert there.num_rows == here.num_rows == 110
    for one, other in zip(here.trajectories(), there.trajectories(), strict=True):
        assert (one.motion, one.index, one.length) == (other.motion, other.index, other.length)
        assert float(one.values["noise"]) == float(other.values["noise"])
        for name, values in one.arrays.items():
            np.testing.assert_array_equal(other.arrays[name], values)


def test_a_web_server_with_ranges(folder):
    with serving(folder) as url:
        assert_equal_to_the_folder(url, folder)
        assert_equal_to_the_folder(f"{url}/", folder)


def test_an_object_store(folder):
    # Both ask for an older python-dateutil than the others and bring some 40 packages, so the lock file has neither.
    pytest.importorskip("s3fs", reason="no s3fs: uv run --with s3fs --with 'moto[server]' pytest, with this file")
    server = pytest.importorskip("moto.server", reason="no moto[server]").ThreadedMotoServer(port=0)
    import boto3

    server.start()
    host, port = server.get_host_and_port()
    settings = {
        "AWS_ACCESS_KEY_ID": "a", "AWS_SECRET_ACCESS_KEY": "b", "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
    }  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        for name, value in settings.items():
            patch.setenv(name, value)
        client = boto3.client("s3")
        client.create_bucket(Bucket="dogs")
        for path in folder.rglob("*"):
            if path.is_file():
                client.upload_file(str(path), "dogs", f"data/{path.relative_to(folder.parent)}")
        assert_equal_to_the_folder("s3://dogs/data/dataset.zarr", folder)
        with pytest.raises(DatasetError, match=r"s3://dogs/nothing\.zarr: no dataset here"):
            open_dataset("s3://dogs/nothing.zarr")
    server.stop()


def test_a_server_without_ranges_is_named(folder):
    with serving(folder, ranges=False) as url, pytest.raises(DatasetError) as error:
        open_dataset(url)
    assert "sends whole files only (no HTTP ranges)" in str(error.value)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("breaks_at", "where"),
    [(r"two/joint_position/c/", "two/joint_position: cannot be read"), (r"zarr\.json", "zarr.json: cannot be read")],
)
def test_a_server_that_stops_in_the_middle_is_named(folder, breaks_at, where):
    with serving(folder, breaks_at=breaks_at) as url, pytest.raises(DatasetError, match=where) as error:
        for _ in open_dataset(url).trajectories(arrays=["joint_position"]):
            pass
    assert re.search(r"cannot be read \(\w+", str(error.value)), error.value
    assert len(str(error.value).splitlines()) == 1


def test_a_server_that_is_not_there_or_has_no_dataset_is_named(folder):
    with serving(folder) as url, pytest.raises(DatasetError, match=r"no dataset here, the server has no zarr\.json"):
        open_dataset(f"{url}/nowhere")
    with pytest.raises(DatasetError, match=r"cannot be read \(ClientConnectorError"):
        open_dataset(url)


def test_a_store_that_lists_no_motions_is_refused_on_a_server_and_mended_by_a_writer(folder, tmp_path):
    copy = shutil.copytree(folder, tmp_path / folder.name)
    root = json.loads((copy / "zarr.json").read_text())
    assert root["attributes"].pop("motions") == {name: {"trajectories": 3, "rows": 55} for name in ("one", "two")}
    (copy / "zarr.json").write_text(json.dumps(root))
    assert open_dataset(copy).motions == ["one", "two"]
    with serving(copy) as url:
        with pytest.raises(DatasetError, match="does not list its motions"):
            open_dataset(url)
        DatasetWriter(copy, GO2)
        assert open_dataset(url).motions == ["one", "two"]


def test_addresses_survive_being_paths():
    assert located(Path("https://host/a.zarr")) == RemotePath("https://host/a.zarr")
    assert located("s3://bucket/a.zarr/") == RemotePath("s3://bucket/a.zarr")
    assert located("hf://datasets/me/dogs") / "x" == RemotePath("hf://datasets/me/dogs/x")
    assert located("runs/a.zarr") == Path("runs/a.zarr")


def test_commands_read_from_a_server(folder, tmp_path, capsys):
    with serving(folder) as url:
        assert main(["dataset", "export", url, "two", "--format", "npz", "--out", str(tmp_path / "npz")]) == 0
    assert len(list((tmp_path / "npz" / "two").iterdir())) == 3
    assert "3 trajectories of 1 motion" in capsys.readouterr().out


def test_five_thousand_motions_open_within_a_tenth_of_a_second(folder, tmp_path):
    big = tmp_path / "big.zarr"
    big.mkdir()
    names = [f"motion_{number:04d}" for number in range(5000)]
    root = json.loads((folder / "zarr.json").read_text())
    root.pop("consolidated_metadata")
    root["attributes"]["motions"] = {name: {"trajectories": 3, "rows": 55} for name in names}
    (big / "zarr.json").write_text(json.dumps(root))
    for name in names:
        (big / name).mkdir()
        os.link(folder / "one" / "zarr.json", big / name / "zarr.json")
    times = []
    for _ in range(3):
        start = time.process_time()
        assert len(open_dataset(big).motions) == 5000
        times.append(time.process_time() - start)
    print(f"5,000 motions open in {min(times):.3f} s of processor time")
    assert min(times) < 0.1


def test_the_root_of_many_motions_lists_no_arrays(tmp_path, rng, monkeypatch):
    monkeypatch.setattr("kine2go_warp.dataset.root_index.INDEXED_MOTIONS", 1)
    path, writer = tmp_path / "dataset.zarr", DatasetWriter(tmp_path / "dataset.zarr", GO2)
    data = made_up(rng)
    writer.write("one", data, SIMULATION, {"rejected": {}})
    assert "consolidated_metadata" in json.loads((path / "zarr.json").read_text())
    writer.write("two", data, SIMULATION, {"rejected": {}})
    root = json.loads((path / "zarr.json").read_text())
    assert "consolidated_metadata" not in root
    assert list(root["attributes"]["motions"]) == ["one", "two"]
    assert len(list(open_dataset(path).trajectories())) == 6
