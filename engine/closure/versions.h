/// What Blender's versions mean by the same closure, as data: kernels ask these switches, never the version number. What they mean by the same node is in
/// shader/versions.h.
#pragma once

#include "scene/scene.h"

namespace talbot {

struct ClosureSemantics {
    bool bump_by_polynomial = false;     ///< bump shadowing of diffuse lobes is a polynomial (before 4.5)
    bool bump_cuts_glossy = true;        ///< bump shadowing cuts glossy lobes too (from 5.0)
    bool shadowing_separable = false;    ///< microfacets shadow light and viewer independently (before 4.0)
    bool toon_lights_wide = false;       ///< Glossy Toon is worth more than 90 degrees from the mirror direction what it is at 90 (before 4.0)
    float sharp_alpha2 = 2e-10f;         ///< alpha_x alpha_y at or below it is a mirror (1e-7 before 4.0)
    bool film_fitted = false;            ///< thin films have the colours of a fit of the observer, and fade out below 30 nm (before 5.0)
    bool hair_over_angle = false;        ///< Huang's hair is summed over the angle about the strand, not over its width (before 4.5)
    bool conductor_approximate = false;  ///< conductors reflect as if light went straight down inside them (before 5.0)
};

inline ClosureSemantics closure_semantics_of(scene::BlenderVersion version) {
    ClosureSemantics s;
    s.bump_by_polynomial = version < 405;
    s.bump_cuts_glossy = version >= 500;
    s.shadowing_separable = version < 400;
    s.toon_lights_wide = version < 400;
    s.sharp_alpha2 = version < 400 ? 1e-7f : 2e-10f;
    s.film_fitted = version < 500;
    s.hair_over_angle = version < 405;
    s.conductor_approximate = version < 500;
    return s;
}

}  // namespace talbot
