"""The ``kine2go`` command."""
