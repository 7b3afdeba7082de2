# Writes OUTPUT with METASTABLE_VERSION_TEXT: VERSION, plus the commit if SOURCE_DIR is the top of a git clone
# ("-dirty": with changes since). The file is touched only when the text changes.
cmake_minimum_required(VERSION 3.25)
set(text ${VERSION})
find_program(GIT git)
if(GIT)
  execute_process(COMMAND ${GIT} -C ${SOURCE_DIR} rev-parse --show-prefix
                  OUTPUT_VARIABLE prefix RESULT_VARIABLE status ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(status EQUAL 0 AND prefix STREQUAL "")
    execute_process(COMMAND ${GIT} -C ${SOURCE_DIR} describe --always --dirty --abbrev=10 "--exclude=*"
                    OUTPUT_VARIABLE commit RESULT_VARIABLE status ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(status EQUAL 0)
      string(APPEND text "+g${commit}")
    endif()
  endif()
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#define METASTABLE_VERSION_TEXT \"@text@\"\n" @ONLY)
