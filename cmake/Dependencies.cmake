# The packages, each behind one target, so that a library names what it uses and nothing more. Also installed, for
# projects that use the libraries: targets made here are IMPORTED, so that they are found anew and not exported.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Ceres 2.1 REQUIRED)
find_package(Boost 1.74 REQUIRED)  # headers alone: Boost.Math
find_package(OpenCV 4.6 REQUIRED COMPONENTS core imgproc features2d calib3d flann imgcodecs stitching videoio aruco)
find_package(apriltag REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(nlohmann_json 3.11 REQUIRED)
find_package(SQLite3 REQUIRED)
find_package(EXPAT REQUIRED)
find_package(JPEG REQUIRED)
find_package(TIFF REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(CURL 7.85 REQUIRED)
find_package(BZip2 REQUIRED)
find_package(ZLIB REQUIRED)
find_package(PROJ 9 QUIET CONFIG)  # optional: coordinate systems beyond WGS 84 and UTM
find_package(fmt REQUIRED)
find_package(spdlog REQUIRED)
find_package(CLI11 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(lz4 REQUIRED IMPORTED_TARGET liblz4)
pkg_check_modules(zstd REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(exiv2 REQUIRED IMPORTED_TARGET exiv2)
pkg_check_modules(libheif IMPORTED_TARGET libheif)  # optional: HEIC photos
pkg_check_modules(pangocairo REQUIRED IMPORTED_TARGET pangocairo)
find_package(GDAL REQUIRED)
find_package(OpenGL REQUIRED COMPONENTS EGL)
find_package(GLEW REQUIRED)
# The workstation alone needs Qt, and is left out without it. Before VTK, whose Qt part refers to its targets.
find_package(Qt5 5.15 QUIET COMPONENTS Widgets OpenGL Concurrent Test)
find_package(VTK 9.1 REQUIRED COMPONENTS CommonCore CommonDataModel CommonMath FiltersSources RenderingAnnotation
             RenderingCore RenderingFreeType RenderingOpenGL2)
if(Qt5_FOUND)
  find_package(VTK 9.1 QUIET OPTIONAL_COMPONENTS GUISupportQt InteractionStyle)
endif()

# GeographicLib ships a find module and variables, no target.
list(APPEND CMAKE_MODULE_PATH /usr/share/cmake/geographiclib)
find_package(GeographicLib REQUIRED)
add_library(trigpoint_geographiclib INTERFACE IMPORTED)
target_link_libraries(trigpoint_geographiclib INTERFACE ${GeographicLib_LIBRARIES})
target_include_directories(trigpoint_geographiclib INTERFACE ${GeographicLib_INCLUDE_DIRS})

# OpenGV has no usable config on Debian 12.
find_path(OPENGV_INCLUDE_DIR opengv/types.hpp)
find_library(OPENGV_LIBRARY opengv)
if(NOT OPENGV_INCLUDE_DIR OR NOT OPENGV_LIBRARY)
  message(FATAL_ERROR "OpenGV not found: install libopengv-dev")
endif()
add_library(trigpoint_opengv INTERFACE IMPORTED)
target_link_libraries(trigpoint_opengv INTERFACE ${OPENGV_LIBRARY} Eigen3::Eigen)
target_include_directories(trigpoint_opengv INTERFACE ${OPENGV_INCLUDE_DIR})
