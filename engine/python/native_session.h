/// What Python's Session holds: the engine's session, and which handles are free.
#pragma once

#include <unordered_map>

#include "python/convert.h"
#include "session/session.h"

namespace talbot::python {

/// Handles of one kind: an index into the scene's vector; removed ones are given out again.
class HandlePool {
public:
    /// The handle of a new thing; `size` is the vector's length, one longer is wanted when it is returned.
    scene::Handle take(size_t size);
    void release(scene::Handle handle) { free_.push_back(handle); }
    bool is_free(scene::Handle handle) const;

private:
    std::vector<scene::Handle> free_;
};

class NativeSession {
public:
    Session session;
    HandlePool mesh_pool, shader_pool, image_pool;
    std::unordered_map<size_t, scene::Handle> hidden;  ///< traits of objects whose matrices are such that they cannot be seen

    /// The scene, with the workers stopped. The GIL is released while they stop.
    scene::Scene& edit();
};

scene::Handle add_mesh(NativeSession& native, const std::string& name, const py::dict& arrays);
void set_mesh(NativeSession& native, scene::Handle handle, const std::string& name, const py::dict& arrays);
void remove_mesh(NativeSession& native, scene::Handle handle);
void set_objects(NativeSession& native, const py::dict& arrays);
void set_object_matrices(NativeSession& native, const py::object& matrix);
void set_motion(NativeSession& native, const py::dict& values);
void set_mesh_motion(NativeSession& native, scene::Handle handle, const py::dict& values);

/// Throws ValueError when the handle is not in use.
void check_handle(const HandlePool& pool, scene::Handle handle, size_t size, const char* kind);

void bind_session(py::module_& module);

}  // namespace talbot::python
