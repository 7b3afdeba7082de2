# Installs the build into a prefix of its own, then configures, builds and runs this folder's project against it.
# cmake -D BUILD_DIR=... -D WORK_DIR=... -D SOURCE_DIR=... -D CXX=... [-D FLAGS=...] [-D NO_PRECOMPILED=ON] -P test.cmake
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${WORK_DIR})
function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
endfunction()
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/prefix)
run(${CMAKE_COMMAND} -S ${SOURCE_DIR} -B ${WORK_DIR}/build -G Ninja -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_PREFIX_PATH=${WORK_DIR}/prefix -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${FLAGS}
    -DCMAKE_DISABLE_PRECOMPILE_HEADERS=${NO_PRECOMPILED})
run(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
run(${WORK_DIR}/build/consumer ${WORK_DIR}/experiment)

# The examples, the diagnosis of what the consumer simulated among them, print what their headers say.
foreach(example metastability diagnose return_map)
  execute_process(COMMAND ${WORK_DIR}/build/example_${example} ${WORK_DIR}/experiment OUTPUT_VARIABLE printed
                  COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
  file(READ ${WORK_DIR}/build/examples/${example}.prints said)
  if(NOT "\n${printed}" STREQUAL "${said}")
    message(FATAL_ERROR "example_${example} prints\n${printed}and its header says${said}")
  endif()
endforeach()

# The page on C++ shows the first of them.
file(READ ${SOURCE_DIR}/../../reports/site/cpp.md page)
file(READ ${WORK_DIR}/build/examples/metastability.cpp program)
string(FIND "${page}" "```cpp${program}```" at)
if(at EQUAL -1)
  message(FATAL_ERROR "reports/site/cpp.md does not show the program at the head of analysis/study/metastability.h")
endif()
