from kine2go_warp.dataset.checks.catalogue import all_checks


def test_every_check_says_what_must_hold():
    names = [check.name for check in all_checks()]
    assert len(names) == len(set(names))
    assert all(check.description for check in all_checks())
