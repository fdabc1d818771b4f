"""``python -m idloop_nodes EXECUTABLE [--ros-args ...]``: a node without its installed script."""

from __future__ import annotations

import sys

from idloop_nodes.descriptions import KINDS
from idloop_nodes.runtime import WRONG_USE, run

if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in KINDS:
        sys.stderr.write(f"usage: python -m idloop_nodes {{{','.join(KINDS)}}} [--ros-args ...]\n")
        sys.exit(WRONG_USE)
    sys.exit(run(sys.argv[1], sys.argv[1:]))
