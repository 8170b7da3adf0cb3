"""Simplify's culling: objects that are left out because the camera does not see their box, or because it is far away.

An object asks for either rule or both; of both it must break both. Panoramic cameras and stereo leave nothing out.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from .. import versions

Boxes = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass
class Culling:
    """A camera and how far beyond its frame, and from it, objects are still shown."""

    to_camera: NDArray[np.float64]
    position: NDArray[np.float64]
    window: tuple[float, ...]
    """left, right, bottom, top of the frame, as cameras are sent."""
    clip: tuple[float, float]
    perspective: bool
    frame_margin: float | None
    """In frames; None: the frame is no reason."""
    distance: float | None

    def rules(self, obj: Any) -> tuple[bool, bool]:
        """Whether the object asks to be left out beyond the frame, beyond the distance."""
        cycles = versions.cycles_settings(obj)
        return (
            self.frame_margin is not None and bool(cycles.get("use_camera_cull", False)),
            self.distance is not None and bool(cycles.get("use_distance_cull", False)),
        )

    def hidden(self, boxes: Boxes, matrices: NDArray[np.float32], by_frame: Mask, by_distance: Mask) -> Mask:
        """Which of n objects are left out; boxes (n, 8, 3) in object space, matrices (n, 16) by columns."""
        maps = matrices.reshape(-1, 4, 4).transpose(0, 2, 1).astype(np.float64)
        corners = np.einsum("nij,nkj->nki", maps[:, :3, :3], boxes) + maps[:, None, :3, 3]
        outside = self._beyond_frame(corners) if by_frame.any() else np.zeros(len(boxes), np.bool_)
        far = self._beyond_distance(corners) if by_distance.any() else np.zeros(len(boxes), np.bool_)
        return (by_frame | by_distance) & (outside | ~by_frame) & (far | ~by_distance)

    def _beyond_frame(self, corners: NDArray[np.float64]) -> Mask:
        margin, (near, end) = self.frame_margin or 0.0, self.clip
        seen = corners @ self.to_camera[:3, :3].T + self.to_camera[:3, 3]
        depth = -seen[..., 2]
        left, right, bottom, top = self.window
        plane = seen[..., :2]
        if self.perspective:
            plane = plane / np.where(np.abs(depth) > 1e-12, depth, 1e-12)[..., None]
        place = (plane - (left, bottom)) / (right - left, top - bottom)
        # The projection's depth: 0 at the near end.
        height = (depth - near) / (end - near) * (end if self.perspective else 1.0)
        place = np.where((height < 0.0)[..., None], 1.0 - place, place)
        behind = (height < -margin).all(1)
        low, high = place.min(1), place.max(1)
        return behind | (low >= 1.0 + margin).any(1) | (high <= -margin).any(1)

    def _beyond_distance(self, corners: NDArray[np.float64]) -> Mask:
        nearest = np.clip(self.position, corners.min(1), corners.max(1))
        return ((nearest - self.position) ** 2).sum(1) > (self.distance or 0.0) ** 2


def culling_of(scene: Any, camera: dict[str, Any]) -> Culling | None:
    """The scene's rules with a camera as it is sent (empty: not known); None when nothing is left out."""
    cycles = versions.cycles_settings(scene)
    if not camera or not scene.render.use_simplify or scene.render.use_multiview or camera.get("type") == "panoramic":
        return None
    distance = float(cycles.get("distance_cull_margin", 50.0))
    by_distance = bool(cycles.get("use_distance_cull", False)) and distance > 0.0
    by_frame = bool(cycles.get("use_camera_cull", False))
    if not by_frame and not by_distance:
        return None
    matrix = np.array(camera["to_world"], np.float64).reshape(4, 4).T
    return Culling(
        to_camera=np.array(Matrix(matrix.tolist()).inverted_safe(), np.float64),
        position=matrix[:3, 3],
        window=tuple(camera["view"]),
        clip=(float(camera.get("clip_start", 0.1)), float(camera.get("clip_end", 1000.0))),
        perspective=camera.get("type", "perspective") == "perspective",
        frame_margin=float(cycles.get("camera_cull_margin", 0.1)) if by_frame else None,
        distance=distance if by_distance else None,
    )
