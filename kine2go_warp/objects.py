"""Python objects by reference: ``package.module:NAME``, or ``path/to/file.py:NAME`` of a user's own file."""

import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from kine2go_warp.errors import Kine2GoError


def load_object(reference: str) -> Any:
    """Return the object that a reference names. A file is run once in a process.

    Raises:
        Kine2GoError: the reference is malformed, or its module, file or name does not exist or cannot be imported.
    """
    where, separator, name = reference.rpartition(":")
    if not separator or not where or not name.isidentifier():
        raise Kine2GoError(f"'{reference}' is no reference to a Python object; write module:NAME or file.py:NAME")
    module = load_file(Path(where)) if where.endswith(".py") else load_module(where)
    if not hasattr(module, name):
        raise Kine2GoError(f"{where}: defines no '{name}'")
    return getattr(module, name)


def load_module(name: str) -> ModuleType:
    """Import a module.

    Raises:
        Kine2GoError: there is none of that name.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise Kine2GoError(f"module {name} cannot be imported ({error})") from None


def load_file(path: Path) -> ModuleType:
    """Run a Python file as a module, once in a process.

    Raises:
        Kine2GoError: there is no such file, or it raises an error.
    """
    path = path.resolve()
    name = f"kine2go_file_{path.stem}_{hashlib.sha256(str(path).encode()).hexdigest()[:8]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise Kine2GoError(f"{path}: no such Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        if isinstance(error, Kine2GoError):
            raise
        raise Kine2GoError(f"{path}: cannot be run ({type(error).__name__}: {error})") from error
    return module


def reference_to(function: Any, name: str) -> str:
    """Return the reference to a function: by module where Python finds that by its name, by file otherwise."""
    module, file = function.__module__, function.__code__.co_filename
    spec = None if module == "__main__" or module.startswith("kine2go_file_") else importlib.util.find_spec(module)
    return f"{module if spec is not None else Path(file).resolve()}:{name}"
