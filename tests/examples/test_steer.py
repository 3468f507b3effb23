"""Steering the robot by a plan."""

import pytest

from examples.steer import main


def test_a_plan_is_followed_until_the_robot_is_lost_and_recorded(policy, tmp_path, capsys):
    """The policy has hardly learned, so that it falls: the example says after what time."""
    file = tmp_path / "steered.rrd"
    shown = ["--rerun-save", str(file), "--picture", str(tmp_path / "way.png")]
    assert main([str(policy.path), "--plan", "1:1.5:0", "1:1.0:0.5", *shown]) == 0
    assert "jumps between clips: joint RMSE 0." in capsys.readouterr().out
    assert file.stat().st_size > 1e4
    assert (tmp_path / "way.png").stat().st_size > 1e4


@pytest.mark.parametrize("plan", ["fast", "3:1", "0:1:0", "3:nan:0"])
def test_a_plan_that_is_none_is_refused(policy, plan, capsys):
    assert main([str(policy.path), "--plan", plan]) == 2
    assert "expected SECONDS:SPEED:TURN" in capsys.readouterr().err


def test_without_a_terminal_a_plan_is_needed(policy, capsys):
    assert main([str(policy.path)]) == 2
    assert "give a --plan" in capsys.readouterr().err
