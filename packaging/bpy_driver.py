"""Makes the official Blender builds of PyPI (`import bpy`) answer Blender's command line.

Usage: python bpy_driver.py [Blender's arguments]. As in Blender, settings that hold for the whole run (`-t`, `-y`,
`--addons` ...) are read first, then files, render settings, scripts and renders act in the order in which they are
written. What the module cannot do (windows, for one) is refused by name, with status 2.

Status: 0; 1 when a file cannot be opened, an engine is not known or a render reports an error; else what a script
asked for.
"""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import traceback
import types
from collections.abc import Callable, Iterator
from pathlib import Path

# Accepted and without effect: the module is always in background, with factory settings, without sound or window.
IGNORED = {
    "-b": 0,
    "--background": 0,
    "--factory-startup": 0,
    "-noaudio": 0,
    "--no-window-focus": 0,
    "-setaudio": 1,
    "--log-level": 1,
    "--log": 1,
    "--verbose": 1,
    "--offline-mode": 0,
    "--online-mode": 0,
}
# Read before anything else happens, wherever they stand.
EARLY = {
    "-t": 1,
    "--threads": 1,
    "-y": 0,
    "--enable-autoexec": 0,
    "-Y": 0,
    "--disable-autoexec": 0,
    "--addons": 1,
    "--python-exit-code": 1,
}
LATE = {
    "-E": 1,
    "--engine": 1,
    "-o": 1,
    "--render-output": 1,
    "-F": 1,
    "--render-format": 1,
    "-x": 1,
    "--use-extension": 1,
    "-f": 1,
    "--render-frame": 1,
    "-a": 0,
    "--render-anim": 0,
    "-s": 1,
    "--frame-start": 1,
    "-e": 1,
    "--frame-end": 1,
    "-j": 1,
    "--frame-jump": 1,
    "-S": 1,
    "--scene": 1,
    "-P": 1,
    "--python": 1,
    "--python-text": 1,
    "--python-expr": 1,
    "-v": 0,
    "--version": 0,
}
KINDS = {**IGNORED, **EARLY, **LATE}


class CommandError(Exception):
    """A sentence for the user; the process ends with status `code`."""

    def __init__(self, message: str, code: int = 1) -> None:
        super().__init__(message)
        self.code = code


def parse(arguments: list[str]) -> list[tuple[str, str]]:
    """(option, value) pairs in order; a file to open has the option ""."""
    result: list[tuple[str, str]] = []
    words = iter(arguments)
    for word in words:
        if word == "--":
            break
        if word not in KINDS:
            if word.startswith("-"):
                raise CommandError(f"Error: the bpy module does not understand {word!r}", 2)
            result.append(("", word))
        elif KINDS[word] == 0:
            result.append((word, ""))
        else:
            value = next(words, None)
            if value is None:
                raise CommandError(f"Error: {word} needs a value", 2)
            result.append((word, value))
    return result


def parse_frames(text: str, first: int, last: int) -> list[int]:
    """ "1,3,5..7,+2,-1": numbers, ranges, offsets from the first (+0 is it) and the last frame (-1 is it)."""

    def one(word: str) -> int:
        if word.startswith("+"):
            return first + int(word[1:])
        if word.startswith("-"):
            return last - int(word[1:]) + 1
        return int(word)

    frames: list[int] = []
    try:
        for word in text.split(","):
            start, dots, end = word.partition("..")
            frames.extend(range(one(start), one(end) + 1) if dots else [one(start)])
    except ValueError:
        raise CommandError(f"Error: no frames in {text!r}", 2) from None
    return frames


class Driver:
    """Runs the parsed options against `bpy`, which is imported here, after the environment is set."""

    def __init__(self, options: list[tuple[str, str]]) -> None:
        import bpy

        self.bpy = bpy
        self.options = options
        self.use_scripts = False
        self.threads = 0
        self.script_error_code = 0

    def run(self) -> None:
        for option, value in self.options:
            if option in EARLY:
                self.set_up(option, value)
        self.enable_addons()
        self.apply_threads()
        actions: dict[str, Callable[[str], None]] = {
            "": self.open_file,
            "-E": self.set_engine,
            "--engine": self.set_engine,
            "-o": self.set_output,
            "--render-output": self.set_output,
            "-F": self.set_format,
            "--render-format": self.set_format,
            "-x": self.set_extension,
            "--use-extension": self.set_extension,
            "-f": self.render_frames,
            "--render-frame": self.render_frames,
            "-a": lambda _: self.render_animation(),
            "--render-anim": lambda _: self.render_animation(),
            "-s": lambda value: self.set_frame("frame_start", value),
            "--frame-start": lambda value: self.set_frame("frame_start", value),
            "-e": lambda value: self.set_frame("frame_end", value),
            "--frame-end": lambda value: self.set_frame("frame_end", value),
            "-j": lambda value: self.set_frame("frame_step", value),
            "--frame-jump": lambda value: self.set_frame("frame_step", value),
            "-S": self.set_scene,
            "--scene": self.set_scene,
            "-P": self.run_script,
            "--python": self.run_script,
            "--python-text": self.run_text,
            "--python-expr": lambda value: self.execute(value, "<string>"),
            "-v": lambda _: print("Blender", self.bpy.app.version_string, "(Python module)"),
            "--version": lambda _: print("Blender", self.bpy.app.version_string, "(Python module)"),
        }
        for option, value in self.options:
            if option in actions:
                actions[option](value)

    @property
    def scene(self) -> object:
        return self.bpy.context.scene

    def set_up(self, option: str, value: str) -> None:
        if option in ("-t", "--threads"):
            self.threads = self.number(value)
        elif option in ("-y", "--enable-autoexec"):
            self.use_scripts = True
        elif option in ("-Y", "--disable-autoexec"):
            self.use_scripts = False
        elif option == "--python-exit-code":
            self.script_error_code = self.number(value)

    def enable_addons(self) -> None:
        """Enables now and disables at exit: leaving with an engine registered hangs Blender 4.5 and crashes 4.2."""
        import addon_utils

        scripts = os.environ.get("BLENDER_USER_SCRIPTS")
        if scripts and f"{scripts}/addons" not in sys.path:
            sys.path.append(f"{scripts}/addons")
        names = [name for option, value in self.options if option == "--addons" for name in value.split(",") if name]
        for name in names:
            if addon_utils.enable(name, default_set=False) is None:
                print(f"Error: add-on {name!r} cannot be enabled", file=sys.stderr)
            else:
                atexit.register(addon_utils.disable, name, default_set=False)

    def apply_threads(self) -> None:
        if self.threads > 0:
            for scene in self.bpy.data.scenes:
                scene.render.threads_mode = "FIXED"
                scene.render.threads = self.threads

    def open_file(self, path: str) -> None:
        full = os.path.abspath(path)
        try:
            self.bpy.ops.wm.open_mainfile(filepath=full, load_ui=False, use_scripts=self.use_scripts)
        except RuntimeError as error:
            raise CommandError(f"{str(error).strip()}\nError: cannot open {full}") from None
        self.apply_threads()

    def set_engine(self, name: str) -> None:
        try:
            self.scene.render.engine = name
        except TypeError:
            raise CommandError(f"Error: engine not found {name!r}") from None

    def set_output(self, path: str) -> None:
        self.scene.render.filepath = (
            path if path.startswith("//") else os.path.abspath(path) + path[len(path.rstrip("/")) :]
        )

    def set_format(self, name: str) -> None:
        name = {"EXR": "OPEN_EXR", "MULTILAYER": "OPEN_EXR_MULTILAYER", "TGA": "TARGA"}.get(name, name)
        settings = self.scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = {"OPEN_EXR_MULTILAYER": "MULTI_LAYER_IMAGE", "FFMPEG": "VIDEO"}.get(name, "IMAGE")
        try:
            settings.file_format = name
        except TypeError:
            raise CommandError(f"Error: format not found {name!r}") from None

    def set_extension(self, value: str) -> None:
        self.scene.render.use_file_extension = self.number(value) != 0

    def number(self, text: str) -> int:
        try:
            return int(text)
        except ValueError:
            raise CommandError(f"Error: not a number: {text!r}", 2) from None

    def set_frame(self, name: str, value: str) -> None:
        """Here + and - count from the present value."""
        present = getattr(self.scene, name)
        setattr(self.scene, name, parse_frames(value, present, present - 1)[0])

    def set_scene(self, name: str) -> None:
        if name not in self.bpy.data.scenes:
            raise CommandError(f"Error: no scene {name!r}")
        self.bpy.context.window.scene = self.bpy.data.scenes[name]

    def frame_ranges(self, frames: list[int]) -> Iterator[int]:
        """Sets the scene's range to one frame after the other, and back at the end."""
        scene = self.scene
        saved = scene.frame_start, scene.frame_end
        try:
            for frame in frames:
                # Blender keeps start <= end: move the far end first.
                scene.frame_start, scene.frame_end = min(frame, scene.frame_start), frame
                scene.frame_start = frame
                yield frame
        finally:
            scene.frame_start, scene.frame_end = saved

    def render_frames(self, text: str) -> None:
        for _ in self.frame_ranges(parse_frames(text, self.scene.frame_start, self.scene.frame_end)):
            self.render_animation()

    def render_animation(self) -> None:
        try:
            self.bpy.ops.render.render(animation=True)
        except RuntimeError as error:
            raise CommandError(str(error).strip()) from None

    def run_script(self, path: str) -> None:
        try:
            source = Path(path).read_text(encoding="utf-8")
        except OSError as error:
            raise CommandError(f"Error: cannot read {path}: {error.strerror}") from None
        self.execute(source, os.path.abspath(path))

    def run_text(self, name: str) -> None:
        if name not in self.bpy.data.texts:
            raise CommandError(f"Error: no text {name!r}")
        self.execute(self.bpy.data.texts[name].as_string(), name)

    def execute(self, source: str, file: str) -> None:
        """Like Blender: a module of its own, and an exception is printed and the next argument follows."""
        module = types.ModuleType("__main__")
        module.__file__ = file
        sys.modules["__main__"] = module
        try:
            exec(compile(source, file, "exec"), module.__dict__)
        except Exception:
            traceback.print_exc()
            if self.script_error_code:
                raise CommandError("Error: script failed, file: " + file, self.script_error_code) from None


def main() -> int:
    try:
        options = parse(sys.argv[1:])
        sys.argv[0] = "blender"
        Driver(options).run()
    except CommandError as error:
        print(error, file=sys.stderr)
        return error.code
    finally:
        sys.stdout.flush()
    return 0


def leave(status: object) -> None:
    """Like sys.exit. In Blender 4.2 a property group with callbacks, once registered, keeps `bpy` beyond the end of
    Python, and static destructors then ask Python for its lock: a crash. Talbot takes care of its own (see
    addon/properties.py); for other scripts the process ends before them, when everything else is put away."""
    bpy = sys.modules.get("bpy")
    if bpy is None or bpy.app.version >= (4, 5, 0):
        sys.exit(status)
    if isinstance(status, str):
        print(status, file=sys.stderr)
    atexit._run_exitfuncs()
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status if isinstance(status, int) else status is not None)


if __name__ == "__main__":
    try:
        code: object = main()
    except SystemExit as end:  # a script's own
        code = end.code
    leave(code)
