"""The commands of `posecast`, and which program each of them is."""

from __future__ import annotations

from posecast_wire.command_line.parser import CommandParser

EDGE = {
    "edge": "the agent beside a robot: run|probe|doctor|model|profile, as posecast-edge",
    "doctor": "what is wrong with a model, a profile, a source, in plain words",
    "probe": "what a source offers",
    "model": "model build: a robot's model and meshes, made small for phones",
    "profile": "profile new: a profile to start from, made of a model",
}
RELAY = {
    "relay": "the relay: run|robots|past, as posecast-relay",
    "robots": "who may publish and watch; share links",
    "past": "list, export and delete what is kept of the past",
}
OWN = {
    "demo": "a relay, its page and a demo robot, in this terminal",
    "run": "put a robot on a relay; one is started here if --relay names none",
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
        description="Put a robot on a URL: reads it, never commands it.",
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
