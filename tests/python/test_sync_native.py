"""The native Session: what it takes, what it refuses, and that nothing wrong reaches the engine."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from talbot import native


@pytest.fixture
def session() -> Any:
    return native.module().Session()


def quad() -> dict[str, Any]:
    """One unit square."""
    return {
        "positions": np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], np.float32),
        "corner_vertices": np.arange(4, dtype=np.uint32),
        "triangle_corners": np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
        "triangle_faces": np.zeros(2, np.uint32),
        "face_smooth": np.zeros(1, np.uint8),
    }


def placed(mesh: int, matrix: Any = None) -> dict[str, Any]:
    """One object of a mesh."""
    matrix = np.eye(4, dtype=np.float32) if matrix is None else np.asarray(matrix, np.float32)
    return {
        "mesh": np.array([mesh], np.int32),
        "matrix": np.ascontiguousarray(matrix.T.reshape(1, 16)),
        "name": np.zeros(1, np.int32),
        "names": ["Thing"],
    }


def emission(strength: float) -> dict[str, Any]:
    """A graph that glows."""
    return {
        "nodes": [
            {
                "type": "ShaderNodeOutputMaterial",
                "name": "Output",
                "properties": {"target": "ALL", "is_active_output": 1.0},
                "inputs": [("Surface", "SHADER", 0.0, False, 1, "Emission")],
                "outputs": [],
            },
            {
                "type": "ShaderNodeEmission",
                "name": "Emission",
                "properties": {},
                "inputs": [
                    ("Color", "COLOR", (1.0, 0.5, 0.25, 1.0), False, -1, ""),
                    ("Strength", "FLOAT", strength, False, -1, ""),
                ],
                "outputs": [("Emission", "SHADER", 0.0)],
            },
        ],
        "output_node": 0,
    }


def warnings(session: Any) -> list[tuple[str, str]]:
    return [(text, where) for level, text, where, _ in session.report() if level == "warning"]


# -- dictionaries


def test_unknown_keys_and_wrong_values(session: Any) -> None:
    with pytest.raises(KeyError, match="smaples"):
        session.set_settings({"smaples": 3})
    with pytest.raises(KeyError, match="fov_x"):
        session.set_camera({"fov_x": 1.0})
    with pytest.raises(TypeError):
        session.set_settings({"samples": "many"})
    with pytest.raises(native.module().Error):
        session.set_settings({"width": 0})
    with pytest.raises(native.module().Error):
        session.set_settings({"filter": "sinc"})
    with pytest.raises(native.module().Error):
        session.set_settings({"width": 10, "height": 10, "crop_x": 8, "crop_width": 5, "crop_height": 1})
    with pytest.raises(native.module().Error):
        session.set_camera({"clip_end": float("nan")})
    with pytest.raises(ValueError, match="16"):
        session.set_camera({"to_world": [1.0] * 12})
    with pytest.raises(native.module().Error):
        session.set_passes(["combined", "beauty"])
    with pytest.raises(native.module().Error):
        session.set_settings({"seed": -1})


def test_enumerations_are_taken(session: Any) -> None:
    for panorama in (
        "equirectangular",
        "equiangular_cubemap",
        "mirrorball",
        "fisheye_equidistant",
        "fisheye_equisolid",
        "fisheye_polynomial",
        "central_cylindrical",
    ):
        session.set_camera({"type": "panoramic", "panorama": panorama})
    for filter_name in ("box", "gaussian", "blackman_harris"):
        session.set_settings({"filter": filter_name})
    session.set_lights([{"type": kind} for kind in ("point", "spot", "sun", "area")])
    session.set_lights([{"type": "area", "shape": shape} for shape in ("square", "rectangle", "disk", "ellipse")])
    with pytest.raises(native.module().Error):
        session.set_lights([{"type": "hemi"}])


# -- arrays


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("positions", np.zeros((4, 3)), TypeError),
        ("positions", np.zeros((3, 4), np.float32).T, TypeError),
        ("positions", [[0.0, 0.0, 0.0]] * 4, TypeError),
        ("positions", np.zeros(12, np.float32), ValueError),
        ("positions", np.zeros((4, 2), np.float32), ValueError),
        ("corner_vertices", np.arange(4, dtype=np.int32), TypeError),
        ("corner_vertices", np.array([0, 1, 2, 4], np.uint32), RuntimeError),
        ("triangle_corners", np.array([(0, 1, 2), (0, 2, 9)], np.uint32), RuntimeError),
        ("triangle_faces", np.array([0, 1], np.uint32), RuntimeError),
        ("triangle_faces", np.zeros(3, np.uint32), RuntimeError),
        ("face_smooth", np.zeros(1, np.bool_), TypeError),
        ("vertex_normals", np.zeros((3, 3), np.float32), RuntimeError),
        ("attributes", [("UV", "CORNER", False, np.zeros((3, 2), np.float32))], RuntimeError),
        ("attributes", [("UV", "EDGE", False, np.zeros((4, 2), np.float32))], RuntimeError),
        ("attributes", [("UV", "CORNER", False, np.zeros((4, 5), np.float32))], ValueError),
        ("attributes", [("Col", "CORNER", True, np.zeros((4, 3), np.uint8))], ValueError),
        ("colour", np.zeros(3, np.float32), KeyError),
    ],
)
def test_meshes_are_checked(session: Any, name: str, value: Any, error: type[Exception]) -> None:
    with pytest.raises(error) as caught:
        session.add_mesh("Bad", quad() | {name: value})
    if error is RuntimeError and name != "attributes":
        assert "Bad" in str(caught.value)


def test_required_arrays(session: Any) -> None:
    arrays = quad()
    del arrays["positions"]
    with pytest.raises(KeyError, match="positions"):
        session.add_mesh("Bad", arrays)
    with pytest.raises(KeyError, match="matrix"):
        session.set_objects({"mesh": np.zeros(0, np.int32)})


def test_broken_vertices_are_reported(session: Any) -> None:
    arrays = quad()
    arrays["positions"][3, 0] = np.inf
    session.add_mesh("Half", arrays)
    ((text, where),) = warnings(session)
    assert where == "Mesh 'Half'" and text.startswith("1 triangle")


def test_handles(session: Any) -> None:
    first = session.add_mesh("A", quad())
    second = session.add_mesh("B", quad())
    assert first != second
    session.remove_mesh(first)
    with pytest.raises(ValueError, match="mesh"):
        session.remove_mesh(first)
    with pytest.raises(ValueError, match="mesh"):
        session.set_mesh(99, "C", quad())
    assert session.add_mesh("C", quad()) == first, "handles are used again"
    with pytest.raises(native.module().Error):
        session.set_objects(placed(7))
    with pytest.raises(ValueError, match="shader"):
        session.set_objects(placed(second) | {"material_set": np.zeros(1, np.int32), "material_sets": [[3]]})
    with pytest.raises(ValueError, match="shader"):
        session.set_world({"shader": 0})
    with pytest.raises(ValueError, match="image"):
        session.remove_image(0)


def test_objects_are_checked(session: Any) -> None:
    mesh = session.add_mesh("A", quad())
    for name, value in (
        ("visibility", np.zeros(2, np.uint32)),
        ("matrix", np.zeros((2, 16), np.float32)),
        ("color", np.zeros((1, 3), np.float32)),
    ):
        with pytest.raises(ValueError, match=name):
            session.set_objects(placed(mesh) | {name: value})
    for name in ("name", "material_set", "attribute_set"):
        with pytest.raises(native.module().Error):
            session.set_objects(placed(mesh) | {name: np.full(1, 5, np.int32)})
    session.set_objects(placed(mesh))
    with pytest.raises(ValueError, match="matrix"):
        session.set_object_matrices(np.zeros((2, 16), np.float32))


def many(mesh: int, count: int, traits: Any = None) -> dict[str, Any]:
    """Instances of a mesh in a row."""
    matrix = np.tile(np.eye(4, dtype=np.float32).reshape(1, 16), (count, 1))
    matrix[:, 12] = np.arange(count)
    traits = np.zeros(count, np.int32) if traits is None else np.asarray(traits, np.int32)
    return placed(mesh) | {"matrix": matrix, "traits": traits}


def test_instances_share_traits(session: Any) -> None:
    mesh = session.add_mesh("A", quad())
    with pytest.raises(ValueError, match="matrix"):
        session.set_objects({name: values for name, values in many(mesh, 3).items() if name != "traits"})
    with pytest.raises(ValueError, match="traits"):
        session.set_objects(many(mesh, 3) | {"traits": np.zeros(2, np.int32)})
    with pytest.raises(native.module().Error, match="traits"):
        session.set_objects(many(mesh, 3, [0, 1, 0]))
    with pytest.raises(ValueError, match="random"):
        session.set_objects(many(mesh, 3) | {"random": np.zeros(1, np.uint32)})
    with pytest.raises(ValueError, match="visibility"):
        session.set_objects(many(mesh, 3) | {"visibility": np.zeros(3, np.uint32)})
    session.set_objects(many(mesh, 3, [0, -1, 0]))
    session.set_settings({"width": 4, "height": 4, "samples": 1})
    session.start()
    assert session.wait(10_000)
    assert session.statistics()["instanced_triangles"] == 4, "the second is removed"


def test_instances_that_cannot_be_seen_come_back(session: Any) -> None:
    session.set_settings({"width": 4, "height": 4, "samples": 1})
    mesh = session.add_mesh("A", quad())
    arrays = many(mesh, 3)
    arrays["matrix"][1] = np.nan
    session.set_objects(arrays)

    def shown() -> int:
        session.start()
        assert session.wait(10_000)
        return session.statistics()["instanced_triangles"]

    assert len(warnings(session)) == 1
    assert shown() == 4
    session.set_object_matrices(many(mesh, 3)["matrix"])
    assert shown() == 6
    session.remove_mesh(mesh)
    assert shown() == 0


@pytest.mark.parametrize("matrix", [np.zeros((4, 4)), np.full((4, 4), np.nan), np.diag([1.0, 0.0, 0.0, 1.0])])
def test_scales_that_leave_nothing(session: Any, matrix: Any) -> None:
    mesh = session.add_mesh("A", quad())
    session.set_objects(placed(mesh, matrix))
    ((_, where),) = warnings(session)
    assert where == "Object 'Thing'"


def test_flat_scale_is_no_reason_to_warn(session: Any) -> None:
    mesh = session.add_mesh("A", quad())
    session.set_objects(placed(mesh, np.diag([1.0, -2.0, 0.0, 1.0])))
    assert warnings(session) == []


def test_graphs_are_checked(session: Any) -> None:
    graph = emission(1.0)
    graph["nodes"][0]["inputs"] = [("Surface", "SHADER", 0.0, False, 5, "Emission")]
    with pytest.raises(native.module().Error):
        session.add_shader("Bad", graph, {})
    with pytest.raises(native.module().Error):
        session.add_shader("Bad", emission(1.0) | {"output_node": 2}, {})
    with pytest.raises(KeyError, match="roughness"):
        session.add_shader("Bad", emission(1.0), {"roughness": 1})
    with pytest.raises(TypeError, match="table"):
        graph = emission(1.0)
        graph["nodes"][1]["properties"] = {"table": np.zeros(4)}
        session.add_shader("Bad", graph, {})


def test_images_are_checked(session: Any) -> None:
    with pytest.raises(ValueError, match="pixels"):
        session.add_image({"name": "A", "pixels": np.zeros(15, np.float32), "width": 2, "height": 2})
    with pytest.raises(TypeError):
        session.add_image({"name": "A", "bytes": "text"})
    with pytest.raises(native.module().Error):
        session.add_image({"name": "A", "alpha": "maybe"})
    handle = session.add_image({"name": "A", "pixels": np.zeros(16, np.float32), "width": 2, "height": 2})
    session.set_image(handle, {"name": "A", "path": "/nowhere.png", "tiles": [1001, 1002]})
    session.remove_image(handle)


# -- pictures


def test_a_glowing_square(session: Any) -> None:
    session.set_settings({"width": 16, "height": 8, "samples": 4, "filter": "box", "seed": 3})
    session.set_camera({"type": "orthographic", "view": (0.0, 2.0, 0.0, 1.0), "clip_start": 0.0, "clip_end": 10.0})
    mesh = session.add_mesh("Square", quad())
    shader = session.add_shader("Material 'Glow'", emission(2.0), {})
    below = np.eye(4)
    below[2, 3] = -5
    session.set_objects(placed(mesh, below) | {"material_set": np.zeros(1, np.int32), "material_sets": [[shader]]})
    session.set_passes(["combined", "depth"])
    assert session.read_pass("combined") is None
    session.start()
    while not session.wait(100):
        pass
    progress = session.progress()
    assert (progress["state"], progress["samples_done"]) == ("done", 4), session.error()
    assert session.size() == (16, 8)
    combined = session.read_pass("combined").reshape(8, 16, 4)
    assert combined.dtype == np.float32
    assert np.allclose(combined[:, :8, :3], [2.0, 1.0, 0.5], rtol=1e-5), "left half: the square"
    assert np.all(combined[:, 8:, :3] == 0)
    assert np.allclose(session.read_pass("depth").reshape(8, 16)[:, :8], 5, rtol=1e-5)
    assert session.read_pass("mist") is None
    assert session.statistics()["camera_rays"] > 0

    session.set_object_matrices(placed(mesh, np.diag([2.0, 1.0, 1.0, 1.0]) + below - np.eye(4))["matrix"])
    session.start()
    while not session.wait(100):
        pass
    assert np.allclose(session.read_pass("combined").reshape(8, 16, 4)[..., :3], [2.0, 1.0, 0.5], rtol=1e-5)
    session.remove_shader(shader)
    session.remove_mesh(mesh)
    session.start()
    while not session.wait(100):
        pass
    assert not session.read_pass("combined")[:, :3].any()


def test_dump(session: Any, tmp_path: Path) -> None:
    mesh = session.add_mesh("Square", quad())
    session.set_objects(placed(mesh))
    session.dump(str(tmp_path / "scene.talbot"))
    assert (tmp_path / "scene.talbot").stat().st_size > 100
    with pytest.raises(native.module().Error):
        session.dump(str(tmp_path / "missing" / "scene.talbot"))


def test_sessions_are_independent() -> None:
    first, second = native.module().Session(), native.module().Session()
    first.set_settings({"width": 4, "height": 4, "samples": 1})
    second.set_settings({"width": 8, "height": 2, "samples": 1})
    for session in (first, second):
        session.start()
    for session in (first, second):
        while not session.wait(50):
            pass
    assert (first.size(), second.size()) == ((4, 4), (8, 2))


def test_matrix_columns() -> None:
    columns = native.module().matrix_columns
    matrices = [Matrix([[100 * i + 10 * row + column for column in range(4)] for row in range(4)]) for i in range(3)]
    values = np.frombuffer(columns(matrices), np.float32).reshape(3, 4, 4)
    assert (values == np.array([matrix.transposed() for matrix in matrices])).all()
    assert columns([]) == b""
    owner = bpy.data.objects.new("Owner", None)
    owned = [] if bpy.app.version >= (5, 0, 0) else [owner.matrix_world]
    for wrong in (Matrix.Identity(3), 1.0, None, "Matrix", np.zeros((4, 4)), np.zeros(16, np.float32), *owned):
        with pytest.raises(TypeError):
            columns([Matrix(), wrong])
    bpy.data.objects.remove(owner)
