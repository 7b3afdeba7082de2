#pragma once
// Writes a page that grows section by section, with its tables and figures as files beside it.

#include <filesystem>
#include <string>
#include <vector>

#include "reports/output/answer.h"
#include "reports/output/figure.h"
#include "reports/output/output_file.h"
#include "reports/output/page.h"
#include "reports/output/table.h"

namespace metastable::reports {

/// Holds a FoldedPart as data.
struct Fold {
  std::string summary;
  std::vector<std::string> texts = {};
  std::vector<Figure> figures = {};
  std::vector<Table> tables = {};
};

/// Writes index.html, tables/<id>.csv, .md and .tex, figures/<id>.svg in one folder, all of them or none: they are
/// there once the page is written. A folder that gets none is gone again.
class PageFolder {
 public:
  /// Creates the folder (those of tables and figures come with the first of them). @throws OutputError
  explicit PageFolder(const std::filesystem::path& folder) : made_(folder), folder_(folder) {}

  Page& page() { return page_; }  ///< for title, intro and provenance
  /// Adds a section, its tables and figures written beside the folder until the page is there. @throws as the
  /// renderings and write_file() do
  void section(const std::string& id, const std::string& heading, const std::string& reading,
               const std::vector<Figure>& figures, std::vector<Table> tables, std::vector<Fold> folded = {},
               Arrangement arrangement = Arrangement::stacked);
  /// Writes the page, with which everything takes its place. Call once.
  void write_index();
  /// Says where the page is; its tables and files go into the answer, which is finished.
  void finish(Answer& answer) const;

 private:
  std::vector<PageFigure> write(const std::vector<Figure>& figures);
  std::vector<PageTable> write(std::vector<Table> tables);

  FolderIfFilled made_;  // with its parents
  OutputFolder folder_;
  Page page_;
};

}  // namespace metastable::reports
