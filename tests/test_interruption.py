import os
import signal
import subprocess
import sys
import threading

import pytest

from kine2go_warp.interruption import StopRequest


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_first_signal_asks_and_the_second_stops(number, capfd):
    earlier = signal.getsignal(number)
    with StopRequest("stopping soon") as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop()
        assert capfd.readouterr().err == "\nkine2go: stopping soon\n"
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is earlier


def test_in_another_thread_it_handles_no_signals_and_stops_nothing():
    seen = []

    def work():
        with StopRequest() as stop:
            seen.append(stop())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [False]


WRITING = """
import os, sys, time
from pathlib import Path
from kine2go_warp.cli import main as cli
from kine2go_warp.files import atomic_file

class Writes:
    def run(self):
        with atomic_file(Path(sys.argv[1])) as temporary:
            temporary.write_text("half")
            os.kill(os.getpid(), int(sys.argv[2]))
            time.sleep(30)

cli.parsed = lambda given: Writes()
cli.entry_point()
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_command_that_is_ended_leaves_nothing_half_written(number, tmp_path):
    # Whoever runs the tests in the background may ignore these signals, which processes inherit.
    heeded = "import signal\nsignal.signal(1, signal.SIG_DFL)\nsignal.signal(2, signal.default_int_handler)\n"
    arguments = [sys.executable, "-c", heeded + WRITING, str(tmp_path / "film.mp4"), str(int(number))]
    ended = subprocess.run(arguments, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 128 + number
    assert ended.stderr.count("\n") == 1
    assert "interrupted" in ended.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_command_under_nohup_goes_on(tmp_path):
    script = WRITING.replace("time.sleep(30)", "temporary.write_text('whole')")
    arguments = ["nohup", sys.executable, "-c", script, str(tmp_path / "film.mp4"), str(int(signal.SIGHUP))]
    subprocess.run(arguments, capture_output=True, timeout=60, check=False)
    assert (tmp_path / "film.mp4").read_text() == "whole"
