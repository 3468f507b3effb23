"""Errors that a user can act on. The command line prints them as one line and exits with status 2."""

import errno


class Kine2GoError(Exception):
    """Base of all errors caused by the input, the settings or the machine rather than by a defect in this package."""


class ClipError(Kine2GoError):
    """A motion file or a saved clip cannot be used."""


class CatalogueError(Kine2GoError):
    """A motion is not in the catalogue, or the catalogue itself is malformed."""


class RecipeError(Kine2GoError):
    """A recipe file holds an unknown key, a wrong type or an impossible value."""


class PipelineError(Kine2GoError):
    """A run of a recipe cannot begin or go on: its folder is in use, or its artefacts cannot be read."""


class PolicyError(Kine2GoError):
    """A policy folder or a checkpoint cannot be used."""


class TrainingDiverged(Kine2GoError):  # noqa: N818 - an event that is handled, like an interruption
    """Training has broken down: numbers that are not finite, or episodes that have become short for good."""


class DatasetError(Kine2GoError):
    """A dataset cannot be read or written."""


class SimulationError(Kine2GoError):
    """The simulation has failed: too many contacts for its buffers, or numbers that are not finite."""


class ExportError(Kine2GoError):
    """A dataset cannot be exported as asked."""


class RenderError(Kine2GoError):
    """A dataset cannot be rendered or reported as asked, or this machine cannot draw."""


class RecordingError(Kine2GoError):
    """A recording cannot be made or shown as asked."""


class MissingExtraError(Kine2GoError, ModuleNotFoundError):
    """A package is not installed that one of the extras brings."""


def explain(error: OSError) -> str:
    """Return what went wrong with a file, and what to do."""
    where = f"{error.filename}: " if error.filename else ""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return f"{where}no space left on the disk; free some and run the same command again, nothing finished is lost"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"{where}no permission to write or read here; choose another folder"
    return f"{where}{error.strerror or error}"
