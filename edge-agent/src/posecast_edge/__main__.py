"""`python -m posecast_edge`."""

from posecast_edge.cli import main

main()
