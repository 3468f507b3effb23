import numpy as np
import pytest
from PIL import Image

from kine2go_warp.cli.main import main
from kine2go_warp.dataset.writer import DatasetWriter
from kine2go_warp.robots import GO2
from kine2go_warp.rollouts.config import GatherConfig
from kine2go_warp.rollouts.gather import gather
from kine2go_warp.scores.distributions import distributions, draw_distributions
from tests.conftest import ANYTHING_GOES


@pytest.fixture(scope="module")
def dataset(policy, tmp_path_factory):
    """Rollouts of a poor policy, some rejected for their slip."""
    path = tmp_path_factory.mktemp("quality") / "dataset.zarr"
    limits = {**ANYTHING_GOES, "max_foot_slip": 0.25}
    config = GatherConfig(trajectories=4, rows=40, num_worlds=8, keep_rejected=True, **limits)
    gather(policy, DatasetWriter(path, GO2), config, "cpu")
    return path


def test_accepted_rollouts_lie_within_the_limit_and_rejected_ones_beyond(dataset):
    slip = next(one for one in distributions(dataset, "dog_trot") if one.name == "foot_slip")
    assert slip.limit == pytest.approx(0.25)
    assert slip.accepted.max() <= 0.25
    assert len(slip.rejected) > 0
    assert slip.quantile(0.5) == pytest.approx(np.median(slip.accepted))


def test_the_command_prints_every_figure_and_draws_a_picture(dataset, tmp_path, capsys):
    assert main(["quality", str(dataset), "--picture", str(tmp_path / "new" / "quality.png")]) == 0
    output = capsys.readouterr().out
    for name in ("largest_root_error", "foot_slip", "joint_jerk", "rejected:", "worth a look"):
        assert name in output
    with Image.open(tmp_path / "new" / "quality.png") as picture:
        assert len(np.unique(np.asarray(picture.convert("L")))) > 20


def test_every_limited_metric_has_a_panel(dataset, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("kine2go_warp.scores.distributions.save", lambda figure, _: drawn.append(figure))
    found = distributions(dataset, "dog_trot")
    draw_distributions({"dog_trot": found}, tmp_path / "quality.png")
    titles = [axes.get_title() for axes in drawn[0].axes if axes.axison]
    assert titles == [f"{one.name.replace('_', ' ')} [{one.unit}]" for one in found]


def test_an_unknown_motion_is_refused(dataset, capsys):
    assert main(["quality", str(dataset), "wolf"]) == 2
    assert "holds no motion 'wolf'" in capsys.readouterr().err
