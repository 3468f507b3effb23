"""Errors that a user can act on. The command line prints them as one line and exits with status 2."""


class Kine2GoError(Exception):
    """Base of all errors caused by the input, the settings or the machine rather than by a defect in this package."""


class ClipError(Kine2GoError):
    """A motion file or a saved clip cannot be used."""


class CatalogueError(Kine2GoError):
    """A motion is not in the catalogue, or the catalogue itself is malformed."""


class RecipeError(Kine2GoError):
    """A recipe file holds an unknown key, a wrong type or an impossible value."""


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
