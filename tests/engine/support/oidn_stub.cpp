// Stands in for Open Image Denoise where tests want a denoiser that is always there, takes its time and can be told apart: the
// picture comes back doubled after kSteps steps of a millisecond, between which it asks whether to go on. Error codes are the library's.
#include <chrono>
#include <cstddef>
#include <string>
#include <thread>

#define STUB_API extern "C" __attribute__((visibility("default")))

namespace {

constexpr int kSteps = 40;
constexpr int kErrorCancelled = 6;

struct Device {
    int error = 0;
};
struct Filter {
    Device* device = nullptr;
    const float* color = nullptr;
    float* output = nullptr;
    size_t floats = 0;
    bool (*monitor)(void*, double) = nullptr;
    void* user = nullptr;
};

}  // namespace

STUB_API Device* oidnNewDevice(int) {
    return new Device;
}
STUB_API void oidnSetDeviceInt(Device*, const char*, int) {}
STUB_API int oidnGetDeviceInt(Device*, const char*) {
    return 20000;
}
STUB_API void oidnCommitDevice(Device*) {}
STUB_API void oidnReleaseDevice(Device* device) {
    delete device;
}
STUB_API int oidnGetDeviceError(Device* device, const char** message) {
    *message = "stub";
    const int error = device->error;
    device->error = 0;
    return error;
}
STUB_API Filter* oidnNewFilter(Device* device, const char*) {
    auto* filter = new Filter;
    filter->device = device;
    return filter;
}
STUB_API void oidnSetSharedFilterImage(Filter* filter, const char* name, void* pixels, int, size_t width, size_t height, size_t, size_t, size_t) {
    filter->floats = width * height * 3;
    if (std::string(name) == "color") filter->color = static_cast<const float*>(pixels);
    if (std::string(name) == "output") filter->output = static_cast<float*>(pixels);
}
STUB_API void oidnSetFilterBool(Filter*, const char*, bool) {}
STUB_API void oidnSetFilterProgressMonitorFunction(Filter* filter, bool (*monitor)(void*, double), void* user) {
    filter->monitor = monitor;
    filter->user = user;
}
STUB_API void oidnCommitFilter(Filter*) {}
STUB_API void oidnExecuteFilter(Filter* filter) {
    for (int step = 0; step < kSteps; ++step) {
        if (!filter->monitor(filter->user, double(step) / kSteps)) {
            filter->device->error = kErrorCancelled;
            return;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    for (size_t i = 0; i < filter->floats; ++i) filter->output[i] = 2 * filter->color[i];
}
STUB_API void oidnReleaseFilter(Filter* filter) {
    delete filter;
}
