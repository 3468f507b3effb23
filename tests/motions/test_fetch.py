"""Fetching from a server on this machine: whole, resumed, damaged, missing."""

import functools
import http.server
import threading
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import pytest

from kine2go_warp.errors import CatalogueError, Kine2GoError
from kine2go_warp.files import sha256_of
from kine2go_warp.motions.catalogue import motion_named
from kine2go_warp.motions.fetch import check_file, fetch_file

CONTENT = bytes(range(256)) * 2000


class RangeHandler(http.server.SimpleHTTPRequestHandler):
    """Serves a folder, understands ranges, and may break off."""

    breaks_after: int | None = None
    ranges: ClassVar[list[str]]

    def log_message(self, *_):
        pass

    def do_GET(self):
        path = self.translate_path(self.path)
        try:
            content = Path(path).read_bytes()
        except OSError:
            self.send_error(404)
            return
        wanted = self.headers.get("Range")
        type(self).ranges.append(wanted or "")
        start = int(wanted.removeprefix("bytes=").rstrip("-")) if wanted else 0
        if start >= len(content):
            self.send_error(416)
            return
        self.send_response(206 if wanted else 200)
        self.send_header("Content-Length", str(len(content) - start))
        self.end_headers()
        stop = type(self).breaks_after
        self.wfile.write(content[start : start + stop if stop else None])


@pytest.fixture
def server(tmp_path):
    root = tmp_path / "server"
    (root / "ai4animation").mkdir(parents=True)
    (root / "ai4animation" / "dog_walk00_joint_pos.txt").write_bytes(CONTENT)

    class Handler(RangeHandler):
        ranges: ClassVar[list[str]] = []

    handler = functools.partial(Handler, directory=str(root))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        running.handler = Handler
        running.url = f"http://127.0.0.1:{running.server_address[1]}"
        yield running
        running.shutdown()


@pytest.fixture
def entry(server, tmp_path):
    assert server.url
    digest = sha256_of(tmp_path / "server" / "ai4animation" / "dog_walk00_joint_pos.txt")
    return replace(motion_named("ai4_dog_pace"), sha256=digest)


def test_a_file_is_fetched_whole_and_checked(server, entry, tmp_path):
    seen = []
    path = fetch_file(entry, server.url, tmp_path / "data", lambda done, total: seen.append((done, total)))
    assert path.read_bytes() == CONTENT
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert check_file(entry, tmp_path / "data").state == "whole"
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_download_that_broke_off_goes_on_where_it_stopped(server, entry, tmp_path):
    server.handler.breaks_after = 100_000
    with pytest.raises(Kine2GoError, match="run the same command again"):
        fetch_file(entry, server.url, tmp_path / "data")
    assert check_file(entry, tmp_path / "data").state == "missing"
    server.handler.breaks_after = None
    assert fetch_file(entry, server.url, tmp_path / "data").read_bytes() == CONTENT
    assert server.handler.ranges[1].startswith("bytes=")


def test_a_file_that_is_not_the_expected_one_is_removed(server, entry, tmp_path):
    other = replace(entry, sha256="0" * 64)
    with pytest.raises(Kine2GoError, match="SHA-256 differs"):
        fetch_file(other, server.url, tmp_path / "data")
    assert not [path for path in (tmp_path / "data").rglob("*") if path.is_file()]


def test_a_missing_file_and_a_wrong_address_are_named(server, entry, tmp_path):
    with pytest.raises(Kine2GoError, match="cannot be fetched"):
        fetch_file(replace(entry, file="ai4animation/none.txt"), server.url, tmp_path / "data")
    with pytest.raises(CatalogueError, match="http"):
        fetch_file(entry, "file:///etc", tmp_path / "data")


def test_damage_is_seen(entry, tmp_path):
    path = tmp_path / "data" / entry.file
    path.parent.mkdir(parents=True)
    path.write_bytes(CONTENT[:-1])
    assert check_file(entry, tmp_path / "data").state == "damaged"
    assert check_file(replace(entry, sha256=""), tmp_path / "data").state == "there"
    assert check_file(entry, None).state == "missing"


def test_real_files_are_whole(data_folder):
    for name in ("ai4_dog_pace", "vhdc_horse1_s2_trot_03", "ai4_dog_synth_eight_walk"):
        assert check_file(motion_named(name), data_folder).state == "whole"
