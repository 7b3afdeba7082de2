#include "reports/output/version.h"

#include "version_text.h"

namespace metastable::reports {

std::string version() { return METASTABLE_VERSION_TEXT; }

}  // namespace metastable::reports
