#pragma once
// Standard output at the program's end.

namespace metastable::reports {

/// Sees to it that all that was printed has been written. @throws OutputError
void flush_standard_output();

}  // namespace metastable::reports
