# Which room may include which, and which headers stay inside .cpp files.
#   cmake -D ROOT=<source tree> -P layering.cmake                    checks the tree's includes
#   cmake -D SELF_TEST=ON -D WORK_DIR=<empty folder> -P layering.cmake   checks that it rejects what it should
cmake_minimum_required(VERSION 3.25)

# Every room in the order of dependency, with the rooms it may include beside itself: only rooms further up.
set(ROOMS
  "markov:"
  "markov/chain: markov"
  "markov/passage: markov markov/chain"
  "markov/transition_rows: markov markov/chain markov/passage"
  "markov/mesh: markov markov/chain markov/transition_rows"
  "markov/splitting: markov markov/transition_rows markov/mesh"
  "markov/ranks: markov/chain markov/mesh"
  "dynamics/numerics:"
  "dynamics/catalogue:"
  "dynamics/wheel: dynamics/numerics"
  "dynamics/laboratory: dynamics/numerics dynamics/catalogue dynamics/wheel"
  "dynamics/step_density: dynamics/numerics dynamics/wheel"
  "dynamics/settled: dynamics/numerics dynamics/wheel dynamics/step_density"
  "dynamics/extended_wheel: dynamics/wheel dynamics/step_density dynamics/settled"
  "dynamics/return_map: dynamics/numerics dynamics/wheel dynamics/settled"
  "dynamics/bounds: dynamics/numerics dynamics/return_map"
  "dynamics/walkers:"
  "analysis/statistics: markov dynamics/numerics"
  "analysis/walkers: markov markov/passage markov/transition_rows markov/mesh markov/splitting dynamics/walkers analysis/statistics"
  "analysis/fitting: markov dynamics/numerics analysis/statistics"
  "analysis/gap: markov dynamics/numerics analysis/statistics analysis/fitting"
  "analysis/diagnosis: markov dynamics/numerics analysis/statistics analysis/fitting analysis/gap"
  "analysis/study: markov markov/chain markov/passage markov/transition_rows dynamics/numerics dynamics/wheel dynamics/settled dynamics/return_map dynamics/bounds analysis/statistics"
  "analysis/experiment: markov dynamics/catalogue dynamics/wheel dynamics/laboratory dynamics/extended_wheel dynamics/return_map analysis/statistics analysis/study"
  "analysis/description: markov dynamics/numerics dynamics/return_map analysis/statistics analysis/experiment"
  "analysis/wheel_model: dynamics/numerics dynamics/catalogue dynamics/wheel dynamics/step_density dynamics/settled dynamics/extended_wheel analysis/statistics analysis/fitting analysis/experiment"
  "analysis/drum_model: dynamics/numerics dynamics/catalogue analysis/statistics analysis/fitting analysis/experiment"
  "analysis/machine_model: markov/mesh dynamics/numerics analysis/statistics analysis/fitting"
  "analysis/walker_model: markov dynamics/numerics dynamics/catalogue dynamics/laboratory dynamics/walkers analysis/statistics analysis/walkers analysis/fitting analysis/diagnosis analysis/experiment analysis/machine_model"
  "analysis/experiment_model: analysis/fitting analysis/diagnosis analysis/experiment analysis/wheel_model analysis/drum_model"
  "analysis/blind: dynamics/numerics dynamics/catalogue analysis/statistics analysis/walkers analysis/fitting analysis/diagnosis analysis/experiment analysis/wheel_model analysis/machine_model analysis/walker_model"
  "analysis/motion_capture: markov dynamics/extended_wheel dynamics/return_map analysis/statistics analysis/experiment"
  "analysis/paper: markov dynamics/numerics dynamics/catalogue dynamics/settled dynamics/return_map analysis/statistics analysis/study analysis/experiment analysis/description"
  "analysis/sensitivity: markov markov/chain markov/passage markov/transition_rows dynamics/wheel dynamics/settled dynamics/return_map analysis/statistics analysis/study"
  "reports/output: analysis/statistics analysis/experiment"
  "reports/description: dynamics/wheel analysis/statistics analysis/description analysis/paper reports/output"
  "reports/diagnosis: dynamics/catalogue analysis/statistics analysis/diagnosis analysis/blind reports/output"
  "reports/study: markov/transition_rows dynamics/wheel analysis/statistics analysis/walkers analysis/study analysis/experiment analysis/paper analysis/sensitivity reports/output"
  "reports/import: analysis/experiment analysis/motion_capture analysis/walker_model reports/output"
  "reports/commands: markov markov/passage markov/mesh dynamics/wheel analysis/statistics analysis/walkers analysis/diagnosis analysis/study analysis/experiment analysis/description analysis/walker_model analysis/blind analysis/motion_capture analysis/paper analysis/sensitivity reports/output reports/study reports/import"
  "reports/experiment_commands: markov dynamics/catalogue dynamics/wheel analysis/statistics analysis/diagnosis analysis/study analysis/experiment analysis/description analysis/walker_model analysis/experiment_model analysis/blind analysis/motion_capture analysis/paper reports/output reports/description reports/diagnosis reports/study reports/import reports/commands"
  "reports/command_line: dynamics/catalogue dynamics/wheel analysis/study analysis/experiment analysis/wheel_model analysis/walker_model analysis/sensitivity reports/output reports/commands reports/experiment_commands"
  "reports/ranks: markov/mesh markov/ranks analysis/walkers reports/output reports/commands reports/command_line"
  "reports/python: markov markov/chain markov/passage markov/mesh analysis/walkers analysis/diagnosis analysis/study analysis/experiment analysis/machine_model analysis/walker_model analysis/experiment_model analysis/sensitivity reports/output reports/diagnosis reports/study reports/commands reports/experiment_commands reports/command_line")

# Where less than a whole room may be seen: who (a pattern of files), which room, which of its headers.
set(NARROW
  "reports/output/.*:analysis/experiment:csv_field.h"
  "analysis/experiment/.*:analysis/study:setting.h"
  "analysis/experiment/.*:dynamics/laboratory:laboratory.h"
  "analysis/experiment/(angle|coast|csv|experiment|input|stand|trial).*:dynamics/laboratory:"
  "analysis/walker_model/(walk_folder|walker_machine).*:dynamics/laboratory:"
  "analysis/(wheel|drum|experiment)_model/.*:analysis/fitting:transition_model.h"
  "analysis/experiment_model/.*:analysis/diagnosis:diagnosis.h"
  "analysis/(fitting|gap|diagnosis)/.*:dynamics/numerics:truncated_normal.h")

set(HEAVY "mpi\\.h|petsc|slepc|openssl/|Spectra/|suitesparse/|klu\\.h|matio\\.h|nlohmann/|CLI/|toml\\+\\+/|toml\\.hpp|kainjow/")

set(names "")
foreach(entry IN LISTS ROOMS)
  string(REGEX MATCH "^([^:]*): ?(.*)$" _ "${entry}")
  set(room ${CMAKE_MATCH_1})
  string(REPLACE " " ";" MAY_${room} "${CMAKE_MATCH_2}")
  foreach(seen IN LISTS MAY_${room})
    if(NOT seen IN_LIST names)
      message(FATAL_ERROR "layering: ${room} may not include ${seen}, which does not stand above it in the list of rooms")
    endif()
  endforeach()
  list(APPEND names ${room})
endforeach()

# Sets `result` to why `file` must not include `header`, or to nothing.
function(layering_fault file header result)
  get_filename_component(room ${file} DIRECTORY)
  string(REGEX REPLACE "^metastable/" "" target "${header}")
  set(fault "")
  if(header MATCHES "^\\.\\.?/")
    set(fault "paths are written from the top")
  elseif(target MATCHES "^(${HEAVY})" AND NOT file MATCHES "\\.cpp$")
    set(fault "heavy, only in a .cpp file")
  elseif(target MATCHES "^(markov|dynamics|analysis|reports|tests)/")
    get_filename_component(target_room ${target} DIRECTORY)
    get_filename_component(target_name ${target} NAME)
    if(NOT target_room STREQUAL room AND NOT target_room IN_LIST MAY_${room})
      set(fault "${room} must not know ${target_room}")
    endif()
    foreach(rule IN LISTS NARROW)
      string(REGEX MATCH "^([^:]*):([^:]*):([^:]*)$" _ "${rule}")
      set(who ${CMAKE_MATCH_1})
      set(narrowed ${CMAKE_MATCH_2})
      string(REPLACE " " ";" headers "${CMAKE_MATCH_3}")
      if(file MATCHES "^${who}$" AND target_room STREQUAL narrowed AND NOT target_name IN_LIST headers)
        set(fault "${file} sees of ${narrowed} no more than: ${headers}")
      endif()
    endforeach()
  endif()
  set(${result} "${fault}" PARENT_SCOPE)
endfunction()

# Lists in `result` every offending include under `root` as "file: header (reason)", and every file outside the rooms.
function(layering_violations root result)
  set(violations "")
  foreach(folder markov dynamics analysis reports)
    file(GLOB_RECURSE files RELATIVE ${root} ${root}/${folder}/*.[hi]* ${root}/${folder}/*.c[cpx]* ${root}/${folder}/*.t[cp]*)
    list(FILTER files INCLUDE REGEX "\\.(h|hh|hpp|hxx|inc|inl|ipp|tcc|tpp|cc|cpp|cxx)$")
    foreach(file IN LISTS files)
      get_filename_component(room ${file} DIRECTORY)
      if(NOT room IN_LIST names)
        list(APPEND violations "${file} (${room} is no room)")
        continue()
      endif()
      file(STRINGS ${root}/${file} lines REGEX "^[ \t]*#[ \t]*(include|import)")
      foreach(line IN LISTS lines)
        if(NOT line MATCHES "^[ \t]*#[ \t]*include[ \t]*[<\"]")
          list(APPEND violations "${file}: ${line} (spelled so that nothing can be told)")
          continue()
        endif()
        string(REGEX REPLACE "^[^<\"]*[<\"]([^>\"]*)[>\"].*$" "\\1" header "${line}")
        layering_fault(${file} ${header} fault)
        if(fault)
          list(APPEND violations "${file}: ${header} (${fault})")
        endif()
      endforeach()
    endforeach()
  endforeach()
  # Tests mirror the rooms; what several of them share stands at the root of their folder.
  file(GLOB_RECURSE files RELATIVE ${root}/tests ${root}/tests/*_test.cpp)
  foreach(file IN LISTS files)
    get_filename_component(room ${file} DIRECTORY)
    if(NOT room IN_LIST names)
      list(APPEND violations "tests/${file} (${room} is no room)")
    endif()
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
  # Folders.
  "dynamics/wheel/a.cpp|markov/chain/chain.h|no"       "dynamics/wheel/a.h|analysis/study/setting.h|no"
  "dynamics/wheel/a.cpp|reports/output/table.h|no"     "markov/chain/a.h|dynamics/wheel/wheel.h|no"
  "markov/chain/a.cpp|../../dynamics/wheel/wheel.h|no" "markov/transition_rows/a.cpp|metastable/analysis/study/setting.h|no"
  "analysis/diagnosis/a.cpp|../experiment/experiment.h|no" "markov/deep/a.ipp|vector|no"
  "markov/transition_rows/a.h|reports/output/table.h|no"          "analysis/study/a.cpp|reports/output/table.h|no"
  "reports/output/a.cpp|tests/reports/support.h|no"    "analysis/study/a.cpp|markov/transition_rows/draws.h|yes"
  # Rooms of one folder: only upwards in the list.
  "markov/parallel.h|markov/chain/chain.h|no"          "markov/chain/a.h|markov/passage/first_passage.h|no"
  "markov/passage/a.h|markov/transition_rows/draws.h|no"          "markov/transition_rows/a.h|markov/passage/first_passage.h|yes"
  "dynamics/wheel/a.h|dynamics/return_map/trials.h|no" "dynamics/laboratory/a.h|dynamics/return_map/trials.h|no"
  "dynamics/return_map/a.h|dynamics/bounds/interval.h|no" "dynamics/bounds/a.h|dynamics/return_map/trials.h|yes"
  "analysis/statistics/a.h|analysis/study/setting.h|no"   "analysis/study/a.h|analysis/statistics/estimate.h|yes"
  "analysis/study/a.h|analysis/experiment/experiment.h|no" "analysis/description/a.h|analysis/wheel_model/wheel_runs.h|no"
  "analysis/wheel_model/a.h|analysis/blind/blind_grade.h|no" "analysis/blind/a.h|analysis/wheel_model/wheel_runs.h|yes"
  "reports/output/a.h|reports/study/study_text.h|no"   "reports/study/a.h|reports/output/table.h|yes"
  "reports/commands/a.h|reports/command_line/cli.h|no" "reports/command_line/a.h|reports/commands/request.h|yes"
  # The narrower lines.
  "analysis/experiment/a.h|analysis/study/setting.h|yes"        "analysis/experiment/a.h|analysis/study/metastability.h|no"
  "analysis/experiment/laboratory_experiment.h|dynamics/laboratory/laboratory.h|yes" "analysis/experiment/experiment.cpp|dynamics/laboratory/laboratory.h|no"
  "analysis/experiment/laboratory_experiment.h|dynamics/laboratory/rolling_motion.h|no"
  "analysis/walker_model/walker_experiment.h|dynamics/laboratory/walker_laboratory.h|yes"
  "analysis/walker_model/walk_folder.cpp|dynamics/laboratory/walker_laboratory.h|no"
  "analysis/blind/a.cpp|dynamics/laboratory/laboratory.h|no"    "analysis/diagnosis/a.cpp|dynamics/laboratory/laboratory.h|no"
  "reports/commands/a.cpp|dynamics/laboratory/laboratory.h|no"  "analysis/wheel_model/a.h|analysis/fitting/transition_model.h|yes"
  "analysis/experiment_model/diagnose.h|analysis/diagnosis/diagnosis.h|yes"
  "analysis/wheel_model/a.h|analysis/diagnosis/diagnosis.h|no"   "analysis/diagnosis/a.h|dynamics/catalogue/effect_catalogue.h|no"
  "analysis/diagnosis/a.h|dynamics/numerics/truncated_normal.h|yes" "analysis/diagnosis/a.h|dynamics/extended_wheel/extended_wheel.h|no"
  "analysis/diagnosis/a.h|analysis/experiment/experiment.h|no"
  # Nothing outside the rooms.
  "dynamics/a.h|vector|no"          "analysis/a.cpp|vector|no"       "markov/deep/a.h|vector|no"
  "tests/markov/a_test.cpp|vector|yes" "tests/analysis/a_test.cpp|vector|no"
  "tests/analysis/study/a_test.cpp|dynamics/laboratory/laboratory.h|yes"
  # Heavy headers.
  "reports/output/a.h|kainjow/mustache.hpp|no"         "markov/chain/a.h|Spectra/GenEigsSolver.h|no"
  "markov/mesh/a.cpp|markov/ranks/ranks.h|no"          "markov/ranks/ranks.h|mpi.h|no"
  "markov/ranks/a.h|slepceps.h|no"                     "markov/ranks/a.cpp|petscmat.h|yes"
  "markov/chain/a.h|klu.h|no"                          "markov/chain/a.h|suitesparse/klu.h|no"
  "reports/output/a.h|nlohmann/json.hpp|no"            "reports/command_line/a.h|CLI/CLI.hpp|no"
  "analysis/experiment/a.h|toml++/toml.h|no"           "markov/chain/a.cpp|Spectra/GenEigsSolver.h|yes"
  "markov/chain/a.cpp|klu.h|yes"                       "reports/study/a.cpp|nlohmann/json.hpp|yes"
  "dynamics/wheel/a.h|vector|yes"                      "dynamics/wheel/a.h|dynamics/wheel/wheel.h|yes")
foreach(sample IN LISTS samples)
  string(REPLACE "|" ";" sample "${sample}")
  list(GET sample 0 file)
  list(GET sample 1 header)
  list(GET sample 2 allowed)
  set(spellings "#include \"${header}\"" "  # include <${header}>  // note")
  if(allowed STREQUAL no)
    list(APPEND spellings "#include /**/ \"${header}\"" "#include_next <${header}>" "#import \"${header}\"")
  endif()
  foreach(spelling IN LISTS spellings)
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
