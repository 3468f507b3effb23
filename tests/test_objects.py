import pytest

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.objects import load_object, reference_to


def test_a_file_is_run_once_and_its_functions_are_found_again_by_its_path(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("RUNS = []\nRUNS.append(1)\n\ndef one():\n    return 1\n")
    function = load_object(f"{path}:one")
    assert function() == 1
    assert load_object(f"{path}:RUNS") == [1]
    assert load_object(f"{path}:RUNS") == [1]
    assert reference_to(function, "one") == f"{path}:one"


def test_a_file_that_fails_is_named_and_may_be_mended(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text("1 / 0\n")
    with pytest.raises(Kine2GoError, match=r"mine.py: cannot be run \(ZeroDivisionError: division by zero\)"):
        load_object(f"{path}:one")
    path.write_text("one = 1\n")
    assert load_object(f"{path}:one") == 1
