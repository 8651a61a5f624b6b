"""The commands of `posecast`, and which program each of them is."""

from __future__ import annotations

from posecast_wire.command_line.parser import CommandParser

EDGE = {
    "edge": "the commands of a robot's agent, as posecast-edge has them",
    "doctor": "say what is wrong with a model, a profile or a source",
    "probe": "list what a source offers, before there is a profile",
    "model": "model build: make a robot's model small enough for phones",
    "profile": "profile new: write a profile to start from, made of a model",
}
RELAY = {
    "relay": "the commands of a relay, as posecast-relay has them",
    "robots": "set who may publish and watch; make share links",
    "past": "list, export and delete what the relay keeps of the past",
}
OWN = {
    "demo": "show a demo robot on a page, all of it started in this terminal",
    "run": "put your robot on a page, by a relay that it starts or joins",
}
COMMANDS = (*OWN, *EDGE, *RELAY, "completion")
COMPLETION = (
    'in ~/.bashrc: eval "$(posecast completion bash)"; in ~/.zshrc likewise, below compinit; '
    "in ~/.config/fish/config.fish: posecast completion fish | source"
)
SHELLS = ("bash", "zsh", "fish")
STATUSES = {0: "done, or ended by Ctrl-C", 1: "a part failed", 2: "wrong arguments, or a part can't start"}


def make_parser() -> CommandParser:
    """The commands, without their arguments."""
    parser = CommandParser(
        prog="posecast",
        description="Put a robot on a URL. Posecast reads the robot and never commands it. Begin with "
        "`posecast demo`; `posecast COMMAND --help` has the flags of each command.",
        statuses=STATUSES,
        version=True,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", title="commands")
    for name, text in (OWN | EDGE | RELAY).items():
        commands.add_parser(name, help=text)
    completion = commands.add_parser(
        "completion", help="print a script that makes a shell complete commands and flags"
    )
    completion.add_argument("shell", choices=SHELLS)
    completion.epilog = COMPLETION
    return parser
