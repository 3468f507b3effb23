import pytest
import warp as wp

from kine2go_warp.env.config import EnvConfig
from kine2go_warp.env.terms.base import find_term, with_term
from kine2go_warp.env.terms.rewards import REWARDS, RewardTerm
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.kernels import rewards
from kine2go_warp.kernels.world import WorldView


@wp.kernel
def without_column(view: WorldView, out: wp.array2d(dtype=float)):
    out[wp.tid(), 0] = float(view.ahead)


def test_a_kernel_is_kept_as_the_reference_to_it():
    term = RewardTerm("one", rewards.track_root_pose, {"position_exponent": 1, "angle_exponent": 2})
    assert term.kernel == "kine2go_warp.kernels.rewards:track_root_pose"
    assert term.params == (("position_exponent", 1.0), ("angle_exponent", 2.0))
    assert term.load_kernel() is rewards.track_root_pose


def test_every_reward_of_the_package_has_a_kernel_and_a_formula():
    for term in REWARDS:
        assert term.load_kernel().func.__module__ == rewards.__name__
        assert "{" not in term.formula_text


def test_a_field_or_a_parameter_of_one_term_changes():
    changed = with_term(REWARDS, "root_pose", weight=0.5, angle_exponent=3.0)
    assert find_term(changed, "root_pose").weight == 0.5
    assert find_term(changed, "root_pose").params == (("position_exponent", 20.0), ("angle_exponent", 3.0))
    assert [one == other for one, other in zip(changed, REWARDS, strict=True)].count(False) == 1


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (lambda: RewardTerm("a b", "module:kernel"), "no name for a term"),
        (lambda: RewardTerm("one", len), "no Warp kernel"),
        (lambda: RewardTerm("one", "kine2go_warp.kernels.rewards").load_kernel(), "no reference"),
        (lambda: RewardTerm("one", "kine2go_warp.kernels.rewards:nothing").load_kernel(), "defines no 'nothing'"),
        (lambda: RewardTerm("one", "no_such_module:nothing").load_kernel(), "cannot be imported"),
        (lambda: RewardTerm("one", "no_such_file.py:nothing").load_kernel(), "no such Python file"),
        (lambda: RewardTerm("one", "kine2go_warp.kernels.rewards:NUM_LEGS").load_kernel(), "is no Warp kernel"),
        (lambda: RewardTerm("one", without_column).load_kernel(), "takes .view, out., expected .view, out, column"),
        (lambda: RewardTerm("one", rewards.action_rate, {"k": 1.0}).load_kernel(), "expected .view, out, column, k"),
        (lambda: with_term(REWARDS, "slip", weight=1.0), "no term is named 'slip'; known are: joint_position"),
        (lambda: with_term(REWARDS, "root_pose", wight=1.0), "root_pose has no 'wight'; known are"),
        (lambda: EnvConfig(rewards=(*REWARDS, REWARDS[0])), "two reward terms are named joint_position"),
    ],
)
def test_what_is_wrong_with_a_term_is_said_in_one_line(action, message):
    with pytest.raises(Kine2GoError, match=message) as error:
        action()
    assert "\n" not in str(error.value)
