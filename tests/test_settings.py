"""Settings from dictionaries: what is laid over what, by name, and how wrong keys and values are refused."""

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import pytest
import tyro

from kine2go_warp.cli.options import REGISTRY
from kine2go_warp.errors import Kine2GoError
from kine2go_warp.settings import Named, check_ranges, from_dictionary, override, to_dictionary


@dataclass(frozen=True)
class Term(Named):
    kernel: str
    weight: float = 1.0
    params: tuple[tuple[str, float], ...] = ()


TERMS = (Term("pose", "module:pose", 0.5, (("k", 5.0), ("margin", 0.1))), Term("slip", "module:slip", -0.1))


@dataclass(frozen=True)
class Span(Named):
    main_field: ClassVar[str] = "limits"

    limits: tuple[float, ...] = ()
    shared: bool = False


SPANS = (Span("mass"), Span("drag", (1.0, 2.0), shared=True))


@dataclass(frozen=True)
class Inner:
    stiffness: float = 30.0
    limits: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self) -> None:
        check_ranges(self, stiffness=(0, 1000))


@dataclass(frozen=True)
class Outer:
    mode: Literal["slow", "quick"] = "slow"
    share: float | None = 0.5
    inner: Inner = field(default_factory=lambda: Inner(limits=(0.2, 0.8)))
    terms: tuple[Term, ...] = TERMS
    spans: tuple[Span, ...] = SPANS


def test_values_are_laid_over_what_is_there_down_to_single_fields():
    found = override(Outer(inner=Inner(7.0)), {"inner.limits": [0.1, 1], "share": "none"})
    assert found == Outer(share=None, inner=Inner(7.0, (0.1, 1.0)))
    assert from_dictionary(Outer, {"inner": {"stiffness": 2}}, "file").inner == Inner(2.0, (0.2, 0.8))


def test_records_and_their_parameters_are_addressed_by_name():
    found = override(Outer(), {"terms.pose.weight": 2, "terms.pose.params.k": 3})
    assert found.terms == (Term("pose", "module:pose", 2.0, (("k", 3.0), ("margin", 0.1))), TERMS[1])
    added = override(Outer(), {"terms.mine.kernel": "mine.py:kernel"})
    assert added.terms == (*TERMS, Term("mine", "mine.py:kernel"))


def test_the_main_field_stands_for_a_record_whose_other_fields_keep_their_defaults():
    assert to_dictionary(Outer())["spans"] == {"mass": [], "drag": {"limits": [1.0, 2.0], "shared": True}}
    found = override(Outer(), {"spans.mass": [0, 1], "spans.drag": [3, 4]})
    assert found.spans == (Span("mass", (0.0, 1.0)), Span("drag", (3.0, 4.0), shared=True))


def test_a_written_tree_is_read_back_whole_without_what_it_does_not_name():
    few = Outer(terms=TERMS[1:])
    assert to_dictionary(Outer())["terms"]["pose"]["params"] == {"k": 5.0, "margin": 0.1}
    for settings in (Outer(), few):
        assert from_dictionary(Outer, to_dictionary(settings), "file") == settings


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"inner.stifness": 1}, "unknown key 'inner.stifness'; near ones are: inner.stiffness"),
        ({"stiffness": 1}, "unknown key 'stiffness'; near ones are: inner.stiffness"),
        ({"terms.pse.weight": 1}, "unknown key 'terms.pse'; near ones are: terms.pose"),
        ({"terms.pose.params.q": 1}, "unknown key 'terms.pose.params.q'; known are: .*params.k, .*params.margin"),
        ({"mode": "fast"}, "'mode' is \"fast\"; allowed are: slow, quick"),
        ({"inner.stiffness": -2}, "stiffness is -2.0; it must be from 0 to 1,000"),
        ({"inner.stiffness": float("nan")}, "'inner.stiffness' is nan; it must be finite"),
        ({"inner.stiffness": True}, "'inner.stiffness' must be a number, not true"),
        ({"inner.limits": [0, 1, 2]}, r"'inner.limits' must be a list of 2, not \[0, 1, 2\]"),
        ({"terms": "pose"}, "'terms' must be a list, not \"pose\""),
        ({"spans.mas": [0, 1]}, "unknown key 'spans.mas'; near ones are: spans.mass"),
        ({"spans.mass": 3}, "'spans.mass.limits' must be a list, not 3"),
        ({"inner": 3}, "'inner' must be a section, not 3"),
        ({"mode.x": 3}, "'mode' is .*allowed are"),
    ],
)  # fmt: skip
def test_a_wrong_key_or_value_is_refused_with_what_would_be_right(values, message):
    with pytest.raises(Kine2GoError, match=message):
        override(Outer(), values)


def test_options_name_records_and_parameters():
    arguments = ["--terms.pose.weight", "3", "--terms.pose.params.k", "4", "--inner.stiffness", "9"]
    arguments += ["--spans.drag", "5", "6"]
    found: Any = tyro.cli(Outer, args=arguments, registry=REGISTRY)
    assert found.inner.stiffness == 9.0
    assert found.spans == (SPANS[0], Span("drag", (5.0, 6.0), shared=True))
    assert found.terms == (Term("pose", "module:pose", 3.0, (("k", 4.0), ("margin", 0.1))), TERMS[1])
