"""`python -m posecast_command`."""

from posecast_command.main import main

main()
