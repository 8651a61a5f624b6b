"""The commands of `posecast`, and the program that runs each."""

from __future__ import annotations

from posecast_wire.command_line.parser import CommandParser

EDGE = {
    "edge": "all commands of the robot's agent (posecast-edge)",
    "doctor": "check a model, a profile or a source for problems",
    "probe": "list what a source delivers; needs no profile",
    "model": "model build: make a robot's model small enough for phones",
    "profile": "profile new: generate a profile from a robot's model",
}
RELAY = {
    "relay": "all commands of the relay (posecast-relay)",
    "robots": "set who may publish and watch; make share links",
    "past": "list, export and delete recordings that the relay keeps",
    "convert": "convert a .posecast file to .mcap or .csv",
}
OWN = {
    "demo": "start a relay and a demo robot, and open its page",
    "run": "put your robot on a page, through a new or a running relay",
}
COMMANDS = (*OWN, *EDGE, *RELAY, "completion")
COMPLETION = (
    'bash: add eval "$(posecast completion bash)" to ~/.bashrc. '
    'zsh: add eval "$(posecast completion zsh)" to ~/.zshrc, below compinit. '
    "fish: add posecast completion fish | source to ~/.config/fish/config.fish."
)
SHELLS = ("bash", "zsh", "fish")
STATUSES = {
    0: "done, or stopped by Ctrl-C",
    1: "the relay or the agent failed",
    2: "wrong arguments, or it can't start",
}


def make_parser() -> CommandParser:
    """The commands, without their arguments."""
    parser = CommandParser(
        prog="posecast",
        description="Put a robot on a URL. Posecast reads the robot and never commands it. Start with "
        "`posecast demo`. `posecast COMMAND --help` lists a command's flags.",
        statuses=STATUSES,
        version=True,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND", title="commands")
    for name, text in (OWN | EDGE | RELAY).items():
        commands.add_parser(name, help=text)
    completion = commands.add_parser(
        "completion", help="print the shell completion script for bash, zsh or fish"
    )
    completion.add_argument("shell", choices=SHELLS)
    completion.epilog = COMPLETION
    return parser
