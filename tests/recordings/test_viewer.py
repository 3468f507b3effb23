"""Opening the viewer."""

import io
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from types import SimpleNamespace
from urllib.parse import parse_qs

import numpy as np
import pytest

from kine2go_warp.dataset.motion import Motion
from kine2go_warp.errors import RecordingError
from kine2go_warp.recordings import viewer
from kine2go_warp.recordings.motion import Style, record_motion
from kine2go_warp.recordings.viewer import WebViewer, check_display, open_native, viewer_program

FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


def test_a_display_is_asked_for_only_where_there_must_be_one(monkeypatch):
    monkeypatch.setattr(viewer.sys, "platform", "linux")
    with pytest.raises(RecordingError, match="no display"):
        check_display(environment={})
    check_display(environment={"DISPLAY": ":0"})
    check_display(environment={"WAYLAND_DISPLAY": "wayland-0"})
    monkeypatch.setattr(viewer.sys, "platform", "darwin")
    check_display(environment={})


def test_a_viewer_that_ends_at_once_is_an_error(monkeypatch, tmp_path):
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(viewer, "viewer_program", lambda: sys.executable)
    with pytest.raises(RecordingError, match="ended at once"):
        open_native([tmp_path / "missing.rrd"])


def test_a_server_that_ends_at_once_is_an_error(monkeypatch, tmp_path):
    monkeypatch.setattr(viewer, "viewer_program", lambda: sys.executable)
    with pytest.raises(RecordingError, match="does not start"):
        WebViewer.start([tmp_path / "missing.rrd"])


def test_the_viewer_is_the_program_itself():
    with viewer_program().open("rb") as file:
        assert file.read(2) != b"#!", "a script would leave the server alive"


def test_the_web_server_serves_a_page_and_ends_with_its_command(motion):
    code = "from kine2go_warp.cli.main import entry_point; entry_point()"
    command = [sys.executable, "-c", code, "review", str(motion.path), "--web"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert "written" in process.stdout.readline()
    url = process.stdout.readline().split()[1]
    with urllib.request.urlopen(url, timeout=20) as page:
        assert b"Rerun" in page.read()
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == 128 + signal.SIGTERM
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(url, timeout=5)


def test_a_browser_gets_the_recordings_as_files_and_other_pages_do_not(motion, tmp_path):
    for name in ("walk", "a trot"):
        record_motion(motion, tmp_path / f"{name}.rrd", Style(trajectories=1))
    server = WebViewer.start([tmp_path / "walk.rrd", tmp_path / "a trot.rrd"])
    try:
        page, _, query = server.url.partition("/?")
        addresses = parse_qs(query)["url"]
        assert len(addresses) == 2
        for address, name in zip(addresses, ("walk", "a trot"), strict=True):
            request = urllib.request.Request(address, headers={"Origin": page})
            with urllib.request.urlopen(request, timeout=20) as file:
                assert file.read() == (tmp_path / f"{name}.rrd").read_bytes()
                assert file.headers["Access-Control-Allow-Origin"] == page
        other = urllib.request.Request(addresses[0], headers={"Origin": "http://example.org"})
        with urllib.request.urlopen(other, timeout=20) as file:
            assert file.headers["Access-Control-Allow-Origin"] is None
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(addresses[0].replace("walk.rrd", "..%2Fwalk.rrd"), timeout=20)
    finally:
        server.stop()
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(addresses[0], timeout=5)


@pytest.fixture
def browser():
    """Headless Chromium, driven by playwright."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if program is None:
        pytest.skip("no Chromium on the PATH (Debian: apt install chromium)")
    with playwright.sync_playwright() as drivers:
        opened = drivers.chromium.launch(executable_path=program, args=FLAGS)
        yield opened
        opened.close()


@pytest.mark.slow
def test_a_browser_shows_robot_and_plots(clean_dataset, tmp_path, browser):
    record_motion(Motion(clean_dataset, "dog_trot"), tmp_path / "a.rrd", Style(trajectories=2))
    server = WebViewer.start([tmp_path / "a.rrd"])
    try:
        page = browser.new_page(viewport={"width": 1600, "height": 900})
        page.goto(f"{server.url}&renderer=webgl")
        end, seen = time.monotonic() + 180.0, SimpleNamespace(robot=0, plots=0)
        while time.monotonic() < end and (seen.robot < 3000 or seen.plots < 100):
            time.sleep(5.0)
            seen = look(page.screenshot())
    finally:
        server.stop()
    assert seen.robot >= 3000, "pixels of the robot's shell"
    assert seen.plots >= 100, "pixels of curves"


def look(screenshot):
    """Count pixels of the robot's shell in the left part, lit and grey, and of a curve's colour in the plots."""
    from PIL import Image

    pixels = np.asarray(Image.open(io.BytesIO(screenshot)).convert("RGB")).astype(int)
    space = pixels[100:850, :700]
    # Darker than the page and the line of the root, lighter than the background and its squares.
    shell = (np.ptp(space, axis=-1) < 30) & (space.min(axis=-1) > 110) & (space.max(axis=-1) < 235)
    curves = np.abs(pixels[100:850, 770:1190] - np.array([98, 160, 234])).max(axis=-1) < 12
    return SimpleNamespace(robot=int(shell.sum()), plots=int(curves.sum()))
