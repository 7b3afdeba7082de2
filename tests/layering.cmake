# Who may include whom, and which headers stay inside .cpp files.
#   cmake -D ROOT=<source tree> -P layering.cmake                    the tree's includes
#   cmake -D SELF_TEST=ON -D WORK_DIR=<empty folder> -P layering.cmake   that the check rejects what it should
cmake_minimum_required(VERSION 3.25)

set(FORBIDDEN_IN_dynamics "markov/|analysis/|reports/")
set(FORBIDDEN_IN_markov "dynamics/|analysis/|reports/")
set(FORBIDDEN_IN_analysis "reports/")
set(FORBIDDEN_IN_reports "tests/")
set(HEAVY "openssl/|Spectra/|suitesparse/|klu\\.h|nlohmann/|CLI/|toml\\+\\+/|toml\\.hpp|kainjow/")

# Lists in `result` every offending include under `root` as "file: header (reason)".
function(layering_violations root result)
  set(violations "")
  foreach(folder dynamics markov analysis reports)
    file(GLOB_RECURSE files RELATIVE ${root} ${root}/${folder}/*.h ${root}/${folder}/*.hpp ${root}/${folder}/*.cpp)
    foreach(file IN LISTS files)
      file(STRINGS ${root}/${file} lines REGEX "^[ \t]*#[ \t]*include[ \t]*[<\"]")
      foreach(line IN LISTS lines)
        string(REGEX REPLACE "^[^<\"]*[<\"]([^>\"]*)[>\"].*$" "\\1" header "${line}")
        string(REGEX REPLACE "^(\\.\\./)+|^metastable/" "" target "${header}")
        if(target MATCHES "^(${FORBIDDEN_IN_${folder}})")
          list(APPEND violations "${file}: ${header} (${folder}/ must not know it)")
        endif()
        if(target MATCHES "^(${HEAVY})" AND NOT file MATCHES "\\.cpp$")
          list(APPEND violations "${file}: ${header} (heavy, only in a .cpp file)")
        endif()
      endforeach()
    endforeach()
  endforeach()
  set(${result} "${violations}" PARENT_SCOPE)
endfunction()

if(NOT SELF_TEST)
  layering_violations(${ROOT} violations)
  if(violations)
    list(JOIN violations "\n  " text)
    message(FATAL_ERROR "includes against the layering:\n  ${text}")
  endif()
  return()
endif()

# Each sample: file, header, whether it is allowed.
set(samples
  "dynamics/a.cpp|markov/chain.h|no"      "dynamics/a.h|analysis/study.h|no"     "dynamics/a.cpp|reports/table.h|no"
  "markov/a.h|dynamics/wheel.h|no"        "markov/a.cpp|../dynamics/wheel.h|no"  "markov/a.cpp|metastable/analysis/study.h|no"
  "markov/a.h|reports/table.h|no"         "analysis/a.cpp|reports/table.h|no"    "reports/deep/a.h|kainjow/mustache.hpp|no"
  "markov/a.h|Spectra/GenEigsSolver.h|no" "markov/a.h|klu.h|no"                  "markov/a.h|suitesparse/klu.h|no"
  "reports/a.h|nlohmann/json.hpp|no"      "reports/a.h|CLI/CLI.hpp|no"           "analysis/a.h|toml++/toml.h|no"
  "markov/a.cpp|Spectra/GenEigsSolver.h|yes" "markov/a.cpp|klu.h|yes"            "markov/a.h|markov/chain.h|yes"
  "analysis/a.h|markov/chain.h|yes"       "analysis/a.h|dynamics/wheel.h|yes"    "reports/a.cpp|nlohmann/json.hpp|yes"
  "reports/a.h|analysis/study.h|yes"      "dynamics/a.h|vector|yes"              "dynamics/a.h|dynamics/wheel.h|yes")
foreach(sample IN LISTS samples)
  string(REPLACE "|" ";" sample "${sample}")
  list(GET sample 0 file)
  list(GET sample 1 header)
  list(GET sample 2 allowed)
  foreach(spelling "#include \"${header}\"" "  # include <${header}>  // note")
    file(REMOVE_RECURSE ${WORK_DIR})
    file(WRITE ${WORK_DIR}/${file} "#pragma once\n${spelling}\n")
    layering_violations(${WORK_DIR} violations)
    if(allowed STREQUAL yes AND violations)
      message(SEND_ERROR "wrongly rejected: ${file} with ${spelling}: ${violations}")
    elseif(allowed STREQUAL no AND NOT violations MATCHES "${file}")
      message(SEND_ERROR "not rejected: ${file} with ${spelling}")
    endif()
  endforeach()
endforeach()
file(REMOVE_RECURSE ${WORK_DIR})
