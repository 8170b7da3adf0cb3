"""Light and shadow linking (4.0 and newer): which objects an emitter lights, and which cast its shadows.

Blender knows collections; the engine knows receiver sets, masks of them, and blocker groups (engine/scene/scene.h).
Every object is in the set of those that the same emitters light.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .context import SyncContext

MAX_RECEIVER_SETS, MAX_BLOCKER_GROUPS = 64, 63
CHOSEN_OR_NOT = 1 << 63
ALL_SETS, ALL_BLOCK = (1 << 64) - 1, -1
NO_LINKING = (ALL_SETS, ALL_BLOCK)

Subject = tuple[int, int]
"""An object and its instancer (0: none), pointers of the originals."""


@dataclass(frozen=True)
class LinkedObjects:
    """What a linking collection says. Without objects to include it means all; exclusion wins."""

    included: frozenset[int]
    excluded: frozenset[int]

    def holds(self, pointer: int) -> bool:
        """Whether the object belongs to it."""
        return pointer not in self.excluded and (not self.included or pointer in self.included)

    def names(self, pointer: int) -> bool:
        """Whether the collection says anything about the object."""
        return pointer in self.included or pointer in self.excluded


def linked_objects(collection: Any) -> LinkedObjects:
    """Members by the state of their link; a child collection's counts for all that is in it."""
    objects: dict[str, set[int]] = {"INCLUDE": set(), "EXCLUDE": set()}
    for member, link in zip(collection.objects, collection.collection_objects, strict=True):
        objects[link.light_linking.link_state].add(member.as_pointer())
    for child, link in zip(collection.children, collection.collection_children, strict=True):
        objects[link.light_linking.link_state].update(o.as_pointer() for o in child.all_objects)
    return LinkedObjects(frozenset(objects["INCLUDE"]), frozenset(objects["EXCLUDE"]))


@dataclass
class Resolved:
    """Answers for the subjects of one pass."""

    receiver_sets: dict[Subject, int]
    linkings: dict[Subject, tuple[int, int]]
    """Of emission, only where it is not NO_LINKING: mask of receiver sets, blocker group."""
    blockers: dict[Subject, int]
    """Mask of the groups whose shadows the object casts; CHOSEN_OR_NOT where a collection of blockers names it."""


@dataclass
class LinkPass:
    """Collects the subjects of one pass over the depsgraph; `resolve` at its end."""

    context: SyncContext
    _names: list[str] = field(default_factory=list)
    _collections: dict[int, int] = field(default_factory=dict)
    _objects: list[LinkedObjects] = field(default_factory=list)
    _links: dict[int, tuple[int, int]] = field(default_factory=dict)
    _subjects: set[Subject] = field(default_factory=set)

    def subject(self, obj: Any, parent: Any) -> Subject:
        """Registers an object of the pass, with its own links and its instancer's."""
        subject = (self._read(obj), self._read(parent) if parent is not None else 0)
        self._subjects.add(subject)
        return subject

    def _read(self, obj: Any) -> int:
        original = obj.original
        pointer = original.as_pointer()
        linking = getattr(original, "light_linking", None)
        if linking is not None and pointer not in self._links:
            pair = self._collection(linking.receiver_collection), self._collection(linking.blocker_collection)
            if pair != (-1, -1):
                self._links[pointer] = pair
        return pointer

    def _collection(self, collection: Any) -> int:
        if collection is None:
            return -1
        pointer = collection.as_pointer()
        if pointer not in self._collections:
            self._collections[pointer] = len(self._objects)
            self._objects.append(linked_objects(collection))
            self._names.append(collection.name)
        return self._collections[pointer]

    def resolve(self) -> Resolved | None:
        """None when nothing is linked."""
        if not self._links:
            return None
        # As in Cycles, the instancer speaks for its instances when there is anything to say about it.
        spoken = {p for o in self._objects for p in o.included | o.excluded} | set(self._links)
        speaker = {s: s[1] if s[1] in spoken else s[0] for s in self._subjects}
        receivers = self._in_use(receiver for receiver, _ in self._links.values())
        classes: dict[tuple[bool, ...], int] = {}
        sets: dict[Subject, int] = {}
        for subject in sorted(speaker):
            key = tuple(self._objects[c].holds(speaker[subject]) for c in receivers)
            sets[subject] = classes.setdefault(key, len(classes))
        if len(classes) > MAX_RECEIVER_SETS:
            self.context.warn(
                f"Light linking sorts the objects into {len(classes)} sets, more than the {MAX_RECEIVER_SETS} that are "
                f"supported; every light reaches everything"
            )
            receivers, sets = [], dict.fromkeys(sets, 0)
        masks = {c: sum(1 << i for key, i in classes.items() if key[at]) for at, c in enumerate(receivers)}
        groups = self._in_use(blocker for _, blocker in self._links.values())
        for collection in groups[MAX_BLOCKER_GROUPS:]:
            self.context.warn(
                f"Collection '{self._names[collection]}': more than {MAX_BLOCKER_GROUPS} collections of shadow linking "
                f"are not supported; everything casts the shadows of its lights"
            )
        numbers = {c: group for group, c in enumerate(groups[:MAX_BLOCKER_GROUPS])}
        linkings, blockers = {}, {}
        for subject, pointer in speaker.items():
            receiver, blocker = self._links.get(pointer, (-1, -1))
            linking = (masks.get(receiver, ALL_SETS), numbers.get(blocker, ALL_BLOCK))
            if linking != NO_LINKING:
                linkings[subject] = linking
            blockers[subject] = sum(1 << n for c, n in numbers.items() if self._objects[c].holds(pointer))
            if any(self._objects[c].names(pointer) for c in numbers):
                blockers[subject] |= CHOSEN_OR_NOT
        return Resolved(sets, linkings, blockers)

    def _in_use(self, collections: Iterable[int]) -> list[int]:
        return sorted({c for c in collections if c >= 0})


def linking_arrays(linked: Resolved, subjects: list[Subject]) -> dict[str, Any]:
    """What light linking adds to the objects' dictionary: `subjects` by record."""
    linkings = [linked.linkings.get(subject, NO_LINKING) for subject in subjects]
    different = sorted(set(linkings) - {NO_LINKING})
    index = {linking: i for i, linking in enumerate(different)}
    return {
        "receiver_set": np.array([linked.receiver_sets[subject] for subject in subjects], np.int32),
        "linking": np.array([index.get(linking, -1) for linking in linkings], np.int32),
        "linkings": different,
        "blocks": np.array([linked.blockers[subject] for subject in subjects], np.uint64)
        .view(np.uint32)
        .reshape(-1, 2),
    }
