"""Controller and simulated robot in processes of their own, over the loopback interface through the real DDS library.

Faults: the robot's own record of every step says when its motors did nothing any more but damp. They are measured in
milliseconds, so they need a machine that does nothing else: ``-m faults``. What the controller does at each of them is
tested without a clock in test_safety.py and test_drive.py.
"""

import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest

dds = pytest.importorskip("kine2go_warp.deployment.dds", reason="cyclonedds is not installed", exc_type=ImportError)

from kine2go_warp.cli.main import main  # noqa: E402
from kine2go_warp.deployment.controller import ExportedPolicy  # noqa: E402
from kine2go_warp.deployment.drive import Deployment, DriveConfig  # noqa: E402
from kine2go_warp.deployment.robot import realtime  # noqa: E402
from kine2go_warp.deployment.safety import Phase, Schedule  # noqa: E402
from tests.conftest import REPOSITORY  # noqa: E402

DAMPED_WITHIN = 0.1
"""Time from a fault until the robot must be damped [s]."""
SCHEDULE = Schedule(stand_seconds=0.6, seconds=30.0, start_after=0.1, halt_seconds=0.3)
STARTING = 60.0
"""How long a process may take to start on a busy machine [s]."""


@pytest.fixture(scope="module", autouse=True)
def priority():
    """Without real-time priority a busy machine is a fault of its own."""
    with realtime() as is_realtime:
        if not is_realtime and os.getloadavg()[0] > 0.5 * (os.cpu_count() or 1):
            pytest.skip("no real-time priority, and this machine is busy")


@pytest.fixture(scope="module")
def domain():
    """A DDS domain that no other worker is in."""
    return 10 + os.getpid() % 90


def line_of(process, seconds=STARTING):
    """The next line that a process prints."""
    ready, _, _ = select.select([process.stdout], [], [], seconds)
    assert ready, "the process says nothing"
    return process.stdout.readline()


@contextmanager
def started(*command, **environment):
    """A process of a Python module that ends with the block."""
    with subprocess.Popen(
        [sys.executable, "-m", *map(str, command)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=REPOSITORY,
        env={**os.environ, **environment},
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture
def robot(bundle, domain, tmp_path, request):
    """A simulated robot in a process of its own; its fault is the test's parameter."""
    command = ("tests.deployment.faulty_robot", next(bundle.glob("*.npz")), "--domain", domain, "--estimate")
    with started(*command, "--rows", tmp_path / "rows.npy", FAULT=getattr(request, "param", "")) as process:
        assert line_of(process) == "ready\n"
        yield process


def rows_of(robot, tmp_path):
    """Time, whether damped, base position and orientation, joints: of every step that the robot lived."""
    robot.stdin.close()
    robot.wait(STARTING)
    return np.load(tmp_path / "rows.npy")


def assert_damped_since(rows, fault):
    before, after = (rows[(rows[:, 0] > fault - 0.2) & (rows[:, 0] < fault)], rows[rows[:, 0] > fault])
    assert not before[:, 1].any(), "not before the fault"
    assert after[-1, 0] > fault + 0.4, "the robot lived on to be seen"
    first = after[np.argmax(after[:, 1] > 0.0)]
    assert first[1], "damped at some time"
    assert first[0] - fault < DAMPED_WITHIN
    assert after[after[:, 0] >= first[0], 1].all(), "and ever since"


class RecordedLink(dds.UnitreeLink):
    """The controller's end, which notes when it sent what stiffness."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.sent = []

    def send(self, command):
        super().send(command)
        self.sent.append((time.monotonic(), command.stiffness))


def drive(bundle, domain, break_something):
    """Drive in this process; something breaks while the robot tracks, and 0.8 s later the operator stops."""
    policy, stop = ExportedPolicy.load(bundle), threading.Event()
    link = RecordedLink("lo", domain, policy.metadata.sdk_index, True)
    timers = threading.Timer(0.4, break_something), threading.Timer(1.2, stop.set)

    def on_phase(phase):
        if phase is Phase.TRACKING:
            for timer in timers:
                timer.start()

    deployment = Deployment(policy, link, DriveConfig(SCHEDULE, damp_seconds=0.6), on_phase=on_phase)
    with realtime():
        outcome = deployment.run(should_stop=stop.is_set)
    assert outcome.tracked > 0.3, outcome.reason
    return outcome, link


DISTANCES = r"([\d.]+) m away from the start \(the clip ([\d.]+) m\), tilted by at most ([\d.]+) rad"
FAULTS = [
    pytest.param("tilt", "the base is tilted by 1.", id="tilt"),
    pytest.param("states dropped", "newest state of the robot is", id="states dropped"),
    pytest.param("states delayed", "newest state of the robot is", id="states delayed"),
    pytest.param("estimate lost", "newest estimate of the base is", id="estimate lost"),
    # Only the robot detects these, and its watchdog damps it. The controller goes on to a limit or the operator's stop.
    pytest.param("checksum wrong", "", id="checksum wrong"),
    pytest.param("commands dropped", "", id="commands dropped"),
    pytest.param("commands delayed", "", id="commands delayed"),
]


@pytest.mark.faults
@pytest.mark.parametrize(("robot", "reason"), FAULTS, indirect=["robot"])
def test_a_fault_damps_the_robot_within_a_tenth_of_a_second(robot, reason, bundle, domain, tmp_path):
    outcome, _ = drive(bundle, domain, lambda: os.kill(robot.pid, signal.SIGUSR1))
    fault = float(line_of(robot).split()[1])
    assert_damped_since(rows_of(robot, tmp_path), fault)
    assert reason in outcome.reason
    assert not outcome.completed


@pytest.mark.faults
def test_a_robot_that_dies_is_commanded_to_damp_within_a_tenth_of_a_second(robot, bundle, domain):
    killed = []

    def kill():
        killed.append(time.monotonic())
        robot.kill()

    outcome, link = drive(bundle, domain, kill)
    damped = next(when for when, stiffness in link.sent if stiffness == 0.0)
    assert killed[0] < damped < killed[0] + DAMPED_WITHIN
    assert not any(stiffness for when, stiffness in link.sent if when > damped)
    assert "newest state of the robot is" in outcome.reason


@pytest.mark.faults
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_controller_that_dies_or_is_stopped_leaves_the_robot_damped(robot, bundle, domain, tmp_path, number):
    options = (
        "--network",
        "lo",
        "--domain",
        domain,
        "--estimate",
        "sport",
        "--stand-seconds",
        0.6,
        "--start-after",
        0.1,
    )
    with started("kine2go_warp", "deploy", bundle, *options) as controller:
        while line_of(controller) != f"{Phase.TRACKING.value}\n":
            pass
        time.sleep(0.4)
        ended = time.monotonic()
        controller.send_signal(number)
        if number == signal.SIGINT:
            assert "damped: stopped by the operator\n" in controller.stdout.read()
            assert controller.wait(STARTING) == 130
        time.sleep(0.5)
        assert_damped_since(rows_of(robot, tmp_path), ended)


@pytest.mark.parametrize("seconds", [3, pytest.param(20, marks=pytest.mark.slow)])
def test_the_command_tracks_with_a_simulated_robot_that_measures_it(trained_bundle, domain, capfd, seconds):
    # Lateness is for the faults above; here a busy machine may be late.
    options = f"--network lo --domain {domain} --simulate --stand-seconds 1 --start-after 0.1 --limits.max-age 1"
    status = main(["deploy", str(trained_bundle), *options.split(), "--seconds", str(seconds)])
    output = capfd.readouterr().out
    assert status == 0, output
    phases = [phase.value for phase in Phase if phase is not Phase.DAMPED]
    assert output.splitlines()[:5] == [*phases, f"damped: tracked for {seconds} s"]
    own, other = (float(found) for found in re.findall(r"joint RMSE (\d\.\d+) rad", output))
    # The first steps from standing are in it; standing still would be off by 0.18 rad.
    assert 0.002 < other < 0.06
    assert 0.002 < own < 0.1, "its states are up to a message old"
    distance, reference, tilt = map(float, re.search(DISTANCES, output).groups())
    assert reference == pytest.approx(0.62 * seconds, abs=0.05)
    assert distance == pytest.approx(reference, rel=0.15)
    assert tilt < 0.2


def test_wrong_input_is_one_line(bundle, domain, capsys):
    for options, message in (
        ("--network eth99 --estimate sport", "no network interface 'eth99'"),
        ("--network lo --estimate sport --clip waltz", "no clip 'waltz'; there are: dog_trot"),
        ("--network lo", "linear_velocity_b and reference_position_h, which the robot does not measure"),
        ("--network lo --estimate sport --limits.max-tilt 0", "max_tilt"),
    ):
        assert main(["deploy", str(bundle), "--domain", str(domain), *options.split()]) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
