"""Which extra brings a package that is not installed, read from the metadata of this one."""

import contextlib
from collections.abc import Iterator

from kine2go_warp.errors import MissingExtraError

DISTRIBUTIONS = {
    "OpenGL": "mujoco",
    "PIL": "pillow",
    "pinocchio": "placo",
    "rerun": "rerun-sdk",
    "rsl_rl": "rsl-rl-lib",
    "tensordict": "rsl-rl-lib",
    "warp": "warp-lang",
    "yaml": "pyyaml",
}
"""Distributions of modules that are named otherwise, or that another one brings."""


def extras_with(module: str) -> list[str]:
    """Return the extras that bring a module, such as ``warp.types``; none if it is no dependency of this package."""
    import importlib.metadata
    import re

    module = module.partition(".")[0]
    wanted = DISTRIBUTIONS.get(module, module)
    found = []
    for requirement in importlib.metadata.requires("kine2go-warp") or []:
        match = re.match(r"([A-Za-z0-9_.-]+).*extra == ['\"]([a-z]+)['\"]", requirement)
        if match is not None and match[1] == wanted and match[2] != "all":
            found.append(match[2])
    return found


@contextlib.contextmanager
def named_extras() -> Iterator[None]:
    """Turn the failed import of an optional package into an error that names its extra.

    Raises:
        MissingExtraError: the block imports a package of an extra that is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        import importlib.metadata

        try:
            extras = extras_with(error.name or "")
        except importlib.metadata.PackageNotFoundError:
            raise MissingExtraError(f"{error.name} is not installed", name=error.name) from None
        if not extras:
            raise
        raise MissingExtraError(
            f"{error.name} is not installed; it comes with the extra '{extras[0]}': "
            f"pip install 'kine2go-warp[{extras[0]}]', or in a clone: uv sync --extra {extras[0]}",
            name=error.name,
        ) from None
