from kine2go_warp.dataset.checks.catalogue import all_checks, markdown_table
from tests.conftest import REPOSITORY


def test_the_documented_table_is_that_of_the_code():
    assert markdown_table() in (REPOSITORY / "docs" / "checks.md").read_text()


def test_every_check_says_what_must_hold():
    names = [check.name for check in all_checks()]
    assert len(names) == len(set(names))
    assert all(check.description for check in all_checks())
