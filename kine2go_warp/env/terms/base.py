"""What all terms have in common: a name, a Warp kernel over ``WorldView``, and the kernel's parameters."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

from kine2go_warp.errors import Kine2GoError
from kine2go_warp.objects import load_object, reference_to
from kine2go_warp.settings import Named

if TYPE_CHECKING:
    import warp as wp

FIRST_ARGUMENTS = ("view", "out", "column")
"""Arguments of every term's kernel; its parameters follow."""

Params = tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Term(Named):
    """One term of an environment: data alone, so that it can be saved, compared and sent to other processes."""

    kernel: str | object
    """A Warp kernel ``(view: WorldView, out: wp.array2d(dtype=float), column: int, *params: float)``, launched over
    [num_worlds], or a reference to one, ``package.module:name`` or ``file.py:name``; kept as a reference."""
    params: Params = ()
    """Names and values of its further arguments. A mapping may be given."""

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise Kine2GoError(f"'{self.name}' is no name for a term; use letters, digits and underscores")
        if not isinstance(self.kernel, str):
            function: Any = getattr(self.kernel, "func", None)
            if function is None:
                raise Kine2GoError(f"term {self.name}: {self.kernel!r} is no Warp kernel")
            object.__setattr__(self, "kernel", reference_to(function, function.__name__))
        pairs = self.params.items() if isinstance(self.params, Mapping) else self.params
        object.__setattr__(self, "params", tuple((name, float(value)) for name, value in pairs))

    @property
    def param_values(self) -> dict[str, float]:
        """The parameters by name."""
        return dict(self.params)

    def load_kernel(self) -> "wp.Kernel":
        """Return the kernel.

        Raises:
            Kine2GoError: there is none, or its arguments are not those that the term gives it.
        """
        kernel = load_object(str(self.kernel))
        arguments = getattr(getattr(kernel, "adj", None), "args", None)
        if arguments is None:
            raise Kine2GoError(f"term {self.name}: {self.kernel} is no Warp kernel")
        found, expected = [argument.label for argument in arguments], [*FIRST_ARGUMENTS, *self.param_values]
        if found != expected:
            raise Kine2GoError(
                f"term {self.name}: {self.kernel} takes ({', '.join(found)}), expected ({', '.join(expected)})"
            )
        return kernel

    def launch(self, view: Any, out: "wp.array[Any]", column: int) -> None:
        """Launch the kernel over all worlds."""
        from kine2go_warp.kernels import launch

        inputs = [view, out, column, *self.param_values.values()]
        launch(self.load_kernel(), dim=out.shape[0], inputs=inputs)


AnyTerm = TypeVar("AnyTerm", bound=Term)
AnyNamed = TypeVar("AnyNamed", bound=Named)


def check_names(terms: Iterable[Named], kind: str) -> None:
    """Check that no two terms have one name.

    Raises:
        Kine2GoError: they have.
    """
    names = [term.name for term in terms]
    for name in names:
        if names.count(name) > 1:
            raise Kine2GoError(f"two {kind} terms are named {name}")


def find_term(terms: Sequence[AnyNamed], name: str) -> AnyNamed:
    """Return a term by name.

    Raises:
        Kine2GoError: there is none.
    """
    for term in terms:
        if term.name == name:
            return term
    raise Kine2GoError(f"no term is named '{name}'; known are: {', '.join(term.name for term in terms)}")


def with_term(terms: tuple[AnyTerm, ...], name: str, **changes: Any) -> tuple[AnyTerm, ...]:
    """Return terms with changes to the fields, or else to the parameters, of one of them.

    Raises:
        Kine2GoError: there is no such term, or it has no such field or parameter.
    """
    changed = find_term(terms, name)
    for key, value in changes.items():
        if key in changed.param_values:
            params = {**changed.param_values, key: value}
            changed = replace(changed, params=tuple(params.items()))
        elif key in changed.__dataclass_fields__:
            changed = replace(changed, **{key: value})
        else:
            known = [*changed.__dataclass_fields__, *changed.param_values]
            raise Kine2GoError(f"term {name} has no '{key}'; known are: {', '.join(known)}")
    return tuple(changed if term.name == name else term for term in terms)
