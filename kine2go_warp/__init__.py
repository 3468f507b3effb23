"""From quadruped motion clips to state-action data for the Unitree Go2.

The names of ``__all__`` are imported when they are first used, so that ``import kine2go_warp`` loads nothing heavy.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kine2go_warp import robots
    from kine2go_warp.api import evaluate, gather, make_env, retarget, train
    from kine2go_warp.dataset import open_dataset
    from kine2go_warp.learning import presets
    from kine2go_warp.learning.gymnasium_env import GymnasiumVectorEnv
    from kine2go_warp.motions import sources

__version__ = "0.1.0"

__all__ = [
    "GymnasiumVectorEnv",
    "__version__",
    "evaluate",
    "gather",
    "make_env",
    "open_dataset",
    "presets",
    "retarget",
    "robots",
    "sources",
    "train",
]

_MODULES = {
    "GymnasiumVectorEnv": "kine2go_warp.learning.gymnasium_env",
    "open_dataset": "kine2go_warp.dataset",
    "presets": "kine2go_warp.learning",
    "robots": "kine2go_warp",
    "sources": "kine2go_warp.motions",
}
"""Where names are that are not in ``api``."""


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'kine2go_warp' has no attribute '{name}'")
    from kine2go_warp.extras import named_extras

    with named_extras():
        if name in ("presets", "robots", "sources"):
            value: Any = importlib.import_module(f"{_MODULES[name]}.{name}")
        else:
            value = getattr(importlib.import_module(_MODULES.get(name, "kine2go_warp.api")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
