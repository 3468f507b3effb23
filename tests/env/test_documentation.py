import runpy

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.observations import observation_layout
from tests.conftest import REPOSITORY

environment_page = runpy.run_path(str(REPOSITORY / "docs" / "environment_page.py"))["environment_page"]


def test_the_page_names_every_observation_and_range():
    page, config = environment_page(), EnvConfig()
    for field in observation_layout(config):
        assert f"| `{field.name}` | {field.start} | {field.stop} |" in page
    for term in (*config.randomization, *config.terminations):
        assert f"`{term.name}`" in page
