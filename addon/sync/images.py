"""Images: a file, a packed file's bytes, or pixels that live only in Blender (generated, painted)."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .context import SyncContext, id_key

ALPHA_MODES = {"STRAIGHT": "straight", "PREMUL": "premultiplied", "CHANNEL_PACKED": "channel_packed", "NONE": "none"}


class ImageSync:
    """Handles by image and what is read of it (a frame of a sequence)."""

    def __init__(self, context: SyncContext) -> None:
        self.context = context
        self._handles: dict[tuple[Any, ...], int] = {}
        self._stale: set[tuple[str, str]] = set()

    def begin(self, changed: set[tuple[str, str]]) -> None:
        """Starts a pass over the shaders; `changed` images are read again."""
        self._stale = set(changed)

    def clear(self) -> None:
        """Forgets and removes everything."""
        for handle in self._handles.values():
            self.context.session.remove_image(handle)
        self._handles.clear()

    def keep(self, used: frozenset[int]) -> None:
        """Removes the images that no shader shows any more (frames of a sequence, among others)."""
        for key, handle in list(self._handles.items()):
            if handle not in used:
                self.context.session.remove_image(handle)
                del self._handles[key]

    def refresh(self) -> bool:
        """Reads changed images into the handles they have. True when there were any."""
        changed = False
        for key, handle in list(self._handles.items()):
            if key[0] not in self._stale:
                continue
            image = _find_image(key[0][1])
            if image is not None:
                self.context.session.set_image(handle, self._describe(image, key[1]))
                changed = True
        self._stale.clear()
        return changed

    def handle(self, image: Any, image_user: Any, owner: str) -> int:
        """The handle of an image as a node shows it: the image user chooses the frame."""
        path = _path(image, image_user)
        key = (id_key(image), path)
        handle = self._handles.get(key)
        if handle is None:
            values = self._describe(image, path)
            if not path and not values.get("bytes") and "pixels" not in values:
                self.context.warn(f"{owner}: image '{image.name}' has no file and no pixels")
            handle = self._handles[key] = self.context.session.add_image(values)
        return handle

    def _describe(self, image: Any, path: str) -> dict[str, Any]:
        values: dict[str, Any] = {
            "name": image.name,
            "colorspace": image.colorspace_settings.name,
            "alpha": ALPHA_MODES.get(image.alpha_mode, "straight"),
        }
        if image.source == "TILED":
            if image.packed_files or image.is_dirty:
                self.context.warn(f"Image '{image.name}': packed or painted tiles are read from their files")
            return values | {"path": path, "tiles": [tile.number for tile in image.tiles]}
        if image.source in ("GENERATED", "VIEWER") or image.is_dirty:
            pixels = _read_pixels(image)
            if pixels is not None:
                return values | pixels
        packed = image.packed_file
        if packed is not None and image.source == "FILE":
            return values | {"bytes": bytes(packed.data), "path": path}
        if image.source == "MOVIE":
            self.context.warn(f"Image '{image.name}': movies are not supported yet; their first frame is shown")
            pixels = _read_pixels(image)
            if pixels is not None:
                return values | pixels
        return values | {"path": path}


def _find_image(full_name: str) -> Any:
    return next((image for image in bpy.data.images if image.name_full == full_name), None)


def _read_pixels(image: Any) -> dict[str, Any] | None:
    """Pixels as Blender holds them: bytes divided by 255 in the image's own colour space, floats linear."""
    width, height = image.size
    count = width * height * image.channels
    if count == 0 or len(image.pixels) != count:
        return None
    pixels = np.empty(count, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    if image.channels != 4:
        rgba = np.ones((width * height, 4), dtype=np.float32)
        source = pixels.reshape(-1, image.channels)
        rgba[:, :3] = source[:, :3] if image.channels == 3 else source[:, :1]
        if image.channels == 2:
            rgba[:, 3] = source[:, 1]
        pixels = rgba.reshape(-1)
    return {"pixels": pixels, "width": width, "height": height, "pixels_are_float": bool(image.is_float)}


def _path(image: Any, image_user: Any) -> str:
    """Absolute path of the file shown; with "<UDIM>" for tiles."""
    if image.source == "SEQUENCE" and image_user is not None:
        path = image.filepath_from_user(image_user=image_user)
    else:
        path = image.filepath
    if not path:
        return ""
    return str(Path(bpy.path.abspath(path, library=image.library)))
