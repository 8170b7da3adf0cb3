"""The session's meshes: which geometry it has, and when it is read again."""

from dataclasses import dataclass
from typing import Any

from .changes import Key
from .context import SyncContext
from .geometry import read_record
from .records import Record
from .subdivision import Dicing, DicingView


@dataclass
class MeshEntry:
    """A mesh the session has: its handle, whose change makes it stale."""

    handle: int
    owners: set[Key]
    dicing: Dicing | None


class MeshSync:
    """Keeps a session's meshes equal to those of the records."""

    def __init__(self, context: SyncContext) -> None:
        self.context = context
        self.dicing = DicingView()
        self._entries: dict[tuple[int, int], MeshEntry] = {}

    def forget(self) -> None:
        """Removes all of them."""
        for entry in self._entries.values():
            self.context.session.remove_mesh(entry.handle)
        self._entries.clear()
        self.dicing = DicingView()

    def send(
        self, records: list[Record], stale: set[Key], stale_all: bool, depsgraph: Any
    ) -> tuple[list[int], bool, list[int]]:
        """Handles by record, whether a mesh was sent, handles nobody uses any more (removed after the objects)."""
        handles: list[int] = []
        seen: set[tuple[int, int]] = set()
        changed = False
        for record in records:
            pointer = record.key()
            entry = self._entries.get(pointer)
            if pointer in seen and entry is not None:
                entry.owners |= record.owners
                handles.append(entry.handle)
                continue
            seen.add(pointer)
            stays = entry is not None and not stale_all and entry.dicing == record.dicing
            if stays and not (entry.owners | record.owners) & stale:
                entry.owners |= record.owners
                handles.append(entry.handle)
                continue
            changed = True
            self.dicing.stale |= record.dicing is not None
            self.context.check()
            arrays = read_record(self.context, record, depsgraph)
            if arrays is None:
                if entry is not None:
                    seen.discard(pointer)
                handles.append(-1)
            elif entry is not None:
                self.context.session.set_mesh(entry.handle, record.mesh_name, arrays)
                entry.owners, entry.dicing = set(record.owners), record.dicing
                handles.append(entry.handle)
            else:
                handle = self.context.session.add_mesh(record.mesh_name, arrays)
                self._entries[pointer] = MeshEntry(handle, set(record.owners), record.dicing)
                handles.append(handle)
        removed = [self._entries.pop(pointer).handle for pointer in set(self._entries) - seen]
        return handles, changed or bool(removed), removed
