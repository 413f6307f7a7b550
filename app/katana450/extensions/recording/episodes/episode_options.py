"""Options of ``katana450 record episodes``; reading them must load nothing heavy."""

from __future__ import annotations

import argparse
from pathlib import Path

OUTCOMES = ("success", "failure", "unjudged")


def add_episode_options(parser: argparse.ArgumentParser) -> None:
    """Add the subcommands of ``katana450 record episodes`` to ``parser``."""
    names = "list | start | stop | judge | discard | restore | undo | rerecord | describe | trim"
    acts = parser.add_subparsers(dest="episode_act", required=True, metavar=f"{names} | recover")
    listed = acts.add_parser("list", help="list the episodes of a server, or in a folder")
    listed.add_argument("folder", type=Path, nargs="?", metavar="FOLDER")
    start = acts.add_parser("start", help="begin an episode")
    start.add_argument("task", nargs="?", metavar="TASK", help="default: that of the last episode")
    stop = acts.add_parser("stop", help="end the episode that runs, and keep it in a file")
    stop.add_argument("outcome", nargs="?", choices=OUTCOMES, default="unjudged")
    judge = acts.add_parser("judge", help="judge an episode; one that runs is ended first")
    judge.add_argument("outcome", choices=OUTCOMES)
    discard = acts.add_parser("discard", help="move an episode to the discarded ones")
    for each in (judge, discard):
        each.add_argument(
            "number", type=int, nargs="?", metavar="NUMBER", help="default: the last episode"
        )
    restore = acts.add_parser("restore", help="bring a discarded episode back")
    acts.add_parser(
        "undo", help="undo the last judgement, discard or re-record, up to 10 s after it"
    )
    acts.add_parser(
        "rerecord",
        help="begin the last episode again; when the new one is kept, the old one is discarded",
    )
    describe = acts.add_parser("describe", help="change task or note of an episode")
    trim = acts.add_parser("trim", help="give an episode another start and end")
    for each in (restore, describe, trim):
        each.add_argument("number", type=int, metavar="NUMBER")
    describe.add_argument("--task", metavar="TEXT")
    describe.add_argument("--note", metavar="TEXT")
    for name, dest in (("--from", "start"), ("--to", "end")):
        trim.add_argument(
            name,
            dest=dest,
            type=float,
            required=True,
            metavar="S",
            help="seconds after the start of its file",
        )
    recover = acts.add_parser(
        "recover", help="finish the episode that ran when a server ended, without that server"
    )
    recover.add_argument("folder", type=Path, metavar="FOLDER")
    for name, act in acts.choices.items():
        if name != "recover":
            act.add_argument(
                "--url",
                default="http://127.0.0.1:8080",
                help="address of the server (default: %(default)s)",
            )
            act.add_argument(
                "--token", default="", help="token of an access link, if the server needs one"
            )
