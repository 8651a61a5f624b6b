"""Makes the helpers beside the tests importable, and their fixtures known."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from achd_stage import server  # noqa: F401
from demo_stage import bundle, minute  # noqa: F401
from edge_stage import edge, profile_file, router  # noqa: F401
from ros_stage import graph  # noqa: F401
from source_stage import listen, moving  # noqa: F401
