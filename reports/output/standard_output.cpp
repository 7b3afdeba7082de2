#include "reports/output/standard_output.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>

#include "reports/output/output_file.h"
#include "reports/output/text_table.h"

namespace metastable::reports {

void say_text(std::string_view text) {
  if (::isatty(STDOUT_FILENO) == 1)
    fmt::print("{}", fitted(text, terminal_width()));
  else
    fmt::print("{}", text);
}

void flush_standard_output() {
  errno = 0;
  const bool printed = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (!printed || !std::cout.flush())
    throw OutputError("standard output", errno != 0 ? std::strerror(errno) : "write error");
}

}  // namespace metastable::reports
