#pragma once
// Holds what the command line asks for, as data: one struct a command.

#include <optional>
#include <string>
#include <vector>

#include "analysis/blind/blind_cases.h"
#include "analysis/description/description.h"
#include "analysis/diagnosis/diagnosis.h"
#include "analysis/experiment/angle_recording.h"
#include "analysis/experiment/coast_down.h"
#include "analysis/experiment/laboratory_experiment.h"
#include "analysis/motion_capture/collision_finder.h"
#include "analysis/paper/paper_study.h"
#include "analysis/sensitivity/propagation.h"
#include "analysis/sensitivity/sweep.h"
#include "analysis/study/metastability.h"
#include "analysis/study/setting.h"
#include "reports/study/study_progress.h"

namespace metastable::reports {

/// Asks for `metastable steps`.
struct StepsRequest {
  analysis::Setting setting;
  analysis::StudyOptions study;
  std::string json;      ///< file, "-" for standard output, "" for none
  std::string command;   ///< the command line, for provenance
  bool certify = false;  ///< guaranteed bounds as well
  bool explain = false;  ///< what the words mean at length
  bool sensitivities = false;
  bool how_it_fails = false;
  std::vector<analysis::StandardError> standard_errors = {};  ///< propagated to the expected steps
  bool rigid_bodies = false;             ///< what the law `settled` gives as well: no law was named
  double time_limit = usual_time_limit;  ///< [s]
};

/// Asks for `metastable compare`.
struct CompareRequest {
  std::vector<analysis::Setting> settings;  ///< the others are compared with the first
  analysis::StudyOptions study;
  int collisions = 16;  ///< of a measured trial
  std::string json;
  std::string command;
  std::vector<analysis::StandardError> standard_errors = {};  ///< propagated to expected steps and ratios
  bool rigid_bodies = false;                                  ///< as of StepsRequest
};

/// Asks for `metastable sweep`.
struct SweepRequest {
  analysis::Setting setting;
  std::vector<analysis::SweepAxis> axes;
  analysis::StudyOptions study;
  std::string out = "sweep.csv";  ///< the figure goes beside it, with the ending .svg
  std::string command;
  std::string json = {};                    ///< as of StepsRequest
  const struct Sharing* sharing = nullptr;  ///< with other processes
  bool rigid_bodies = false;                ///< as of StepsRequest
};

/// Asks for `metastable simulate`.
struct SimulateRequest {
  analysis::Setting setting;
  int trials = 50;
  int collisions = 16;
  std::uint64_t seed = 1;
  int threads = 0;
  std::string out;  ///< folder
  std::string command;
  std::optional<analysis::CameraOptions> camera = {};  ///< given: angle.csv too
  bool stand_in = false;  ///< the paper's three conditions instead of `trials` of one (analysis/experiment/stand_in.h)
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable simulate --reality`.
struct LaboratoryRequest {
  std::vector<analysis::LaboratoryCondition> conditions;
  analysis::LaboratoryOptions reality;
  std::vector<std::string> dropped;
  std::optional<analysis::CameraOptions> camera;
  std::string out;
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable collisions`.
struct CollisionsRequest {
  std::string folder;
  analysis::FinderOptions finder;
  bool peak = false;  ///< omega_minus is the peak of the smoothed speed instead of the stance fit
  std::string out;    ///< file; "": collisions.csv in the folder, or collisions-from-angle.csv if that is there
  int threads = 0;
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable blind`.
struct BlindRequest {
  std::string folder;                 ///< of the run: cases, answers
  std::string sealed;                 ///< folder of the truths; "": beside the run, with "-sealed" added
  std::optional<std::uint64_t> seed;  ///< nothing: from the system's entropy
  analysis::BlindSize size;
  std::vector<std::string> tool;  ///< program that answers, with its first arguments; none: this one
  int threads = 0;
  std::string out;  ///< of open; "": report in the run's folder
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable coast-down`.
struct CoastDownRequest {
  std::vector<std::string> logs;
  analysis::CoastDownOptions options;
  bool linear = false;  ///< a term proportional to omega is fitted even where none is clearly there
  std::string nominal;  ///< folder whose [loss] is taken; "": fitted to the logs
  std::string blocks = "all";
  std::optional<double> rotor_inertia;
  bool accept_defects = false;  ///< of which every verdict then speaks
  std::string out;
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable describe`.
struct DescribeRequest {
  std::string folder;
  std::string out;  ///< folder for tables, figures and the page; "": tables on the terminal only
  analysis::DescriptionOptions options;
  std::vector<dynamics::Law> against;  ///< laws to compare with
  int trials = 2000;                   ///< simulated trials of that comparison
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable study`.
struct StudyRequest {
  std::string data;  ///< experiment folder; "": the simulated stand-in
  std::string out = "study";
  analysis::PaperStudyOptions options;
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable diagnose`.
struct DiagnoseRequest {
  std::string folder;
  std::string json;  ///< file, "-" for standard output, "" for none
  std::string out;   ///< folder for page, figures and tables; "": none
  analysis::DiagnosisOptions options;
  std::string command;
};

/// Asks for `metastable lessons`.
struct LessonsRequest {
  std::vector<std::string> data;  ///< experiment folders to be diagnosed under each law
  std::string out = "lessons";
  analysis::DiagnosisOptions options;  ///< of every diagnosis; seed and threads also of the simulated trials
  int trials = 0;                      ///< simulated, of each condition; 0: as many as the paper has
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

/// Asks for `metastable effects`.
struct EffectsRequest {
  std::string json;  ///< as of DiagnoseRequest
};

/// Asks for `metastable report`.
struct ReportRequest {
  std::vector<analysis::Setting> settings;  ///< one a ramp
  analysis::StudyOptions study;
  int energy_trials = 1000;  ///< trials behind the energy-loss table
  int landings = 40000;      ///< rolled under `settled` for each cell of a map; 1.5 times as many a sensitivity's side
  std::string out = "report";
  std::string command;
  std::string json = {};  ///< as of StepsRequest
};

}  // namespace metastable::reports
