#include "reports/output/page_folder.h"

#include <utility>

namespace metastable::reports {

namespace {

constexpr int readable_width = 640;  // [px] beyond it a figure's letters are too small for a narrow screen

}  // namespace

std::vector<PageFigure> PageFolder::write(const std::vector<Figure>& figures) {
  if (!figures.empty()) make_folder(folder_.path() / "figures");
  std::vector<PageFigure> written;
  for (const Figure& figure : figures) {
    const std::string svg = render_svg(figure);
    write_file(folder_.path() / "figures" / (figure.id + ".svg"), svg);
    written.push_back({figure.id, svg, "", figure.width > readable_width});
  }
  return written;
}

std::vector<PageTable> PageFolder::write(std::vector<Table> tables) {
  if (!tables.empty()) make_folder(folder_.path() / "tables");
  std::vector<PageTable> written;
  for (Table& table : tables) {
    const std::filesystem::path stem = folder_.path() / "tables" / table.id;
    write_file(stem.string() + ".csv", to_csv(table));
    write_file(stem.string() + ".md", to_markdown(table));
    write_file(stem.string() + ".tex", to_latex(table));
    const std::string href = "tables/" + table.id;
    written.push_back(
        {std::move(table), {{"CSV", href + ".csv"}, {"Markdown", href + ".md"}, {"LaTeX", href + ".tex"}}});
  }
  return written;
}

void PageFolder::section(const std::string& id, const std::string& heading, const std::string& reading,
                         const std::vector<Figure>& figures, std::vector<Table> tables, std::vector<Fold> folded,
                         Arrangement arrangement) {
  PageSection section{id, heading, reading, write(figures), write(std::move(tables)), {}, arrangement};
  for (Fold& fold : folded)
    section.folded.push_back(
        {std::move(fold.summary), std::move(fold.texts), write(fold.figures), write(std::move(fold.tables))});
  page_.sections.push_back(std::move(section));
}

void PageFolder::write_index() {
  write_file(folder_.path() / "index.html", render_page(page_));
  folder_.commit("index.html");
}

void PageFolder::finish(Answer& answer) const {
  const std::string index = (made_.path() / "index.html").string();
  answer.say("{}", index);
  answer.file(index);
  const auto tell = [&](const std::vector<PageFigure>& figures, const std::vector<PageTable>& tables) {
    for (const PageFigure& figure : figures) answer.file((made_.path() / "figures" / (figure.id + ".svg")).string());
    for (const PageTable& table : tables) {
      for (const PageLink& link : table.files) answer.file((made_.path() / link.href).string());
      answer.table(table.table);
    }
  };
  for (const PageSection& section : page_.sections) {
    tell(section.figures, section.tables);
    for (const FoldedPart& part : section.folded) tell(part.figures, part.tables);
  }
  answer.finish(page_.provenance);
}

}  // namespace metastable::reports
