# trigpoint_library(NAME SOURCES a.cc b.cc [DEPS targets] [PRIVATE_DEPS targets]): one static library per folder, with the alias
# trigpoint::NAME, warnings as errors and include paths from the top of the tree.
set_property(GLOBAL PROPERTY GLOBAL_DEPENDS_NO_CYCLES ON)

add_library(trigpoint_warnings INTERFACE)
target_compile_options(trigpoint_warnings INTERFACE -Wall -Wextra -Wpedantic -Werror -Wshadow -Wno-missing-field-initializers)

function(trigpoint_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;PRIVATE_DEPS" ${ARGN})
  add_library(trigpoint_${name} STATIC ${ARG_SOURCES})
  add_library(trigpoint::${name} ALIAS trigpoint_${name})
  set_target_properties(trigpoint_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(trigpoint_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include/trigpoint>)
  target_link_libraries(trigpoint_${name} PUBLIC ${ARG_DEPS} PRIVATE $<BUILD_INTERFACE:trigpoint_warnings> ${ARG_PRIVATE_DEPS})
  install(TARGETS trigpoint_${name} EXPORT trigpoint COMPONENT dev)
endfunction()

# trigpoint_test(NAME SOURCES ... DEPS ... [LABEL unit|slow|e2e|gui] [TIMEOUT s]): one GoogleTest program = one ctest entry.
function(trigpoint_test name)
  cmake_parse_arguments(ARG "" "LABEL;TIMEOUT" "SOURCES;DEPS" ${ARGN})
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 600)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  # What a test computes itself is little: it is compiled sooner than it would run faster.
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O1>)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${ARG_DEPS} trigpoint_warnings GTest::gtest_main GTest::gmock)
  add_test(NAME ${name} COMMAND ${name} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(${name} PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT})
endfunction()
