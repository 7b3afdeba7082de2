#pragma once
// Renders the index page of a report: one self-contained HTML file with its figures and tables inside.

#include <string>
#include <vector>

#include "reports/output/table.h"

namespace metastable::reports {

struct PageFigure {
  std::string id;       ///< as Figure::id; HTML anchor "figure-<id>"
  std::string svg;      ///< from render_svg()
  std::string caption;  ///< below the figure; "" for none
};

struct PageLink {
  std::string text;  ///< e.g. "CSV"
  std::string href;  ///< relative to the page, e.g. "tables/ramps.csv"
};

/// Holds a table and the files that hold it.
struct PageTable {
  Table table;
  std::vector<PageLink> files = {};
};

struct PageSection {
  std::string id;  ///< HTML anchor
  std::string heading;
  std::string reading;                   ///< one sentence: how to read what follows
  std::vector<PageFigure> figures = {};  ///< side by side where the screen is wide enough
  std::vector<PageTable> tables = {};
};

struct Page {
  std::string title;
  std::vector<std::string> intro = {};  ///< paragraphs
  std::vector<PageSection> sections = {};
  Provenance provenance = {};
};

/// Renders the page as HTML: no script, nothing loaded from elsewhere, fit for a phone and for print; the same bytes
/// for the same page. Text is escaped. @throws std::invalid_argument for a table that cannot be rendered (see table.h)
std::string render_page(const Page& page);

}  // namespace metastable::reports
