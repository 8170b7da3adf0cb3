"""Registering, unregistering, and what stands in the way of the native module."""

from __future__ import annotations

import platform
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import pytest
import talbot
from talbot import compat_ui, native, properties, versions

PYTHON_TAG = f"cp{sys.version_info.major}{sys.version_info.minor}"


def engine_names() -> set[str]:
    return {getattr(cls, "bl_idname", "") for cls in bpy.types.RenderEngine.__subclasses__()}


def test_versions_agree() -> None:
    manifest = (Path(talbot.__file__).parent / "blender_manifest.toml").read_text(encoding="utf-8")
    found = re.search(r'^version = "(.+)"$', manifest, re.MULTILINE)
    source = Path(talbot.__file__).read_text(encoding="utf-8")
    legacy = re.search(r'"version": \((\d+), (\d+), (\d+)\)', source)
    assert found and legacy
    assert found[1] == ".".join(legacy.groups()) == talbot.VERSION


def test_registers_without_bl_info(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender removes it from extensions."""
    talbot.unregister()
    monkeypatch.delattr(talbot, "bl_info", raising=False)
    talbot.register()
    assert "TALBOT" in engine_names()


def test_register_and_unregister_twice() -> None:
    panels_before = {p: set(p.COMPAT_ENGINES) for p in bpy.types.Panel.__subclasses__() if hasattr(p, "COMPAT_ENGINES")}
    try:
        talbot.unregister()
        talbot.unregister()
        assert not hasattr(bpy.types.Scene, "talbot")
        assert properties.TalbotSceneSettings.__annotations__ == {}, "callbacks outlive Python in 4.2"
        open_panels = [
            p
            for p in bpy.types.Panel.__subclasses__()
            if "TALBOT" in getattr(p, "COMPAT_ENGINES", ()) and not p.__name__.startswith("TALBOT_")
        ]
        assert open_panels == []
        with pytest.raises(TypeError):
            bpy.context.scene.render.engine = "TALBOT"
    finally:
        talbot.register()
    assert bpy.context.scene.talbot.use_cycles_settings
    bpy.context.scene.render.engine = "TALBOT"
    for panel, engines in panels_before.items():
        if not panel.__name__.startswith("TALBOT_"):
            assert engines == set(panel.COMPAT_ENGINES), panel.__name__


@pytest.mark.skipif(bool(bpy.app.binary_path), reason="a program, not the module")
def test_a_script_leaves_with_status_0() -> None:
    """Without any care for the end, and without the launcher's driver. Crashed 4.2, hung 4.5."""
    folder = str(Path(talbot.__file__).parents[1])
    script = f"import sys; sys.path.append({folder!r}); import bpy, talbot; talbot.register()"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert result.returncode == 0 and "Traceback" not in result.stderr, result.stderr


def test_a_second_copy_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """An extension and a legacy add-on, say: the one that is enabled first stays."""
    talbot.unregister()
    other = type("OtherEngine", (bpy.types.RenderEngine,), {"bl_idname": "TALBOT", "bl_label": "Other"})
    other.__module__ = "bl_ext.user_default.talbot.engine"
    bpy.utils.register_class(other)
    bpy.types.Scene.talbot = bpy.props.IntProperty()
    try:
        talbot.register()
        assert "bl_ext.user_default.talbot is enabled already" in capsys.readouterr().out
        talbot.unregister()
        assert other.is_registered and isinstance(bpy.context.scene.talbot, int)
    finally:
        del bpy.types.Scene.talbot
        bpy.utils.unregister_class(other)
        talbot.register()
    assert hasattr(bpy.types.Scene, "talbot")


def test_unregister_restores_the_node_menu() -> None:
    items = sys.modules.get("nodeitems_builtins")
    if not hasattr(items, "cycles_shader_nodes_poll"):
        pytest.skip("this Blender's Add menu is open to any engine")
    context = SimpleNamespace(engine="TALBOT")
    assert items.cycles_shader_nodes_poll(context)
    compat_ui.unregister()
    assert not items.cycles_shader_nodes_poll(context)
    compat_ui.register()
    assert items.cycles_shader_nodes_poll(context)


def test_settings_survive_registering_again() -> None:
    scene = bpy.context.scene
    scene.talbot.samples = 77
    talbot.unregister()
    talbot.register()
    assert scene.talbot.samples == 77
    del scene.talbot["samples"]


@pytest.mark.parametrize(
    "name",
    [
        "DATA_PT_lens",
        "DATA_PT_camera_dof",
        "EEVEE_MATERIAL_PT_surface",
        "EEVEE_WORLD_PT_surface",
        "RENDER_PT_color_management",
        "VIEWLAYER_PT_layer_passes",
        "MATERIAL_PT_preview",
    ],
)
def test_blender_panels_are_open(name: str) -> None:
    """And only the panel itself: several share one set."""
    assert "TALBOT" in getattr(bpy.types, name).COMPAT_ENGINES
    eevee_own = getattr(bpy.types, "RENDER_PT_eevee_film", None) or bpy.types.RENDER_PT_eevee_next_film
    assert "TALBOT" not in eevee_own.COMPAT_ENGINES


class TestNativeModule:
    """native.load with modules that are wrong in each way."""

    @pytest.fixture(autouse=True)
    def keep(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        monkeypatch.setattr(native, "_module", native._module)
        monkeypatch.setattr(native, "_problem", native._problem)
        monkeypatch.setattr(native, "_FOLDER", tmp_path)

    @staticmethod
    def fake(**wrong: object) -> SimpleNamespace:
        class Error(RuntimeError):
            pass

        def refuse() -> None:
            raise Error("Another Embree answers")

        module = SimpleNamespace(
            __version__="0.1.0", Error=Error, chosen_instruction_set=lambda: "v2", check=lambda: None
        )
        if "check" in wrong:
            module.check = refuse
        if "version" in wrong:
            module.__version__ = wrong["version"]
        return module

    def load(self, monkeypatch: pytest.MonkeyPatch, module: object) -> str:
        def imported(name: str, package: str | None = None) -> object:
            if isinstance(module, Exception):
                raise module
            return module

        monkeypatch.setattr(native.importlib, "import_module", imported)
        return native.load("0.1.0")

    def test_good(self, monkeypatch: pytest.MonkeyPatch) -> None:
        module = self.fake()
        assert self.load(monkeypatch, module) == ""
        assert native.module() is module

    def test_from_the_wheel(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """An extension has no module beside it: Blender unpacks the wheel elsewhere."""
        module = self.fake()

        def imported(name: str, package: str | None = None) -> object:
            if name.startswith("."):
                raise ModuleNotFoundError("No module named", name=f"{package}{name}")
            assert name == "talbot_native._talbot"
            return module

        monkeypatch.setattr(native.importlib, "import_module", imported)
        assert native.load("0.1.0") == ""
        assert native.module() is module

    def test_absent(self, monkeypatch: pytest.MonkeyPatch) -> None:
        problem = self.load(monkeypatch, ModuleNotFoundError("No module named", name="talbot._talbot"))
        assert "is missing" in problem
        with pytest.raises(native.Unavailable, match="is missing"):
            native.module()

    def test_of_another_python(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        (tmp_path / "_talbot.cpython-39-x86_64-linux-gnu.so").write_bytes(b"")
        problem = self.load(monkeypatch, ModuleNotFoundError("No module named", name="talbot._talbot"))
        assert "_talbot.cpython-39-x86_64-linux-gnu.so is not for this Blender's Python" in problem

    def test_library_missing(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        (tmp_path / "_talbot.so").write_bytes(b"")
        problem = self.load(
            monkeypatch,
            ImportError("libembree3.so.3: cannot open shared object file", name="talbot._talbot", path="_talbot.so"),
        )
        assert "_talbot.so cannot be loaded: libembree3.so.3" in problem

    def test_system_too_old_for_the_wheel(self, monkeypatch: pytest.MonkeyPatch) -> None:
        text = "libstdc++.so.6: version `GLIBCXX_3.4.29' not found"
        problem = self.load(monkeypatch, ImportError(text, name="talbot_native._talbot"))
        assert problem == f"The native module _talbot cannot be loaded: {text}"

    @pytest.mark.parametrize("tags", ["cp39-none-manylinux_2_34_x86_64", "{}-none-win_amd64", "{}-none-linux_aarch64"])
    def test_wheel_of_another_system(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, tags: str) -> None:
        wheel = f"talbot-0.1.0-{tags.format(PYTHON_TAG)}.whl"
        (tmp_path / "wheels").mkdir()
        (tmp_path / "wheels" / wheel).write_bytes(b"")
        problem = self.load(monkeypatch, ModuleNotFoundError("No module named", name="talbot_native"))
        assert problem.startswith(f"{wheel} is not for this Blender's Python {sys.version_info.major}.")

    def test_wheel_not_unpacked(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        (tmp_path / "wheels").mkdir()
        wheel = f"talbot-0.1.0-cp39.{PYTHON_TAG}-none-manylinux_2_34_{platform.machine()}.whl"
        (tmp_path / "wheels" / wheel).write_bytes(b"")
        problem = self.load(monkeypatch, ModuleNotFoundError("No module named", name="talbot_native"))
        assert f"Blender has not unpacked {wheel}" in problem and "writable" in problem

    def test_old_one_in_memory(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert "restart Blender" in self.load(monkeypatch, self.fake(version="0.0.9"))

    def test_check_refuses(self, monkeypatch: pytest.MonkeyPatch) -> None:
        assert self.load(monkeypatch, self.fake(check=False)) == "Another Embree answers"

    def test_real_file_of_another_python(self, tmp_path: Path) -> None:
        """Python itself, not a fake of it: a module with another tag is not found."""
        package = tmp_path / "wrong_python_package"
        package.mkdir()
        (package / "__init__.py").write_text("")
        (package / "_talbot.cpython-39-x86_64-linux-gnu.so").write_bytes(b"")
        sys.path.insert(0, str(tmp_path))
        try:
            with pytest.raises(ModuleNotFoundError) as caught:
                native.importlib.import_module("._talbot", "wrong_python_package")
        finally:
            sys.path.remove(str(tmp_path))
        native._FOLDER = package
        assert "is not for this Blender's Python" in native._why_not_imported(caught.value)


@pytest.mark.parametrize(
    ("version", "semantics"),
    [
        ((2, 93, 0), 304),
        ((3, 4, 1), 304),
        ((3, 6, 2), 304),
        ((4, 1, 0), 304),
        ((4, 2, 1), 402),
        ((4, 3, 2), 403),
        ((4, 4, 0), 403),
        ((4, 5, 15), 405),
        ((5, 0, 1), 500),
        ((5, 1, 0), 500),
        ((5, 3, 0), 502),
        ((6, 0, 0), 502),
    ],
)
def test_semantics_version(version: tuple[int, int, int], semantics: int) -> None:
    assert versions.semantics_version(version) == semantics
