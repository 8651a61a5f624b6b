"""`python -m posecast_edge`."""

from posecast_edge.cli.main import main

main()
