# The engine's libraries for the bundled build: every archive below TALBOT_BUNDLE, in one group, because they need each other
# both ways round (made by packaging/launcher/bundle/libraries.py), and the distribution's Embree and OpenColorIO (isolate.py).
find_package(embree 3 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(OpenColorIO REQUIRED IMPORTED_TARGET GLOBAL OpenColorIO)
add_library(OpenColorIO::OpenColorIO ALIAS PkgConfig::OpenColorIO)
file(GLOB archives CONFIGURE_DEPENDS ${TALBOT_BUNDLE}/lib/*.a)
if(NOT archives)
  message(FATAL_ERROR "There are no archives in ${TALBOT_BUNDLE}/lib: ./talbot package builds them")
endif()

add_library(talbot_bundled INTERFACE)
target_include_directories(talbot_bundled SYSTEM INTERFACE ${TALBOT_BUNDLE}/include ${TALBOT_BUNDLE}/include/Imath)
target_compile_definitions(talbot_bundled INTERFACE OIIO_STATIC_DEFINE=1)
target_link_libraries(talbot_bundled INTERFACE -Wl,--start-group ${archives} -Wl,--end-group)
add_library(OpenImageIO::OpenImageIO INTERFACE IMPORTED GLOBAL)
target_link_libraries(OpenImageIO::OpenImageIO INTERFACE talbot_bundled)
add_library(OpenSubdiv::CPU INTERFACE IMPORTED GLOBAL)
target_link_libraries(OpenSubdiv::CPU INTERFACE talbot_bundled)
