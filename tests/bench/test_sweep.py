"""The sweep over numbers of worlds, on a CPU and small."""

import json

import pytest
import torch

from kine2go_warp.bench.sweep import HostWaits, shares_of
from kine2go_warp.cli.main import main
from tests.conftest import COMMITTED_CLIP


def test_a_sweep_measures_every_number_of_worlds_and_draws_them(tmp_path, capsys):
    arguments = ["bench", "sweep", "--clip", COMMITTED_CLIP, "--device", "cpu", "--worlds", 2, 4, "--repeats", 2]
    assert main([*map(str, arguments), "--steps", "2", "--json", "--picture", str(tmp_path / "sweep.png")]) == 0
    (report,) = json.loads(capsys.readouterr().out)
    rows = {row["name"]: row for row in report["measurements"]}
    for count in (2, 4):
        step, rate = rows[f"{count} worlds: step"], rows[f"{count} worlds: environment"]
        for milliseconds, steps_per_second in zip(step["values"], rate["values"], strict=True):
            assert milliseconds * steps_per_second == pytest.approx(1e3 * count)
        assert 0 < rows[f"{count} worlds: training"]["median"] < rate["median"]
        assert rows[f"{count} worlds: host waits"]["values"] == [0.0]
    assert report["settings"]["seed"] == "1"
    assert report["machine"]["newton"]
    assert (tmp_path / "sweep.png").stat().st_size > 5000


def test_waits_are_counted():
    values = torch.arange(4.0)
    with HostWaits() as waits:
        assert (values > 1).nonzero().shape == (2, 1)
        assert values.sum().item() == 6.0
        values.add_(1.0)
    assert waits.count == 2


def test_the_slowest_kernels_come_first_with_their_share_of_all():
    assert shares_of([("a", 1.0), ("b", 2.0), ("a", 1.0), ("c", 0.5), ("c", 0.5)]) == {"a": 0.4, "b": 0.4, "c": 0.2}
