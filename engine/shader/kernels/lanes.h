/// What the loops over a span's own lanes share: whose lane it is, and the padding behind them.
#pragma once

#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {

/// Lanes behind the span's own repeat the last one, so that later operations see ordinary numbers there.
TALBOT_INLINE void pad(Registers r, int columns, int lanes, int n) {
    for (int k = 0; k < columns; ++k) {
        const float last = lanes > 0 ? r[k][lanes - 1] : 0.0f;
        for (int i = lanes; i < n; ++i) r[k][i] = last;
    }
}

/// The lane's object, -1 for none.
TALBOT_INLINE int32_t object_of(const OpScope& s, int lane) {
    const bool on_object = s.span.object && s.context.scene && !s.span.is_background && !s.span.is_lamp;
    const int32_t object = on_object ? s.span.object[lane] : -1;
    return s.context.scene && object < s.context.scene->object_count ? object : -1;
}

/// What the nodes of the lamp see that the span is on; null for none.
TALBOT_INLINE const scene::LampView* lamp_of(const OpScope& s) {
    return s.span.is_lamp && s.span.lamp >= 0 && s.context.scene && s.context.scene->lamps ? s.context.scene->lamps + s.span.lamp : nullptr;
}

/// The lane's mesh, null for none.
TALBOT_INLINE const scene::MeshView* mesh_of(const OpScope& s, int lane) {
    const int32_t object = object_of(s, lane);
    if (object < 0) return nullptr;
    const int32_t mesh = scene::traits_of(*s.context.scene, object).mesh;
    if (mesh < 0 || !s.span.primitive || s.span.primitive[lane] < 0) return nullptr;
    return &s.context.scene->meshes[mesh];
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
