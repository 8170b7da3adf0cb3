// What OpenImageIO's readers and writers name of its image algorithms and texture system beside those that decode: to blank a new
// buffer, and to make thumbnails, list fonts, dither and describe textures, which are never asked for here. The files that define
// them are half of the library's compile time and are left out of the bundle (`unused` in packaging/launcher/bundle/parts.py);
// this stands in.

#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/texture.h>

#include <cstring>

OIIO_NAMESPACE_BEGIN

/// All of a buffer that holds its own pixels in one piece, which is what the library's own calls are about.
bool ImageBufAlgo::zero(ImageBuf& buffer, ROI, int) {
    void* const pixels = buffer.localpixels();
    if (!pixels) return false;
    std::memset(pixels, 0, buffer.spec().image_bytes());
    return true;
}

// No thumbnail.
ImageBuf ImageBufAlgo::channels(const ImageBuf&, int, cspan<int>, cspan<float>, cspan<std::string>, bool, int) {
    return {};
}

ImageBuf ImageBufAlgo::resize(const ImageBuf&, string_view, float, ROI, int) {
    return {};
}

ImageBuf ImageBufAlgo::copy(const ImageBuf&, TypeDesc, ROI, int) {
    return {};
}

ImageBuf ImageBufAlgo::resize(const ImageBuf&, Filter2D*, ROI, int) {
    return {};
}

bool ImageBufAlgo::copy(ImageBuf& target, const ImageBuf&, TypeDesc, ROI, int) {
    target.errorfmt("left out of this build");
    return false;
}

bool ImageBufAlgo::paste(ImageBuf& target, int, int, int, int, const ImageBuf&, ROI, int) {
    target.errorfmt("left out of this build");
    return false;
}

void Tex::parse_wrapmodes(const char*, Wrap& s, Wrap& t) {
    s = t = Wrap::Default;
}

namespace pvt {

extern int opencv_version;
extern float bluenoise_table[256][256][4];
int opencv_version = 0;
float bluenoise_table[256][256][4];

static const std::vector<std::string> none;
const std::vector<std::string>& font_dirs() {
    return none;
}
const std::vector<std::string>& font_file_list() {
    return none;
}
const std::vector<std::string>& font_list() {
    return none;
}
const char* texture_format_name(TexFormat) {
    return "";
}
const char* texture_type_name(TexFormat) {
    return "";
}

}  // namespace pvt

OIIO_NAMESPACE_END
