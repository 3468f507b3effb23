"""Parses the command line, and turns errors into one line and an exit status."""

import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from kine2go_warp.cli.ablate_command import Ablate
from kine2go_warp.cli.bench_command import Bench
from kine2go_warp.cli.check_command import Check
from kine2go_warp.cli.commands import Doctor, Gather
from kine2go_warp.cli.eval_command import Eval
from kine2go_warp.cli.export_command import Export
from kine2go_warp.cli.export_policy_command import ExportPolicy
from kine2go_warp.cli.motion_commands import Cycles, Retarget, Sources
from kine2go_warp.cli.quality_command import Quality
from kine2go_warp.cli.render_command import Render
from kine2go_warp.cli.replay_command import Replay
from kine2go_warp.cli.report_command import Report
from kine2go_warp.cli.review_command import Review
from kine2go_warp.cli.run_command import Demo, Run, Status
from kine2go_warp.cli.score_command import Score
from kine2go_warp.cli.sim2sim_command import Sim2Sim
from kine2go_warp.cli.train_command import REGISTRY, Train, default_train
from kine2go_warp.errors import Kine2GoError, explain

Command = (
    Annotated[Retarget, tyro.conf.subcommand("retarget")]
    | Annotated[Eval, tyro.conf.subcommand("eval")]
    | Annotated[Gather, tyro.conf.subcommand("gather")]
    | Annotated[Quality, tyro.conf.subcommand("quality")]
    | Annotated[Replay, tyro.conf.subcommand("replay")]
    | Annotated[Score, tyro.conf.subcommand("score")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Status, tyro.conf.subcommand("status")]
    | Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Check, tyro.conf.subcommand("check")]
    | Annotated[Review, tyro.conf.subcommand("review")]
    | Annotated[Sources, tyro.conf.subcommand("sources")]
    | Annotated[Cycles, tyro.conf.subcommand("cycles")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[Ablate, tyro.conf.subcommand("ablate")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[ExportPolicy, tyro.conf.subcommand("export-policy")]
    | Annotated[Sim2Sim, tyro.conf.subcommand("sim2sim")]
    | Annotated[Render, tyro.conf.subcommand("render")]
    | Annotated[Report, tyro.conf.subcommand("report")]
    | Annotated[Doctor, tyro.conf.subcommand("doctor")]
)

USER_ERROR = 2
INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status.

    0; 1 if a check of a dataset found something; 2 for an error that the user can mend; 130 if interrupted.
    """
    try:
        given = sys.argv[1:] if arguments is None else arguments
        # Its options begin with the settings of the preset that they name.
        train = Annotated[
            Train, tyro.conf.subcommand("train", default=default_train(given) if "train" in given else Train())
        ]
        command = tyro.cli(
            Command | train,  # pyright: ignore[reportArgumentType]
            prog="kine2go",
            description="From quadruped motion clips to state-action data for the Unitree Go2.",
            args=arguments,
            config=(tyro.conf.OmitSubcommandPrefixes,),
            registry=REGISTRY,
        )
        return command.run()
    except Kine2GoError as error:
        return report(str(error))
    except OSError as error:
        return report(explain(error))
    except KeyboardInterrupt:
        print(
            "kine2go: interrupted; nothing finished is lost, and training continues from its last checkpoint",
            file=sys.stderr,
        )
        return INTERRUPTED


def report(message: str) -> int:
    """Print an error in one line and return the exit status."""
    print(f"kine2go: error: {' '.join(message.split())}", file=sys.stderr)
    return USER_ERROR


def entry_point() -> None:
    """Run the console script."""
    sys.exit(main())
