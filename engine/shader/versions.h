/// What Blender's versions mean by the same node, as data: compile functions ask these switches, never the version number.
#pragma once

#include "scene/scene.h"

namespace talbot::shader {

struct Semantics {
    scene::BlenderVersion version = 502;
    bool noise_wraps = true;               ///< noise coordinates are wrapped at 1e5 (not in 3.4)
    bool noise_roughness_clamped = false;  ///< roughness of fractal noise is limited to 1 (3.4)
    bool voronoi_integer_hash = true;      ///< 2D to 4D cells by an integer hash; 3.4 hashes floats
    bool magic_wraps_before_scale = false;
};

inline Semantics semantics_of(scene::BlenderVersion version) {
    Semantics s;
    s.version = version;
    s.noise_wraps = s.voronoi_integer_hash = version >= 402;
    s.noise_roughness_clamped = s.magic_wraps_before_scale = version < 402;
    return s;
}

}  // namespace talbot::shader
