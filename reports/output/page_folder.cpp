#include "reports/output/page_folder.h"

#include <utility>

namespace metastable::reports {

void PageFolder::section(const std::string& id, const std::string& heading, const std::string& reading,
                         const std::vector<Figure>& figures, std::vector<Table> tables) {
  PageSection section{id, heading, reading, {}, {}};
  if (!figures.empty()) make_folder(folder_.path() / "figures");
  for (const Figure& figure : figures) {
    const std::string svg = render_svg(figure);
    write_file(folder_.path() / "figures" / (figure.id + ".svg"), svg);
    section.figures.push_back({figure.id, svg, ""});
  }
  if (!tables.empty()) make_folder(folder_.path() / "tables");
  for (Table& table : tables) {
    const std::filesystem::path stem = folder_.path() / "tables" / table.id;
    write_file(stem.string() + ".csv", to_csv(table));
    write_file(stem.string() + ".md", to_markdown(table));
    write_file(stem.string() + ".tex", to_latex(table));
    const std::string href = "tables/" + table.id;
    section.tables.push_back(
        {std::move(table), {{"CSV", href + ".csv"}, {"Markdown", href + ".md"}, {"LaTeX", href + ".tex"}}});
  }
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
  for (const PageSection& section : page_.sections) {
    for (const PageFigure& figure : section.figures)
      answer.file((made_.path() / "figures" / (figure.id + ".svg")).string());
    for (const PageTable& table : section.tables) {
      for (const PageLink& link : table.files) answer.file((made_.path() / link.href).string());
      answer.table(table.table);
    }
  }
  answer.finish(page_.provenance);
}

}  // namespace metastable::reports
