// A whole scene in one file: a magic word, a version, then every field in the order of the `fields` functions below,
// little-endian, no padding. To add a field to a struct of the scene, raise kVersion and append `a.since(VERSION, s.field)` to its line: older files
// then leave its default. Image files are read in, so that a dump needs nothing but itself (tiled ones keep their path).
#include <algorithm>
#include <bit>
#include <concepts>
#include <cstring>
#include <fstream>
#include <type_traits>
#include <unordered_map>
#include <utility>

#include "session/check_scene.h"
#include "session/session.h"

namespace talbot {

namespace {

using namespace scene;

static_assert(std::endian::native == std::endian::little, "dumps are little-endian");
constexpr char kMagic[8] = {'T', 'a', 'l', 'b', 'o', 't', 'S', 'c'};
constexpr uint32_t kVersion = 13;

// The last enumerator of each: what is beyond is refused.
constexpr int last_of(Domain) {
    return int(Domain::Object);
}
constexpr int last_of(GeometryKind) {
    return int(GeometryKind::Points);
}
constexpr int last_of(CurveShape) {
    return int(CurveShape::ThickLinear);
}
constexpr int last_of(SubdivisionScheme) {
    return int(SubdivisionScheme::Simple);
}
constexpr int last_of(UvSmoothing) {
    return int(UvSmoothing::All);
}
constexpr int last_of(DisplacementMethod) {
    return int(DisplacementMethod::Both);
}
constexpr int last_of(LightType) {
    return int(LightType::Area);
}
constexpr int last_of(AreaShape) {
    return int(AreaShape::Ellipse);
}
constexpr int last_of(CameraType) {
    return int(CameraType::Panoramic);
}
constexpr int last_of(PanoramaType) {
    return int(PanoramaType::CentralCylindrical);
}
constexpr int last_of(AlphaMode) {
    return int(AlphaMode::None);
}
constexpr int last_of(PixelFilter) {
    return int(PixelFilter::BlackmanHarris);
}
constexpr int last_of(PassKind) {
    return int(PassKind::ShadowCatcher);
}
constexpr int last_of(SocketKind) {
    return int(SocketKind::Shader);
}

template <class T, class Plain>
concept Is = std::same_as<std::remove_cv_t<T>, Plain>;

template <class T>
constexpr bool is_raw =
    (std::is_arithmetic_v<T> && !std::is_same_v<T, bool>) || std::is_same_v<T, Vec2> || std::is_same_v<T, Vec3> || std::is_same_v<T, Affine>;

template <class A, class T>
void transfer(A& a, T& value);

// ---- the fields, in file order

template <class A>
void fields(A& a, Is<Attribute> auto& s) {
    a(s.name, s.domain, s.components, s.is_color, s.data);
}
template <class A>
void fields(A& a, Is<Subdivision> auto& s) {
    a(s.scheme, s.uv_smoothing, s.sharp_corners, s.in_pixels, s.edge_length, s.max_level, s.face_starts, s.corner_vertices, s.face_materials, s.face_smooth,
      s.crease_edges, s.crease_sharpness, s.crease_vertices, s.vertex_sharpness);
}
template <class A>
void fields(A& a, Is<Mesh> auto& s) {
    a(s.name, s.positions, s.triangle_vertices, s.triangle_corners, s.triangle_faces, s.triangle_materials, s.triangle_smooth, s.vertex_normals,
      s.corner_normals, s.attributes, s.active_uv, s.active_color, s.generated_offset, s.generated_scale);
    a.since(2, s.kind);
    a.since(2, s.radii);
    a.since(2, s.curve_shape);
    a.since(2, s.curve_subdivisions);
    a.since(2, s.curve_starts);
    a.since(2, s.segment_keys);
    a.since(2, s.segment_curves);
    a.since(2, s.motion_steps);
    a.since(2, s.motion_positions);
    a.since(2, s.motion_normals);
    a.since(7, s.subdivision);
}
/// Nothing was known of objects that no blockers are chosen with regard to; the bit was a group.
template <class A>
void forget_chosen(A& a, ObjectTraits& s) {
    if (a.version() < 11) s.blocks &= ~kChosenOrNot;
}
template <class A>
void fields(A& a, Is<ObjectTraits> auto& s) {
    a(s.name, s.mesh, s.material_set, s.attribute_set, s.linking, s.visibility, s.pass_index, s.color, s.is_instance, s.is_holdout, s.is_shadow_catcher,
      s.receiver_set, s.blocks, s.shadow_terminator_shading_offset, s.shadow_terminator_geometry_offset);
    a.since(12, s.light_group);
    if constexpr (A::kReads) forget_chosen(a, s);
}
template <class A>
void fields(A& a, Is<Object> auto& s) {
    a(s.to_world, s.traits, s.random);
}
template <class A>
void fields(A& a, Is<Dupli> auto& s) {
    a(s.generated, s.uv);
}

/// Before version 10 each object was a record of its own.
struct WholeObject {
    ObjectTraits traits;
    Object place;
    Dupli dupli;
    Handle motion = kNone;
};
template <class A>
void fields(A& a, Is<WholeObject> auto& s) {
    ObjectTraits& t = s.traits;
    a(t.name, t.mesh, t.material_set, t.attribute_set, s.place.to_world, t.visibility, s.place.random, t.pass_index, t.color, s.dupli.generated, s.dupli.uv,
      t.is_instance, t.is_holdout, t.is_shadow_catcher, t.shadow_terminator_shading_offset, t.shadow_terminator_geometry_offset);
    a.since(3, s.motion);
    a.since(5, t.linking);
    a.since(5, t.receiver_set);
    a.since(8, t.blocks);
    // Blocker groups were bits of the visibility.
    if (a.version() < 8) {
        t.blocks = t.visibility >> 8 & 0x1ffff;
        t.visibility &= kVisibleAll;
    }
    forget_chosen(a, t);
}
template <class A>
void take_whole_objects(A& a, Scene& scene, std::vector<Handle>& moving) {
    std::vector<WholeObject> objects;
    a(objects);
    for (WholeObject& object : objects) {
        if (scene.traits.empty() || !(scene.traits.back() == object.traits)) scene.traits.push_back(object.traits);
        object.place.traits = Handle(scene.traits.size()) - 1;
        scene.objects.push_back(object.place);
        scene.duplis.push_back(object.dupli);
        moving.push_back(object.motion);
    }
}

template <class A>
void fields(A& a, Is<Linking> auto& s) {
    a(s.receivers, s.blockers);
    if constexpr (A::kReads) {
        if (a.version() < 8) s.blockers = s.blockers > int32_t(kVisibleShadow) ? std::countr_zero(uint32_t(s.blockers)) - 8 : -1;
        if (a.version() < 11 && s.blockers >= kBlockerGroups) s.blockers = -1;
    }
}
template <class A>
void fields(A& a, Is<NodeInput> auto& s) {
    a(s.identifier, s.kind, s.value, s.hidden_value, s.from_node, s.from_output);
}
template <class A>
void fields(A& a, Is<NodeOutput> auto& s) {
    a(s.identifier, s.kind, s.value);
}
template <class A>
void fields(A& a, Is<Node> auto& s) {
    a(s.type, s.name, s.properties, s.inputs, s.outputs);
}
template <class A>
void fields(A& a, Is<ShaderGraph> auto& s) {
    a(s.name, s.nodes, s.output_node);
}
template <class A>
void fields(A& a, Is<Shader> auto& s) {
    a(s.name, s.graph, s.pass_index, s.sample_as_light, s.emission_front, s.emission_back, s.use_transparent_shadow, s.use_bump_map_correction);
    a.since(4, s.displacement);
}
template <class A>
void fields(A& a, Is<Light> auto& s) {
    a(s.name, s.type, s.to_world, s.color, s.power, s.normalize, s.radius, s.soft_falloff, s.spot_angle, s.spot_blend, s.sun_angle, s.shape, s.size_x, s.size_y,
      s.spread, s.shader, s.visibility, s.cast_shadow, s.use_mis, s.is_portal, s.max_bounces, s.light_group, s.random);
    a.since(5, s.linking);
    a.since(5, s.is_shadow_catcher);
    a.since(13, s.object_color);
    a.since(13, s.pass_index);
    a.since(13, s.attributes);
}
template <class A>
void fields(A& a, Is<World> auto& s) {
    a(s.shader, s.visibility, s.use_importance_map, s.map_resolution, s.max_bounces, s.sample_as_light);
    a.since(12, s.light_group);
}
template <class A>
void fields(A& a, Is<Camera> auto& s) {
    a(s.type, s.panorama, s.to_world, s.view, s.clip_start, s.clip_end, s.aperture_radius, s.focus_distance, s.aperture_blades, s.aperture_rotation,
      s.aperture_ratio, s.fov, s.lens_mm, s.sensor_width_mm, s.sensor_height_mm, s.latitude_min, s.latitude_max, s.longitude_min, s.longitude_max, s.polynomial,
      s.cylinder);
}
template <class A>
void fields(A& a, Is<Image> auto& s) {
    a(s.name, s.path, s.bytes, s.pixels, s.width, s.height, s.pixels_are_float, s.colorspace, s.alpha, s.tiles);
}
template <class A>
void fields(A& a, Is<Settings> auto& s) {
    a(s.version, s.width, s.height, s.crop_x, s.crop_y, s.crop_width, s.crop_height, s.samples, s.first_sample, s.seed, s.time_limit, s.adaptive,
      s.adaptive_threshold, s.adaptive_min_samples, s.max_bounces, s.diffuse_bounces, s.glossy_bounces, s.transmission_bounces, s.volume_bounces,
      s.transparent_bounces, s.min_light_bounces, s.min_transparent_bounces, s.clamp_direct, s.clamp_indirect, s.caustics_reflective, s.caustics_refractive,
      s.filter_glossy, s.light_threshold, s.filter, s.filter_width, s.film_exposure, s.film_transparent, s.film_transparent_glass, s.film_transparent_roughness,
      s.mist_start, s.mist_depth, s.mist_falloff, s.use_emission_sampling, s.threads, s.ocio_config, s.working_space, s.luminance_weights, s.instruction_set,
      s.viewport);
    a.since(7, s.offscreen_dicing_scale);
    a.since(9, s.pass_alpha_threshold);
}
template <class A>
void fields(A& a, Is<Aov> auto& s) {
    a(s.name, s.is_color);
}
template <class A>
void fields(A& a, Is<Motion> auto& s) {
    a(s.objects, s.camera, s.camera_views, s.shutter, s.rolling, s.rolling_duration);
    a.since(10, s.of_objects);
}
/// All but the dirty bits: a scene that was read is all new.
template <class A>
void fields(A& a, Is<Scene> auto& s) {
    a(s.settings, s.camera, s.world, s.meshes);
    a.since(10, s.objects);
    a.since(10, s.traits);
    a.since(10, s.duplis);
    [[maybe_unused]] std::vector<Handle> moving;
    if constexpr (A::kReads) {
        if (a.version() < 10) take_whole_objects(a, s, moving);
    }
    a(s.object_names, s.material_sets, s.object_attribute_sets, s.lights, s.shaders, s.images, s.passes);
    a.since(3, s.motion);
    if constexpr (A::kReads) {
        if (std::any_of(moving.begin(), moving.end(), [](Handle motion) { return motion != kNone; })) s.motion.of_objects = std::move(moving);
    }
    a.since(5, s.linkings);
    a.since(6, s.aovs);
    a.since(7, s.dicing_camera);
    a.since(12, s.light_groups);
}

// ---- writing

std::vector<uint8_t> read_bytes(const std::string& path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (!file) return {};
    const std::streamoff size = file.tellg();
    if (size <= 0) return {};
    std::vector<uint8_t> bytes(static_cast<size_t>(size));
    file.seekg(0);
    if (!file.read(reinterpret_cast<char*>(bytes.data()), size)) return {};
    return bytes;
}

class Writer {
public:
    static constexpr bool kReads = false;
    explicit Writer(std::ostream& out) : out_(out) {}

    template <class... T>
    void operator()(const T&... values) {
        (transfer(*this, values), ...);
    }
    template <class T>
    void since(uint32_t, const T& value) {
        transfer(*this, value);
    }
    void raw(const void* data, size_t bytes) { out_.write(static_cast<const char*>(data), std::streamsize(bytes)); }
    void count(size_t n) {
        const uint64_t n64 = n;
        raw(&n64, sizeof n64);
    }
    /// Shared things are written where they appear first, and by number afterwards.
    template <class T>
    void shared(const std::shared_ptr<const T>& pointer) {
        if (!pointer) return tag(0);
        const auto [found, is_new] = known_.try_emplace(pointer.get(), uint32_t(known_.size()));
        if (!is_new) {
            tag(2);
            return raw(&found->second, sizeof found->second);
        }
        tag(1);
        if constexpr (std::is_same_v<T, Image>) {
            if (pointer->pixels.empty() && pointer->bytes.empty() && pointer->tiles.empty()) {
                Image embedded = *pointer;
                embedded.bytes = read_bytes(embedded.path);
                return fields(*this, std::as_const(embedded));
            }
        }
        fields(*this, *pointer);
    }
    void tag(uint8_t value) { raw(&value, 1); }

private:
    std::ostream& out_;
    std::unordered_map<const void*, uint32_t> known_;
};

// ---- reading

class Reader {
public:
    static constexpr bool kReads = true;
    Reader(std::vector<uint8_t> bytes, std::string path) : bytes_(std::move(bytes)), path_(std::move(path)) {}
    void set_version(uint32_t version) { version_ = version; }
    uint32_t version() const { return version_; }

    template <class... T>
    void operator()(T&... values) {
        (transfer(*this, values), ...);
    }
    template <class T>
    void since(uint32_t version, T& value) {
        if (version_ >= version) transfer(*this, value);
    }
    void raw(void* data, size_t bytes) {
        if (bytes > left()) fail("it ends too early");
        if (bytes) std::memcpy(data, bytes_.data() + at_, bytes);
        at_ += bytes;
    }
    /// Number of elements that take at least `bytes` each.
    size_t count(size_t bytes) {
        uint64_t n = 0;
        raw(&n, sizeof n);
        if (n > left() / bytes) fail("a list is longer than the file");
        return size_t(n);
    }
    template <class T>
    void shared(std::shared_ptr<const T>& pointer) {
        uint8_t kind = 0;
        raw(&kind, 1);
        if (kind == 0) return pointer.reset();
        if (kind == 2) {
            uint32_t index = 0;
            raw(&index, sizeof index);
            if (index >= known_.size() || known_[index].is_mesh != std::is_same_v<T, Mesh>) fail("a reference leads nowhere");
            pointer = std::static_pointer_cast<const T>(known_[index].pointer);
            return;
        }
        if (kind != 1) fail("a mark is none that is known");
        auto made = std::make_shared<T>();
        fields(*this, *made);
        known_.push_back({made, std::is_same_v<T, Mesh>});
        pointer = made;
    }
    size_t left() const { return bytes_.size() - at_; }
    [[noreturn]] void fail(const std::string& why) const { throw Error("The scene cannot be read, " + why + " (byte " + std::to_string(at_) + ")", path_); }

private:
    struct Known {
        std::shared_ptr<const void> pointer;
        bool is_mesh;
    };
    std::vector<uint8_t> bytes_;
    std::string path_;
    size_t at_ = 0;
    uint32_t version_ = kVersion;
    std::vector<Known> known_;
};

// ---- kinds of value

template <class T>
struct is_vector : std::false_type {};
template <class T>
struct is_vector<std::vector<T>> : std::true_type {};
template <class T>
struct is_shared : std::false_type {};
template <class T>
struct is_shared<std::shared_ptr<const T>> : std::true_type {};

/// Strings, and lists whose elements are numbers: one block.
template <class A, class T>
void transfer_block(A& a, T& list) {
    using Element = typename std::remove_cv_t<T>::value_type;
    if constexpr (A::kReads) {
        list.resize(a.count(sizeof(Element)));
    } else {
        a.count(list.size());
    }
    a.raw(list.data(), list.size() * sizeof(Element));
}

template <class A, class T>
void transfer_list(A& a, T& list) {
    if constexpr (A::kReads) {
        list.clear();
        const size_t n = a.count(1);
        // Grows as elements arrive: a false count costs nothing.
        for (size_t i = 0; i < n; ++i) transfer(a, list.emplace_back());
    } else {
        a.count(list.size());
        for (const auto& element : list) transfer(a, element);
    }
}

template <class A, class T>
void transfer_properties(A& a, T& properties) {
    if constexpr (A::kReads) {
        properties.clear();
        const size_t n = a.count(1);
        for (size_t i = 0; i < n; ++i) {
            std::string name;
            uint8_t kind = 0;
            a(name, kind);
            Property& property = properties[name];
            if (kind == 0) {
                a(property.template emplace<double>());
            } else if (kind == 1) {
                a(property.template emplace<std::string>());
            } else if (kind == 2) {
                a(property.template emplace<std::vector<float>>());
            } else {
                a.fail("a property is of no known kind");
            }
        }
    } else {
        a.count(properties.size());
        for (const auto& [name, property] : properties) {
            a(name, uint8_t(property.index()));
            std::visit([&](const auto& value) { a(value); }, property);
        }
    }
}

template <class A, class T>
void transfer(A& a, T& value) {
    using Plain = std::remove_cv_t<T>;
    if constexpr (is_raw<std::remove_all_extents_t<Plain>>) {
        a.raw(&value, sizeof value);
    } else if constexpr (std::is_same_v<Plain, bool> || std::is_enum_v<Plain>) {
        static_assert(sizeof(Plain) == 1);
        uint8_t byte = 0;
        if constexpr (!A::kReads) byte = uint8_t(value);
        a.raw(&byte, 1);
        if constexpr (A::kReads) {
            int last = 1;
            if constexpr (std::is_enum_v<Plain>) last = last_of(Plain{});
            if (byte > last) a.fail("a value is outside its range");
            value = Plain(byte);
        }
    } else if constexpr (std::is_same_v<Plain, std::string>) {
        transfer_block(a, value);
    } else if constexpr (is_vector<Plain>::value) {
        if constexpr (is_raw<typename Plain::value_type>) {
            transfer_block(a, value);
        } else {
            transfer_list(a, value);
        }
    } else if constexpr (std::is_same_v<Plain, std::map<std::string, Property>>) {
        transfer_properties(a, value);
    } else if constexpr (is_shared<Plain>::value) {
        a.shared(value);
    } else {
        fields(a, value);
    }
}

}  // namespace

void dump_scene(const scene::Scene& scene, const std::string& path) {
    std::ofstream file(path, std::ios::binary);
    if (!file) throw Error("The scene cannot be written", path);
    Writer writer(file);
    writer.raw(kMagic, sizeof kMagic);
    writer(kVersion);
    fields(writer, scene);
    if (!file.flush()) throw Error("The scene cannot be written", path);
}

scene::Scene load_scene(const std::string& path) {
    std::ifstream exists(path, std::ios::binary);
    if (!exists) throw Error("There is no such file, or it cannot be opened", path);
    Reader reader(read_bytes(path), path);
    char magic[sizeof kMagic] = {};
    uint32_t version = 0;
    if (reader.left() >= sizeof magic + sizeof version) reader.raw(magic, sizeof magic);
    if (std::memcmp(magic, kMagic, sizeof magic) != 0) throw Error("This is not a scene that Talbot has written", path);
    reader(version);
    if (version == 0 || version > kVersion) throw Error("The scene comes from a newer Talbot (format " + std::to_string(version) + ")", path);
    reader.set_version(version);
    scene::Scene scene;
    scene.passes.clear();
    fields(reader, scene);
    if (reader.left() > 0) reader.fail("there is more than a scene in it");
    try {
        check_scene(scene);
    } catch (const Error& error) {
        throw Error(error.what(), path);
    }
    return scene;
}

}  // namespace talbot
