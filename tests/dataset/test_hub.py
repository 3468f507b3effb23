"""A dataset on the Hugging Face Hub is read through the Hub's own client, here from a server with the Hub's routes."""

import json
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

import numpy as np
import pytest

from kine2go_warp.dataset import open_dataset
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.errors import DatasetError
from kine2go_warp.robots import GO2
from tests.dataset.test_store import SIMULATION, made_up

hub = pytest.importorskip("huggingface_hub")
constants = pytest.importorskip("huggingface_hub.constants")
REPOSITORY = "me/dogs"


def described(path: Path, root: Path) -> dict:
    """A file or folder as the Hub lists it."""
    kind = {"type": "file", "size": path.stat().st_size} if path.is_file() else {"type": "directory", "size": 0}
    return kind | {"path": path.relative_to(root).as_posix(), "oid": "0" * 40}


@contextmanager
def serving_hub(root: Path) -> Iterator[str]:
    """Serve a folder as the dataset ``REPOSITORY``; the routes are those that reading takes."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self):
            path = unquote(urlsplit(self.path).path)
            if found := re.fullmatch(rf"/datasets/{REPOSITORY}/resolve/main/(.*)", path):
                self.send_part(root / found[1])
            elif found := re.fullmatch(rf"/api/datasets/{REPOSITORY}/tree/main/?(.*)", path):
                folder = root / found[1]
                self.send_json([described(one, root) for one in folder.iterdir()] if folder.is_dir() else None)
            elif re.fullmatch(rf"/api/datasets/{REPOSITORY}(/revision/main)?", path):
                self.send_json({"id": REPOSITORY, "sha": "0" * 40, "siblings": []})
            else:
                self.send_json(None)

        def do_POST(self):
            asked = self.rfile.read(int(self.headers["Content-Length"])).decode()
            names = json.loads(asked)["paths"] if asked.startswith("{") else parse_qs(asked)["paths"]
            self.send_json([described(root / name, root) for name in names if (root / name).exists()])

        def send_part(self, path):
            if not path.is_file():
                self.send_json(None)
                return
            content = path.read_bytes()
            part = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
            if part is None:
                self.answer(200, content, {})
                return
            first, last = int(part[1]), int(part[2])
            self.answer(206, content[first : last + 1], {"Content-Range": f"bytes {first}-{last}/{len(content)}"})

        def send_json(self, content):
            missing = {"X-Error-Code": "EntryNotFound" if REPOSITORY in self.path else "RepoNotFound"}
            status, headers = (404, missing) if content is None else (200, {})
            self.answer(status, json.dumps({"error": "not there"} if content is None else content).encode(), headers)

        def answer(self, status, body, headers):
            self.send_response(status)
            for name, value in {**headers, "Content-Length": str(len(body)), "Content-Type": "text/plain"}.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()


def test_a_dataset_on_the_hub_is_read_as_one_in_a_folder(tmp_path, rng, monkeypatch):
    folder = tmp_path / "data" / "dataset.zarr"
    DatasetWriter(folder, GO2).write("one", made_up(rng), SIMULATION, {"rejected": {}, "licence": "CC0"})
    with serving_hub(tmp_path) as url:
        template = constants.HUGGINGFACE_CO_URL_TEMPLATE.replace(constants.ENDPOINT, url)
        monkeypatch.setattr(constants, "HUGGINGFACE_CO_URL_TEMPLATE", template)
        monkeypatch.setattr(constants, "ENDPOINT", url)
        hub.HfFileSystem.clear_instance_cache()
        there = open_dataset(f"hf://datasets/{REPOSITORY}/data/dataset.zarr")
        assert there.motions == ["one"]
        for one, other in zip(open_dataset(folder).trajectories(), there.trajectories(), strict=True):
            assert float(one.values["noise"]) == float(other.values["noise"])
            for name, values in one.arrays.items():
                np.testing.assert_array_equal(other.arrays[name], values)
        for missing in (f"{REPOSITORY}/nothing.zarr", "me/nothing/dataset.zarr"):
            with pytest.raises(DatasetError, match=r"no dataset here, the server has no zarr\.json"):
                open_dataset(f"hf://datasets/{missing}")
    hub.HfFileSystem.clear_instance_cache()
