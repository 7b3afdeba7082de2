#pragma once
// metastable import makes an experiment folder of a CSV or MAT file.

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/study/setting.h"
#include "analysis/walker_model/walk_folder.h"
#include "reports/import/column_map.h"
#include "reports/import/csv_form.h"
#include "reports/import/mat_rows.h"

namespace metastable::reports {

/// Holds what `metastable import` is asked.
struct ImportRequest {
  std::string file, out;
  std::string json;  ///< file, "-" for standard output, "" for none
  std::string command;
  Subject subject = Subject::wheel;
  std::vector<RequestedColumn> columns;
  AskedForm form = {};  ///< of a CSV
  TrialsIn orientation = TrialsIn::not_told;
  bool number_trials = false;
  int collisions_from = 1, legs_from = 0;
  std::map<std::string, std::string> outcomes;  ///< the file's words, and what they stand for

  std::string description;         ///< an experiment.toml to take; "": from what follows
  analysis::Setting setting = {};  ///< wheel, contact, ramp; its slope is of all conditions but those of `slopes`
  std::vector<std::pair<std::string, double>> slopes = {};  ///< id and slope [deg] of each condition
  bool first_leg_stated = false;                            ///< whether somebody stated setting.first_landing_leg
  std::optional<double> sensor_noise = {};                  ///< [rad/s]
  std::optional<analysis::WalkerSetting> walker = {};  ///< of walks, where no description is given, instead of these
  std::vector<std::pair<Role, double>> errors = {};    ///< sds of measured values of walks [rad, rad/s]
  std::string title;
};

/// @throws std::invalid_argument and analysis::InputError naming file, line or variable
void run_import(const ImportRequest& request);

}  // namespace metastable::reports
