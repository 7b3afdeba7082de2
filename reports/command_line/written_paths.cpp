#include "reports/command_line/written_paths.h"

#include <fmt/format.h>

#include <cctype>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "reports/output/output_file.h"

namespace metastable::reports {
namespace fs = std::filesystem;
namespace {

struct NamedPath {
  std::string option;
  fs::path path;
  bool folder = false, written = false;
};

std::vector<NamedPath> paths_of(const Options& options, const std::string& config) {
  std::vector<NamedPath> paths;
  if (!config.empty()) paths.push_back({"--config", config});
  for (const std::string& name : options.names()) {
    const bool place = std::isupper(static_cast<unsigned char>(name.front())) != 0;
    const std::string value = place ? name : options.value(name);
    const bool folder = value == "DIR";
    if (!folder && !value.starts_with("FILE") && value != "LOG") continue;
    std::vector<std::string> texts = options.all(name);
    if (texts.empty() && !options.text(name).empty()) texts = {options.text(name)};  // a default
    for (const std::string& text : texts)
      paths.push_back({place ? name : "--" + name, text, folder, name == "json" || name == "out" || name == "export"});
  }
  return paths;
}

// Devices and pipes take what comes from everywhere, and so does standard output.
bool is_file(const NamedPath& one) {
  std::error_code error;
  return !one.folder && one.path != "-" && (!fs::exists(one.path, error) || fs::is_regular_file(one.path, error));
}

}  // namespace

void check_written_paths(const Options& options, const std::string& config) {
  const std::vector<NamedPath> paths = paths_of(options, config);
  for (const NamedPath& file : paths) {
    if (!file.written || !is_file(file)) continue;
    for (const NamedPath& other : paths) {
      if (&file == &other || (other.written && file.option != "--json")) continue;
      if (same_file(file.path, other.path))
        throw std::invalid_argument(fmt::format("{}: {} is what {} {} too", file.option, file.path.string(),
                                                other.option, other.written ? "writes" : "reads"));
      if (file.option == "--json" && other.folder && lies_in(file.path, other.path) && file.path.extension() != ".json")
        throw std::invalid_argument(
            fmt::format("--json: {} lies in the folder of {}, where its name must end in .json: it could replace "
                        "another file there",
                        file.path.string(), other.option));
    }
  }
}

}  // namespace metastable::reports
