"""Runs pytest inside Blender.

`blender -b --factory-startup --addons talbot --python run_pytest.py -- [pytest's arguments]`; ends the process with
pytest's status. Blender prints straight to the file descriptors, which pytest captures.
"""

from __future__ import annotations

import sys

import pytest

sys.dont_write_bytecode = True
arguments = sys.argv[sys.argv.index("--") + 1 :]
code = int(pytest.main(arguments))
sys.stdout.flush()
sys.stderr.flush()
if code == pytest.ExitCode.NO_TESTS_COLLECTED:
    code = 0
sys.exit(code)
