"""Entry of `./talbot`, once the packages are there. `launcher/` has one module per command."""

from __future__ import annotations

import sys

from launcher.cli import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
