/// A random number for each connected part of a mesh, as Geometry > Random Per Island gives it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace talbot::scene {

/// For each vertex 0..1: hash of the vertex that stands for its island. Vertices are joined edge by edge in their order, the island of lower rank below
/// the other, which decides who stands for whom. Edges to vertices that do not exist are skipped.
std::vector<float> random_per_island(size_t vertices, std::span<const uint32_t> edges);

}  // namespace talbot::scene
