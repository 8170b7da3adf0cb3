/// Objects in scenes of tests: each has traits of its own, with the same index.
#pragma once

#include "scene/scene.h"

namespace talbot::tests {

/// The object's index.
inline int place(scene::Scene& scene, const scene::ObjectTraits& traits, const Affine& to_world = {}) {
    scene.objects.push_back({to_world, scene::Handle(scene.traits.size()), 0});
    scene.traits.push_back(traits);
    return int(scene.objects.size()) - 1;
}

}  // namespace talbot::tests
