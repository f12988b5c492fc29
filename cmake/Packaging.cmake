# Debian packages: `cpack` in the build folder (or ./setup.sh package) makes trigpoint, trigpoint-dev and, where
# it is built, trigpoint-desktop.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME trigpoint)
set(CPACK_PACKAGE_VENDOR "The Trigpoint authors")
set(CPACK_PACKAGE_CONTACT "The Trigpoint authors <trigpoint@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "From a folder of images to localized panoramas")
set(CPACK_PACKAGE_DESCRIPTION "Finds out where pictures were taken, to centimetres, from geotagged panoramas, and how sure it is.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL runtime dev)
if(TARGET trigpoint-desktop)
  list(APPEND CPACK_COMPONENTS_ALL desktop)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME trigpoint)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION science)
set(CPACK_DEBIAN_RUNTIME_DESCRIPTION "localizes panoramas and images, and says how well
 ${CPACK_PACKAGE_DESCRIPTION}
 .
 This package has the command line, its manual, and an example site.")
# Found at run time, so dpkg-shlibdeps does not see them: pictures without a screen, and their letters.
set(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS "libgl1-mesa-dri, fonts-dejavu-core")
# What the program is linked with, as dpkg-shlibdeps finds it.
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS "colmap, geographiclib-tools")
set(CPACK_DEBIAN_DESKTOP_PACKAGE_NAME trigpoint-desktop)
set(CPACK_DEBIAN_DESKTOP_PACKAGE_SECTION science)
set(CPACK_DEBIAN_DESKTOP_DESCRIPTION "workstation of trigpoint
 The windows in which a project is run, looked at, compared and reviewed.")
set(CPACK_DEBIAN_DESKTOP_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_DESKTOP_PACKAGE_DEPENDS "trigpoint (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME trigpoint-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_DESCRIPTION "libraries of trigpoint, to build against
 Headers, static libraries and what find_package(trigpoint) needs.")
string(JOIN ", " CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "trigpoint (= ${PROJECT_VERSION})" libeigen3-dev libceres-dev libboost-dev libopencv-dev
       libopengv-dev libapriltag-dev libgeographiclib-dev libexiv2-dev libexpat1-dev libyaml-cpp-dev nlohmann-json3-dev
       libsqlite3-dev libssl-dev libfmt-dev libspdlog-dev libcli11-dev libproj-dev libheif-dev libcurl4-openssl-dev libbz2-dev zlib1g-dev liblz4-dev libzstd-dev libvtk9-dev libgdal-dev
       libglew-dev libegl-dev libpango1.0-dev)
include(CPack)

# Licence and the notices of what the program is linked with.
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/trigpoint RENAME copyright)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/trigpoint-dev RENAME copyright COMPONENT dev)
if(TARGET trigpoint-desktop)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/trigpoint-desktop RENAME copyright
          COMPONENT desktop)
endif()
install(CODE "execute_process(COMMAND gzip -9nc \"${PROJECT_SOURCE_DIR}/cmake/changelog\"
                              OUTPUT_FILE \"${PROJECT_BINARY_DIR}/changelog.gz\" COMMAND_ERROR_IS_FATAL ANY)" ALL_COMPONENTS)
install(FILES ${PROJECT_BINARY_DIR}/changelog.gz DESTINATION share/doc/trigpoint)
install(FILES ${PROJECT_BINARY_DIR}/changelog.gz DESTINATION share/doc/trigpoint-dev COMPONENT dev)
if(TARGET trigpoint-desktop)
  install(FILES ${PROJECT_BINARY_DIR}/changelog.gz DESTINATION share/doc/trigpoint-desktop COMPONENT desktop)
  install(CODE "execute_process(COMMAND gzip -9nc \"${PROJECT_SOURCE_DIR}/app/desktop/trigpoint-desktop.1\"
                                OUTPUT_FILE \"${PROJECT_BINARY_DIR}/trigpoint-desktop.1.gz\" COMMAND_ERROR_IS_FATAL ANY)"
          COMPONENT desktop)
  install(FILES ${PROJECT_BINARY_DIR}/trigpoint-desktop.1.gz DESTINATION share/man/man1 COMPONENT desktop)
endif()
install(FILES ${PROJECT_SOURCE_DIR}/NOTICE ${PROJECT_SOURCE_DIR}/README.md DESTINATION share/doc/trigpoint)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/ DESTINATION share/doc/trigpoint/docs)
