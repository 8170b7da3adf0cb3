// Open Image Denoise by dlopen: no Debian release has it, Blender's own builds carry it, so it can only be looked for
// at run time. Interface as in the library's public documentation, version 2.
#include <dlfcn.h>

#include <algorithm>
#include <filesystem>

#include "film/film.h"

namespace talbot::film {

namespace {

using Device = struct OidnDevice*;
using Filter = struct OidnFilter*;
using Monitor = bool (*)(void* user, double fraction);

constexpr const char* kLibrary = "libOpenImageDenoise.so.2";
constexpr int kDeviceCpu = 1;
constexpr int kFormatFloat3 = 3;
constexpr int kErrorCancelled = 6;

struct Library {
    Device (*new_device)(int type) = nullptr;
    void (*set_device_int)(Device, const char*, int) = nullptr;
    int (*get_device_int)(Device, const char*) = nullptr;
    void (*commit_device)(Device) = nullptr;
    void (*release_device)(Device) = nullptr;
    int (*get_device_error)(Device, const char**) = nullptr;
    Filter (*new_filter)(Device, const char*) = nullptr;
    void (*set_image)(Filter, const char*, void*, int, size_t, size_t, size_t, size_t, size_t) = nullptr;
    void (*set_filter_bool)(Filter, const char*, bool) = nullptr;
    void (*set_monitor)(Filter, Monitor, void*) = nullptr;
    void (*commit_filter)(Filter) = nullptr;
    void (*execute_filter)(Filter) = nullptr;
    void (*release_filter)(Filter) = nullptr;
};

// The handle is never closed: the library keeps threads whose code must stay where it is.
void* open_library(const std::vector<std::string>& directories) {
    // A copy that lives in this process already (Blender's) must be the one: two versions do not get on.
    if (void* handle = dlopen(kLibrary, RTLD_NOW | RTLD_NOLOAD)) return handle;
    // oneTBB opens its binding library with RTLD_DEEPBIND, whose libc then frees what the host's allocator allocated
    // (oneTBB issue 1636); opened beforehand without that flag it behaves.
    dlopen("libtbbbind_2_5.so.3", RTLD_NOW);
    for (const std::string& directory : directories) {
        if (directory.empty()) continue;
        if (void* handle = dlopen((std::filesystem::path(directory) / kLibrary).c_str(), RTLD_NOW | RTLD_LOCAL)) return handle;
        std::error_code error;  // some builds ship only the full version's name
        for (const auto& entry : std::filesystem::directory_iterator(directory, error)) {
            if (!entry.path().filename().string().starts_with(std::string(kLibrary) + ".")) continue;
            if (void* handle = dlopen(entry.path().c_str(), RTLD_NOW | RTLD_LOCAL)) return handle;
        }
    }
    return dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);
}

template <class Function>
bool find_function(void* handle, const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(handle, name));
    return function != nullptr;
}

bool load(const std::vector<std::string>& directories, Library& library) {
    void* handle = open_library(directories);
    return handle && find_function(handle, "oidnNewDevice", library.new_device) && find_function(handle, "oidnSetDeviceInt", library.set_device_int) &&
           find_function(handle, "oidnGetDeviceInt", library.get_device_int) && find_function(handle, "oidnCommitDevice", library.commit_device) &&
           find_function(handle, "oidnReleaseDevice", library.release_device) && find_function(handle, "oidnGetDeviceError", library.get_device_error) &&
           find_function(handle, "oidnNewFilter", library.new_filter) && find_function(handle, "oidnSetSharedFilterImage", library.set_image) &&
           find_function(handle, "oidnSetFilterBool", library.set_filter_bool) &&
           find_function(handle, "oidnSetFilterProgressMonitorFunction", library.set_monitor) &&
           find_function(handle, "oidnCommitFilter", library.commit_filter) && find_function(handle, "oidnExecuteFilter", library.execute_filter) &&
           find_function(handle, "oidnReleaseFilter", library.release_filter);
}

bool goes_on(void* user, double) {
    const auto* cancel = static_cast<const std::atomic<bool>*>(user);
    return !cancel || !cancel->load(std::memory_order_relaxed);
}

}  // namespace

DenoiseResult denoise(std::span<float> color, std::span<const float> albedo, std::span<const float> normal, int width, int height, int threads,
                      const std::vector<std::string>& library_dirs, const std::atomic<bool>* cancel) {
    const size_t floats = size_t(std::max(width, 0)) * size_t(std::max(height, 0)) * 3;
    if (floats == 0) return {true, {}};
    if (color.size() < floats || (!albedo.empty() && albedo.size() < floats) || (!normal.empty() && normal.size() < floats))
        return {false, "Denoising: a guide pass is smaller than the picture"};
    if (!goes_on(const_cast<std::atomic<bool>*>(cancel), 0)) return {false, "Denoising: cancelled"};
    Library oidn;
    if (!load(library_dirs, oidn)) return {false, "Denoising needs the Open Image Denoise library (version 2), which was not found"};

    Device device = oidn.new_device(kDeviceCpu);
    const auto failure = [&](Device of) -> std::string {
        const char* message = nullptr;
        const int code = oidn.get_device_error(of, &message);
        if (code == 0) return {};
        return code == kErrorCancelled ? "Denoising: cancelled" : "Denoising: " + std::string(message ? message : "unknown failure");
    };
    if (!device) return {false, failure(nullptr)};
    if (threads > 0) oidn.set_device_int(device, "numThreads", threads);
    oidn.commit_device(device);
    std::string problem = failure(device);
    if (problem.empty()) {
        Filter filter = oidn.new_filter(device, "RT");
        const auto image = [&](const char* name, const float* pixels) {
            oidn.set_image(filter, name, const_cast<float*>(pixels), kFormatFloat3, size_t(width), size_t(height), 0, 0, 0);
        };
        // Into a buffer of its own, so that a cancelled run leaves the picture as it was.
        std::vector<float> output(floats);
        image("color", color.data());
        image("output", output.data());
        if (!albedo.empty()) image("albedo", albedo.data());
        if (!albedo.empty() && !normal.empty()) image("normal", normal.data());  // the library takes no normals without albedo
        oidn.set_filter_bool(filter, "hdr", true);
        oidn.set_monitor(filter, goes_on, const_cast<std::atomic<bool>*>(cancel));
        oidn.commit_filter(filter);
        problem = failure(device);
        if (problem.empty()) {
            oidn.execute_filter(filter);
            problem = failure(device);
        }
        oidn.release_filter(filter);
        if (problem.empty()) std::copy(output.begin(), output.end(), color.begin());
    }
    oidn.release_device(device);
    return {problem.empty(), problem};
}

std::string denoiser_version(const std::vector<std::string>& library_dirs) {
    Library oidn;
    if (!load(library_dirs, oidn)) return {};
    Device device = oidn.new_device(kDeviceCpu);
    if (!device) return {};
    const int version = oidn.get_device_int(device, "version");
    oidn.release_device(device);
    return std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." + std::to_string(version % 100);
}

}  // namespace talbot::film
