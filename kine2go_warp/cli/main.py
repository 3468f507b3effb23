"""Finds the command that the arguments name, and turns errors into one line and an exit status."""

import os
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from kine2go_warp import __version__
from kine2go_warp.cli.texts import command_prefix, sentence
from kine2go_warp.device import is_out_of_memory
from kine2go_warp.errors import Kine2GoError, explain
from kine2go_warp.extras import named_extras
from kine2go_warp.interruption import end_like_interrupted
from kine2go_warp.training.ranks import check_alone

if TYPE_CHECKING:
    from kine2go_warp.cli.commands import Doctor as Command

COMMANDS = {
    "demo": "run_command:Demo",
    "run": "run_command:Run",
    "status": "run_command:Status",
    "motion sources": "motion_commands:Sources",
    "motion new": "new_motion_command:NewMotion",
    "motion retarget": "motion_commands:Retarget",
    "motion cycles": "motion_commands:Cycles",
    "motion discover": "discover_command:Discover",
    "motion export": "export_command:ExportClips",
    "policy train": "train_command:Train",
    "policy eval": "eval_command:Eval",
    "policy sim2sim": "sim2sim_command:Sim2Sim",
    "policy export": "export_policy_command:ExportPolicy",
    "policy ablate": "ablate_command:Ablate",
    "dataset gather": "commands:Gather",
    "dataset check": "check_command:Check",
    "dataset review": "review_command:Review",
    "dataset score": "score_command:Score",
    "dataset quality": "quality_command:Quality",
    "dataset replay": "replay_command:Replay",
    "dataset report": "report_command:Report",
    "dataset render": "render_command:Render",
    "dataset benchmark": "benchmark_command:Benchmark",
    "dataset export": "export_command:Export",
    "dataset publish": "publish_command:Publish",
    "deploy": "deploy_command:Deploy",
    "doctor": "commands:Doctor",
    "bench": "bench_command:Bench",
}
"""Where each command is, imported only when it is wanted."""

GROUPS = {
    "": "whole runs, a robot, and this machine",
    "motion": "source clips and their retargeting",
    "policy": "training and what becomes of a policy",
    "dataset": "rollouts and the data made of them",
}
"""What the commands of a group work on."""

OLD_NAMES = {
    name.split()[1]: name for name in COMMANDS if " " in name and name not in ("motion export", "policy export")
}
OLD_NAMES["export-policy"] = "policy export"
"""Names that commands had before they were grouped."""

FIRST_STEPS = """From quadruped motion clips to state-action data for the Unitree Go2.

  kine2go demo                          the whole pipeline on a bundled clip, into runs/demo
  kine2go doctor                        versions, devices, and which motions can be used here
  kine2go run RECIPE --data FOLDER      all stages for the motions of a recipe
  kine2go --help                        all commands
"""

USER_ERROR = 2
INTERRUPTED = 130
PIPE_CLOSED = 141
"""Exit status after the reader of the output has closed the pipe, that of SIGPIPE."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status.

    0; 1 if a check of a dataset found something; 2 for an error that the user can mend; 130 if interrupted, 143 by
    SIGTERM, 129 by SIGHUP; 141 if the output is closed.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    message = ""
    try:
        with named_extras():
            command = parsed(given)
            if command is None:
                return 0
            message = "kine2go: interrupted; nothing finished is lost, and training continues from its last checkpoint"
            return command.run()
    except BrokenPipeError:
        # The interpreter would report an error when it flushes into the closed pipe.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    except Exception as error:
        if not (reason := reason_of(error)):
            raise
        return report(reason)
    except KeyboardInterrupt as interruption:
        if message:
            print(message, file=sys.stderr)
        return getattr(interruption, "status", INTERRUPTED)


def reason_of(error: Exception) -> str:
    """Return in a line what a user can mend; nothing for a defect of this package."""
    if isinstance(error, Kine2GoError):
        return str(error)
    if isinstance(error, OSError):
        return explain(error)
    if isinstance(error, RuntimeError) and str(error).startswith("Symlink loop"):  # of pathlib, before Python 3.13
        return f"{error}; name a file or folder that links lead to"
    if is_out_of_memory(error):
        return "out of memory; try half as many worlds, or for gather half as many --trajectories"
    return ""


def parsed(given: list[str]) -> "Command | None":
    """Return the command with its options, none if the arguments only ask for information, which is then printed.

    Raises:
        Kine2GoError: there is no such command, or torchrun has started several.
    """
    first = given[0] if given else ""
    if not given:
        print(FIRST_STEPS.replace("  kine2go", f"  {command_prefix()}kine2go"), end="")
    elif first == "--version":
        print(f"kine2go {__version__}")
    elif first in ("-h", "--help", "help"):
        print_commands(GROUPS)
    elif first in GROUPS and (len(given) == 1 or given[1] in ("-h", "--help", "help")):
        print_commands([first])
    elif first.startswith("--tyro-"):
        import tyro

        from kine2go_warp.cli.options import REGISTRY

        tyro.cli(every_command(), prog="kine2go", args=given, registry=REGISTRY)
    else:
        name, rest = find_command(given)
        if name != "policy train":
            check_alone(name)
        return parse(name, rest)
    return None


def find_command(given: list[str]) -> tuple[str, list[str]]:
    """Return the name of a command, of one word or two, and the arguments after it.

    Raises:
        Kine2GoError: there is no such command.
    """
    for count in (2, 1):
        name = " ".join(given[:count])
        if name in COMMANDS:
            return name, given[count:]
    if given[0] in OLD_NAMES:
        name = OLD_NAMES[given[0]]
        if sys.stderr.isatty():
            print(f"kine2go: '{given[0]}' is now '{name}'; the old name still works", file=sys.stderr)
        return name, given[1:]
    from difflib import get_close_matches

    if given[0] in GROUPS:
        wanted, known = given[1], {name.split()[1]: name for name in COMMANDS if group_of(name) == given[0]}
    else:
        wanted, known = (
            given[0],
            {name: name for name in (*GROUPS, *COMMANDS) if name and not group_of(name)} | OLD_NAMES,
        )
    near = dict.fromkeys(known[name] for name in get_close_matches(wanted, known, n=2))
    hint = f"did you mean {' or '.join(map(repr, near))}?" if near else "'kine2go --help' lists all"
    raise Kine2GoError(f"unknown command '{wanted}'; {hint}")


def imported(name: str) -> type[Any]:
    """Return the class of a command."""
    import importlib

    module, _, kind = COMMANDS[name].partition(":")
    return getattr(importlib.import_module(f"kine2go_warp.cli.{module}"), kind)


def parse(name: str, arguments: list[str]) -> "Command":
    """Return a command with its options, or exit if they only ask for help.

    Raises:
        Kine2GoError: an option is wrong.
    """
    from kine2go_warp.cli import options

    kind, default = imported(name), None
    if name == "policy train":
        from kine2go_warp.cli.train_command import default_train

        default = default_train(arguments)  # its options begin with the settings of the preset that they name
    return options.parse(kind, f"kine2go {name}", arguments, default)


def every_command() -> Any:
    """Return all commands as one type, from which tyro writes the completions of a shell."""
    from dataclasses import make_dataclass
    from typing import Annotated, Literal, Union

    import tyro

    from kine2go_warp.motions.catalogue import load_catalogue

    known: Any = Literal[tuple(load_catalogue())]

    def completed(name: str) -> type[Any]:
        kind = imported(name)
        if name != "run":
            return kind
        # Values of options are completed, arguments without a name are not.
        return make_dataclass(kind.__name__, [("motions", tuple[known, ...], ())], bases=(kind,), frozen=True)

    def union(names: dict[str, str]) -> Any:
        kinds = [Annotated[completed(full), tyro.conf.subcommand(short)] for short, full in names.items()]
        return Union[tuple(kinds)]  # noqa: UP007 - of a number of types that is not written here

    groups = []
    for group in GROUPS:
        names = {name.split()[-1]: name for name in COMMANDS if group_of(name) == group}
        groups.append(union(names) if not group else Annotated[union(names), tyro.conf.subcommand(group)])
    return Union[tuple(groups)]  # noqa: UP007


def group_of(name: str) -> str:
    """Return the group of a command, empty for those of one word."""
    return name.partition(" ")[0] if " " in name else ""


def print_commands(groups: Sequence[str] | dict[str, str]) -> None:
    """Print the commands of some groups, a line each."""
    program = "kine2go" if len(groups) > 1 else f"kine2go {next(iter(groups))}"
    print(f"usage: {program} COMMAND [OPTIONS]; '--help' after a command explains its options")
    for group in groups:
        print(f"\n{group or 'runs'}: {GROUPS[group]}")
        for name in COMMANDS:
            if group_of(name) == group:
                summary = (imported(name).__doc__ or "").strip().splitlines()[0]
                print(f"  {name:<18}{summary}")


def report(message: str) -> int:
    """Print an error in one line and return the exit status."""
    print(f"kine2go: error: {sentence(' '.join(message.split()))}", file=sys.stderr)
    return USER_ERROR


def run_script(run: Callable[[Any], None], settings: type, arguments: Sequence[str] | None = None) -> int:
    """Run a script whose options are the fields of a dataclass, and return the exit status.

    Args:
        run: What it does.
        settings: The dataclass.
        arguments: Of the command line; by default those of this process.
    """
    import tyro

    try:
        run(tyro.cli(settings, description=settings.__doc__, args=arguments))
    except Kine2GoError as error:
        return report(str(error))
    return 0


def entry_point() -> None:
    """Run the console script."""
    end_like_interrupted()
    try:
        status = main()
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = PIPE_CLOSED
    sys.exit(status)
