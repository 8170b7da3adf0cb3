"""The lines of the last render of each scene, for the Warnings panel and for Blender's own report list."""

from dataclasses import dataclass, field
from typing import Any

MAX_REPORTED = 30
"""Lines handed to Blender's report list for one view layer; the panel lists more."""

MAX_KEPT = 200


@dataclass(frozen=True)
class Line:
    """One message. `where` names the object, material or node it speaks of."""

    level: str  # info, warning, error
    text: str
    where: str = ""
    count: int = 1

    def __str__(self) -> str:
        place = f"{self.where}: " if self.where else ""
        times = f" ({self.count} times)" if self.count > 1 else ""
        return f"{place}{self.text}{times}"


@dataclass
class Reports:
    """What one render of a scene had to say."""

    lines: list[Line] = field(default_factory=list)
    seen: set[tuple[str, str, str]] = field(default_factory=set)

    def add(self, line: Line) -> bool:
        """Keeps the line. False when it was there before (a second view layer, a later frame)."""
        key = (line.level, line.text, line.where)
        if key in self.seen:
            return False
        self.seen.add(key)
        if len(self.lines) < MAX_KEPT:
            self.lines.append(line)
        return True


_by_scene: dict[str, Reports] = {}


def begin(scene_name: str) -> Reports:
    """Forgets what the scene's last render said."""
    _by_scene[scene_name] = Reports()
    return _by_scene[scene_name]


def of_scene(scene_name: str) -> Reports:
    """What the scene's last render said."""
    return _by_scene.setdefault(scene_name, Reports())


def clear() -> None:
    """Forgets all scenes: another file was opened."""
    _by_scene.clear()


def from_session(session: Any) -> list[Line]:
    """The session's own lines."""
    return [Line(level, text, where, count) for level, text, where, count in session.report()]


def publish(engine: Any, reports: Reports, lines: list[Line]) -> None:
    """Adds the lines and hands the new ones to Blender: a WARNING is printed, an ERROR keeps files unwritten."""
    new = [line for line in lines if reports.add(line) and line.level != "info"]
    for line in new[:MAX_REPORTED]:
        engine.report({"ERROR" if line.level == "error" else "WARNING"}, str(line))
    if len(new) > MAX_REPORTED:
        rest = len(new) - MAX_REPORTED
        engine.report({"WARNING"}, f"{rest} more warnings: see Properties > Render > Warnings")
