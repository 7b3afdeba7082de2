#include "reports/output/version.h"

#include "version_text.h"

namespace metastable::reports {

std::string version() { return METASTABLE_VERSION_TEXT; }

std::string version_text() {
  return "metastable " + version() + "\nbuilt by " METASTABLE_COMPILER "\nwith " METASTABLE_LIBRARIES;
}

}  // namespace metastable::reports
