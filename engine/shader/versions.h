/// What Blender's versions mean by the same node, as data: compile functions ask these switches, never the version number.
#pragma once

#include "closure/versions.h"
#include "shader/op.h"
#include "shader/spectra.h"

namespace talbot::shader {

struct Semantics {
    ClosureSemantics closures;
    bool noise_wraps = true;               ///< noise coordinates are wrapped at 1e5 (not in 3.4)
    bool noise_roughness_clamped = false;  ///< roughness of fractal noise is limited to 1 (3.4)
    bool voronoi_integer_hash = true;      ///< 2D to 4D cells by an integer hash; hashed floats before 5.0
    bool sky_full_dome = true;             ///< sky tables reach below the horizon, and the sun shines in front of the sky (from 5.0)
    IesEnds ies_ends = IesEnds::Stay;      ///< what IES tables read beyond their ends
    bool ies_from_pole = false;            ///< IES tables must begin at the pole (before 4.2)
    bool ies_by_normal = false;            ///< IES tables are asked along the normal unless something is linked: of area lamps one direction (before 4.0)
    bool normal_map_scales_slope = true;   ///< strength of tangent-space normal maps (mixes normals before 4.2)
    bool normals_as_directions =
        false;  ///< Vector Transform takes normals as directions, and makes unit vectors even from a space to the same one (before 4.2)
    bool bump_suits_reflections = false;  ///< bumped normals are turned back until the mirror direction leaves the surface, whatever reads them (before 4.0)
    bool brick_clamps = true;             ///< Brick Texture's mortar of negative smoothness is none (from 4.2)
    bool metal_has_film = true;           ///< thin film covers Principled's metal too (from 5.0)
    bool coat_as_mirror =
        false;  ///< what lies under a coat loses what a smooth one would reflect, however rough the coat is, whose facets lose light among them (before 4.5)
    bool principled_v1 = false;         ///< Principled BSDF of the first generation (before 4.0)
    bool glass_as_two_lobes = false;    ///< Glass is a reflection and a refraction, divided by the reflectance of the whole surface (before 4.0)
    bool energy_by_root = false;        ///< of light among facets the root of the mean share escapes at each bounce (before 4.0)
    bool diffuse_normals_bend = false;  ///< diffuse closures bend their normals for reflections as the glossy ones do (before 4.0)
    bool diffuse_bounces_once = false;  ///< rough Diffuse lacks the term for several bounces (before 4.3)
    bool hair_tilts_light = false;      ///< the cuticle's tilt turns the light's side of Chiang's hair, not the viewer's (before 4.2)
    bool hair_section_faces_up = true;  ///< elliptic hair without normals of its own has its long axis towards the world's z (5.2; anywhere in 5.0)
    Rec709 rec709 = Rec709::Exact;
    Rec709 blackbody = Rec709::Exact;      ///< the fit of black bodies was made for rounded numbers; 5.2 converts it
    bool magic_wraps_scaled = true;        ///< Magic Texture takes coordinates modulo 2 pi after scaling them (from 5.1 or 5.2; tested in 5.0 and 5.2)
    bool hue_truncates = false;            ///< a hue that Hue/Saturation turns below 0 stays negative (up to 4.2)
    bool fisheye_window_mirrored = false;  ///< Window coordinates of equidistant and equisolid fisheyes run from the right (before 4.3)
    float displacement_width = 0.1f;       ///< filter width of the bump that stands for displacement (1 before 4.5)
    bool lamps_have_space = true;  ///< Object and Generated on lamps are in the lamp's space, and it mirrors (from 4.3, 4.4 or 4.5; tested in 4.2 and 4.5)
    bool lamps_have_uv = true;     ///< UV maps on lamps are their own coordinates (not in 3.4)
    bool points_have_properties = true;  ///< points read properties of their object and its instancer (from 4.3, 4.4 or 4.5; tested in 4.2 and 4.5)
    bool displaced_from_front = true;    ///< displacement is seen along the normal, before that from nowhere (from 4.3, 4.4 or 4.5; tested in 4.2 and 4.5)
    bool points_scale_by_mean = true;    ///< Radius of Point Info goes by the mean scale of the object, also where that is uneven (not in 3.4)
    bool curves_scale_by_mean = true;    ///< so does Thickness of Hair Info (from 5.0)
    bool polynomial_window = true;       ///< Window coordinates of fisheye lens polynomials are followed (not in 3.4)
    bool default_is_principled = true;   ///< what has no material looks like a new material, as if painted before 5.0
};

inline Semantics semantics_of(scene::BlenderVersion version) {
    Semantics s;
    s.noise_wraps = version >= 402;
    s.voronoi_integer_hash = version >= 500;
    s.noise_roughness_clamped = version < 402;
    s.sky_full_dome = version >= 500;
    s.normal_map_scales_slope = version >= 402;
    s.normals_as_directions = version < 402;
    s.bump_suits_reflections = version < 400;
    s.brick_clamps = version >= 402;
    s.closures = closure_semantics_of(version);
    s.metal_has_film = version >= 500;
    s.coat_as_mirror = version < 405;
    s.principled_v1 = version < 400;
    s.glass_as_two_lobes = version < 400;
    s.energy_by_root = version < 400;
    s.diffuse_normals_bend = version < 400;
    s.diffuse_bounces_once = version < 403;
    s.hair_tilts_light = version < 402;
    s.ies_ends = version < 402 ? IesEnds::Wrap : version < 500 ? IesEnds::Zero : IesEnds::Stay;
    s.ies_from_pole = version < 402;
    s.ies_by_normal = version < 400;
    s.rec709 = version >= 500 ? Rec709::Exact : Rec709::Rounded;
    s.hair_section_faces_up = version > 500;
    s.magic_wraps_scaled = version > 500;
    s.blackbody = version > 500 ? Rec709::Exact : Rec709::Rounded;
    s.hue_truncates = version < 405;
    s.fisheye_window_mirrored = version < 403;
    s.lamps_have_space = version >= 405;
    s.lamps_have_uv = version >= 402;
    s.points_have_properties = version >= 405;
    s.displaced_from_front = version >= 405;
    s.points_scale_by_mean = version >= 402;
    s.curves_scale_by_mean = version >= 500;
    s.polynomial_window = version >= 402;
    s.default_is_principled = version >= 500;
    s.displacement_width = version >= 405 ? 0.1f : 1.0f;
    return s;
}

}  // namespace talbot::shader
