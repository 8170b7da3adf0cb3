#include "asset/read_image.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <string_view>

namespace talbot::asset {

namespace {

constexpr int kLargestSide = 1 << 17;
constexpr int64_t kMostTexels = int64_t(1) << 30;  // kernels count texels in 32 bits

bool ends_with(const std::string& name, const char* suffix) {
    return name == suffix || name.ends_with(std::string(".") + suffix);
}

/// First channel to read and how many (1, 2: grey and alpha, 3, 4). Multilayer files: the first layer that has R, G, B.
struct Channels {
    int first = 0, count = 1;
};

Channels choose_channels(const OIIO::ImageSpec& spec) {
    const int n = spec.nchannels;
    const auto name = [&](int i) { return i < int(spec.channelnames.size()) ? spec.channelnames[size_t(i)] : std::string(); };
    if (n <= 4) return {0, std::max(n, 1)};
    for (int i = 0; i + 2 < n; ++i) {
        if (!ends_with(name(i), "R") || !ends_with(name(i + 1), "G") || !ends_with(name(i + 2), "B")) continue;
        return {i, i + 3 < n && ends_with(name(i + 3), "A") ? 4 : 3};
    }
    return {0, 1};
}

bool has_straight_alpha(OIIO::ImageInput& input, const OIIO::ImageSpec& spec) {
    if (spec.get_int_attribute("oiio:UnassociatedAlpha", 0)) return true;
    // These readers do not always say so; Blender takes anything that is not marked as multiplied for straight.
    const std::string_view format = input.format_name();
    if (format == "targa") return spec.get_int_attribute("targa:alpha_type", -1) != 4;
    return format == "dds";
}

template <class T>
void expand(std::vector<T>& texels, size_t count, int channels, T full) {
    // Read with a stride of four: grey sits in the first, its alpha in the second.
    for (size_t i = 0; i < count; ++i) {
        T* t = texels.data() + 4 * i;
        if (channels == 2) {
            t[3] = t[1];
            t[1] = t[2] = t[0];
        } else if (channels == 3) {
            t[3] = full;
        }
    }
}

template <class T>
void read_texels(OIIO::ImageInput& input, RawImage& image, Channels channels, OIIO::TypeDesc type, std::vector<T>& texels, T full,
                 const std::atomic<bool>* cancel) {
    const size_t count = size_t(image.width) * size_t(image.height);
    texels.resize(count * size_t(image.channels));
    const OIIO::stride_t pixel_stride = OIIO::stride_t(sizeof(T)) * image.channels, row_stride = pixel_stride * image.width;
    const auto stop = [](void* flag, float) -> bool {
        const auto* cancelled = static_cast<const std::atomic<bool>*>(flag);
        return cancelled && cancelled->load(std::memory_order_relaxed);
    };
    // From the last row backwards: files begin at the top.
    const bool ok =
        input.read_image(0, 0, channels.first, channels.first + channels.count, type, texels.data() + (count - size_t(image.width)) * size_t(image.channels),
                         pixel_stride, -row_stride, OIIO::AutoStride, stop, const_cast<std::atomic<bool>*>(cancel));
    if (stop(const_cast<std::atomic<bool>*>(cancel), 0)) throw Cancelled{};
    if (!ok) throw Error(input.geterror());
    if (image.channels == 4) expand(texels, count, channels.count, full);
}

RawImage read_opened(OIIO::ImageInput& input, const std::atomic<bool>* cancel) {
    const OIIO::ImageSpec spec = input.spec();
    if (spec.width < 1 || spec.height < 1 || spec.width > kLargestSide || spec.height > kLargestSide || int64_t(spec.width) * spec.height > kMostTexels)
        throw Error("its size, " + std::to_string(spec.width) + " x " + std::to_string(spec.height) + ", cannot be held");
    if (spec.deep) throw Error("deep images are not supported");
    const Channels channels = choose_channels(spec);
    RawImage image;
    image.width = spec.width;
    image.height = spec.height;
    image.channels = channels.count == 1 ? 1 : 4;
    image.has_alpha = channels.count == 2 || channels.count == 4;
    image.is_straight = image.has_alpha && has_straight_alpha(input, spec);
    switch (spec.format.basetype) {
        case OIIO::TypeDesc::UINT8:
            image.depth = Depth::Byte;
            read_texels<uint8_t>(input, image, channels, OIIO::TypeDesc::UINT8, image.bytes, 255, cancel);
            break;
        case OIIO::TypeDesc::UINT16:
            image.depth = Depth::Short;
            read_texels<uint16_t>(input, image, channels, OIIO::TypeDesc::UINT16, image.shorts, 65535, cancel);
            break;
        default:
            image.depth = spec.format.basetype == OIIO::TypeDesc::HALF ? Depth::Half : Depth::Float;
            read_texels<float>(input, image, channels, OIIO::TypeDesc::FLOAT, image.floats, 1.0f, cancel);
            for (float& f : image.floats) f = std::isfinite(f) ? f : 0.0f;
            break;
    }
    return image;
}

OIIO::ImageSpec reading_hints() {
    OIIO::ImageSpec hints;
    hints.attribute("oiio:UnassociatedAlpha", 1);  // colour as stored: multiplying by alpha is ours
    return hints;
}

/// A file name whose ending tells the format, from the file's first bytes where they are known.
std::string format_name(std::span<const uint8_t> bytes, const std::string& name) {
    struct Magic {
        std::string_view bytes;
        size_t at;
        const char* extension;
    };
    static constexpr auto kMagics = std::to_array<Magic>({{"\x89PNG", 0, "png"},
                                                          {"\xff\xd8\xff", 0, "jpg"},
                                                          {"\x76\x2f\x31\x01", 0, "exr"},
                                                          {"II*", 0, "tif"},
                                                          {std::string_view("MM\0*", 4), 0, "tif"},
                                                          {"#?", 0, "hdr"},
                                                          {"BM", 0, "bmp"},
                                                          {"DDS ", 0, "dds"},
                                                          {"8BPS", 0, "psd"},
                                                          {"GIF8", 0, "gif"},
                                                          {"WEBP", 8, "webp"},
                                                          {"SDPX", 0, "dpx"},
                                                          {"XPDS", 0, "dpx"},
                                                          {std::string_view("\0\0\0\x0cjP", 6), 0, "jp2"}});
    for (const Magic& magic : kMagics) {
        if (bytes.size() >= magic.at + magic.bytes.size() && std::memcmp(bytes.data() + magic.at, magic.bytes.data(), magic.bytes.size()) == 0)
            return std::string("packed.") + magic.extension;
    }
    const std::string extension = std::filesystem::path(name).extension().string();
    return "packed" + (extension.empty() ? ".tga" : extension);  // Targa has no signature
}

/// For readers that cannot read from memory.
class TemporaryFile {
public:
    TemporaryFile(std::span<const uint8_t> bytes, const std::string& name) {
        const std::string suffix = std::filesystem::path(name).extension().string();
        path_ = (std::filesystem::temp_directory_path() / ("talbot-XXXXXX" + suffix)).string();
        const int file = mkstemps(path_.data(), int(suffix.size()));
        if (file < 0) throw Error("no temporary file could be made to unpack it");
        size_t done = 0;
        while (done < bytes.size()) {
            const ssize_t written = write(file, bytes.data() + done, bytes.size() - done);
            if (written <= 0) break;
            done += size_t(written);
        }
        close(file);
        if (done < bytes.size()) {
            unlink(path_.c_str());
            throw Error("no room to unpack it");
        }
    }
    ~TemporaryFile() { unlink(path_.c_str()); }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;
    const std::string& path() const { return path_; }

private:
    std::string path_;
};

}  // namespace

RawImage read_image_file(const std::string& path, const std::atomic<bool>* cancel) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) throw Error("there is no file " + path);
    const OIIO::ImageSpec hints = reading_hints();
    const auto input = OIIO::ImageInput::open(path, &hints);
    if (!input) throw Error(OIIO::geterror());
    return read_opened(*input, cancel);
}

RawImage read_image_bytes(std::span<const uint8_t> bytes, const std::string& name, const std::atomic<bool>* cancel) {
    const std::string hint = format_name(bytes, name);
    const auto probe = OIIO::ImageInput::create(std::filesystem::path(hint).extension().string().substr(1));
    if (!probe) throw Error("unknown format: " + OIIO::geterror());
    if (probe->supports("ioproxy")) {
        try {
            OIIO::Filesystem::IOMemReader reader(const_cast<uint8_t*>(bytes.data()), bytes.size());
            OIIO::Filesystem::IOProxy* const proxy = &reader;
            OIIO::ImageSpec hints = reading_hints();
            hints.attribute("oiio:ioproxy", OIIO::TypeDesc::PTR, &proxy);
            const auto input = OIIO::ImageInput::open(hint, &hints, &reader);
            if (!input) throw Error(OIIO::geterror());
            return read_opened(*input, cancel);
        } catch (const Error&) {
            // Some readers promise it and fail all the same (DDS in 2.4): the file below decides.
        }
    }
    const TemporaryFile file(bytes, hint);
    return read_image_file(file.path(), cancel);
}

}  // namespace talbot::asset
