"""What the scripts that run inside Blender share: the job comes as an argument, the answer goes into a file."""

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def run(measure: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Writes what `measure` answers, or {"error": ...}: the bench reports it and goes on."""
    job = json.loads(next(a for a in sys.argv if a.startswith("JOB="))[4:])
    try:
        answer = measure(job)
    except Exception as error:
        answer = {"error": f"{type(error).__name__}: {error}"}
    target = Path(job["folder"]) / "result.json"
    target.with_suffix(".part").write_text(json.dumps(answer))
    os.replace(target.with_suffix(".part"), target)
