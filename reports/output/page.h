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
  bool wide = false;    ///< keeps its size on a narrow screen, and scrolls there
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

/// Details that are shown when the reader opens them, under one line that says what they are.
struct FoldedPart {
  std::string summary;  ///< that line
  std::vector<std::string> texts = {};
  std::vector<PageFigure> figures = {};
  std::vector<PageTable> tables = {};
};

enum class Arrangement {
  stacked,  ///< figures above tables
  beside,   ///< tables to the left of the figures where the screen is wide enough, above them elsewhere
};

struct PageSection {
  std::string id;  ///< HTML anchor
  std::string heading;
  std::string reading;                   ///< what it says and how to read what follows
  std::vector<PageFigure> figures = {};  ///< side by side where the screen is wide enough
  std::vector<PageTable> tables = {};
  std::vector<FoldedPart> folded = {};  ///< below all else
  Arrangement arrangement = Arrangement::stacked;
};

struct Page {
  std::string title;
  std::vector<std::string> lead = {};   ///< the answer, in large letters: a sentence each
  std::vector<std::string> intro = {};  ///< paragraphs
  std::vector<PageSection> sections = {};
  Provenance provenance = {};
};

/// Renders the page as HTML: no script, nothing loaded from elsewhere, fit for a phone, a dark screen and for print;
/// the same bytes for the same page. Text is escaped. Figures take the page's colours: text and lines that render_svg()
/// draws in grey or black, and its palette, follow the reader's light or dark scheme. @throws std::invalid_argument for
/// a table that cannot be rendered (see table.h)
std::string render_page(const Page& page);

}  // namespace metastable::reports
