"""Opens a native session together with the reader that fills it from Blender's data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from . import native

if TYPE_CHECKING:
    from .sync.depsgraph import SceneSync


@dataclass
class Synced:
    """A session and its reader."""

    session: Any
    sync: SceneSync


def open_session() -> Synced:
    """A fresh pair; raises native.Unavailable. The reader is imported here: Blender's start should not pay for it."""
    session = native.module().Session()
    from .sync.depsgraph import SceneSync

    return Synced(session, SceneSync(session))
