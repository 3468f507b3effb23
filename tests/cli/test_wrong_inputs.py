"""Wrong inputs by the hundred: one line and status 2, a few of them through the console script."""

import random
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.odd_inputs import new
from tests.cli.wrong_files import Good
from tests.cli.wrong_inputs import Outcome, drawn, end_of, report, warm_up

PROGRAM = [sys.executable, "-c", "from kine2go_warp.cli.main import entry_point; entry_point()"]
SAMPLE = 20


@pytest.fixture(scope="module")
def inputs(clip, policy, clean_dataset, tmp_path_factory):
    folder = tmp_path_factory.mktemp("wrong")
    clip.save(folder / "dog_trot.npz")
    good = Good(folder / "dog_trot.npz", Path(policy.path), clean_dataset, "dog_trot")
    return drawn(good, folder / "inputs")


@pytest.mark.slow
def test_hundreds_of_wrong_inputs_end_with_one_line_and_status_2(inputs, tmp_path):
    assert len(inputs) >= 300
    warm_up()
    outcomes = [end_of(one, tmp_path) for one in inputs]
    good = sum(one.is_good for one in outcomes)
    assert good >= 0.97 * len(outcomes), report(outcomes)


@pytest.mark.slow
def test_the_console_script_ends_in_the_same_way(inputs, tmp_path):
    for number, one in enumerate(random.Random(0).sample(inputs, SAMPLE)):
        work = new(tmp_path / str(number))
        command = [*PROGRAM, *one.arguments]
        result = subprocess.run(
            command, cwd=work, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
        )
        assert Outcome(one, result.returncode, result.stderr, ()).is_good, (one.arguments, result.stderr)
