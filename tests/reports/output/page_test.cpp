#include "reports/output/page.h"

#include <gtest/gtest.h>

#include <exception>
#include <filesystem>
#include <iterator>
#include <regex>
#include <set>
#include <string>

#include "reports/output/figure.h"
#include "reports/output/page_folder.h"
#include "tests/reports/support.h"

namespace metastable::reports {
namespace {

Page sample_page() {
  const Figure figure{.id = "a", .title = "", .x = {"x"}, .y = {"y"}, .series = {{.x = {0, 1}, .y = {0, 1}}}};
  const std::string svg = render_svg(figure);
  const Table table{.id = "t", .title = "Numbers {{title}}", .columns = {{"x"}}, .rows = {{1}}};
  return {.title = "Report <1> & {{more}}",
          .lead = {"The answer & its interval."},
          .intro = {"First paragraph.", "Second."},
          .sections = {{.id = "one",
                        .heading = "A \"heading\"",
                        .reading = "Read it so.",
                        .figures = {{"a", svg, "Caption"}, {"b", svg, ""}},
                        .tables = {{table, {{"CSV", "tables/t.csv?a=1&b=2"}, {"LaTeX", "tables/t.tex"}}}},
                        .folded = {{"More <details>", {"A paragraph."}, {{"c", svg, ""}}, {}}}},
                       {.id = "two", .heading = "No figures", .reading = "Nothing here."}},
          .provenance = {"metastable report", "", 1, "0.1.0"}};
}

TEST(Page, HoldsEverything) {
  const std::string html = render_page(sample_page());
  for (const char* part :
       {"<!DOCTYPE html>", "<title>Report &lt;1&gt; &amp; {{more}}</title>", "<p>Second.</p>",
        "<p class=\"lead\">The answer &amp; its interval.</p>",
        "<details>\n<summary>More &lt;details&gt;</summary>\n<p>A paragraph.</p>", "<figure id=\"figure-c\">",
        "<a href=\"#two\">No figures</a>", "<section id=\"one\">", "A &quot;heading&quot;",
        "<p class=\"reading\">Read it so.</p>", "<figure id=\"figure-a\">", "<figcaption>Caption</figcaption>",
        "Numbers {{title}}", "<a href=\"tables/t.csv?a=1&amp;b=2\">CSV</a>", "<li>version: 0.1.0</li>", "</html>"}) {
    EXPECT_NE(html.find(part), std::string::npos) << part;
  }
}

TEST(Page, IdsAreUniqueAndLinksInsideResolve) {
  const std::string html = render_page(sample_page());
  std::set<std::string> ids;
  const std::regex id(R"( id=['"]([^'"]*)['"])");
  for (std::sregex_iterator match(html.begin(), html.end(), id), end; match != end; ++match) {
    EXPECT_TRUE(ids.insert((*match)[1]).second) << "twice: " << (*match)[1];
  }
  const std::regex link(R"(href=['"]#([^'"]*)['"])");
  for (std::sregex_iterator match(html.begin(), html.end(), link), end; match != end; ++match) {
    EXPECT_TRUE(ids.contains((*match)[1])) << "dangling: " << (*match)[1];
  }
}

TEST(Page, LoadsNothing) {
  const std::string html = render_page(sample_page());
  for (const char* part : {"<script", "src=", "@import", "<link"})
    EXPECT_EQ(html.find(part), std::string::npos) << part;
}

// Every grey and every colour of the palette follows the reader's scheme, and so does the ground; coloured cells keep
// their colours, and what is written on them too.
TEST(Page, FiguresTakeTheColoursOfThePage) {
  Figure figure{.id = "a", .title = "T", .x = {"x"}, .y = {"y"}};
  for (int colour = 0; colour < 7; ++colour) figure.series.push_back({.x = {0, 1}, .y = {0, 1}, .colour = colour});
  figure.reference_lines = {{.vertical = true, .at = 0.5, .label = "here"}};
  Figure map{.id = "m", .title = "T", .x = {"x"}, .y = {"y"}};
  map.heat_map = HeatMap{.x = {1, 2}, .y = {1}, .value = {{1, 9}}, .label = "steps"};
  Page page = sample_page();
  page.sections[0].figures = {{"a", render_svg(figure), ""}, {"m", render_svg(map), ""}};
  page.sections[0].folded.clear();
  const std::string html = render_page(page);
  const std::string curves = html.substr(html.find("figure-a"), html.find("figure-m") - html.find("figure-a")),
                    cells = html.substr(html.find("figure-m"));
  EXPECT_EQ(curves.find("rgb("), std::string::npos) << curves.substr(curves.find("rgb(") - 200, 300);
  EXPECT_EQ(curves.find("#ffffff"), std::string::npos);
  for (const char* name : {"--ink", "--axis", "--grid", "--mark", "--c0", "--c5"})
    EXPECT_NE(curves.find(std::string("var(") + name + ")"), std::string::npos) << name;
  EXPECT_NE(cells.find("rgb( 68,   1,  84)"), std::string::npos) << "the darkest cell";
  EXPECT_NE(cells.find("rgb(16,16,16)"), std::string::npos) << "letters on a light cell";
}

TEST(Page, TablesMayStandBesideFigures) {
  Page page = sample_page();
  EXPECT_EQ(render_page(page).find("<div class=\"beside\">"), std::string::npos);
  page.sections[0].arrangement = Arrangement::beside;
  EXPECT_NE(render_page(page).find("<div class=\"beside\">"), std::string::npos);
}

TEST(Page, RefusesWhatIsNoSvg) {
  Page page = sample_page();
  page.sections[0].figures[0].svg = "gnuplot: error";
  EXPECT_THROW(render_page(page), std::invalid_argument);
}

class PageFolderTest : public test::InFolder {
 protected:
  Figure figure_{.id = "a", .title = "", .x = {"x"}, .y = {"y"}, .series = {{.x = {0, 1}, .y = {0, 1}}}};
  Figure empty_{.id = "b", .title = "", .x = {"x"}, .y = {"y"}, .series = {{.x = {0, 1}, .y = {0}}}};
  Table table_{.id = "t", .title = "Numbers", .columns = {{"x"}}, .rows = {{1}}};
};

// A figure that could not be drawn left the tables before it behind.
TEST_F(PageFolderTest, IsWholeOrNotThere) {
  const std::filesystem::path target = folder_ / "deep" / "out";
  EXPECT_THROW(
      {
        PageFolder pages(target);
        pages.section("one", "One", "Read.", {figure_}, {table_});
        pages.section("two", "Two", "Read.", {empty_}, {});
      },
      std::exception);
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  for (int again = 0; again < 2; ++again) {
    PageFolder pages(target);
    pages.section("one", "One", "Read.", {figure_}, {table_});
    pages.write_index();
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(target.parent_path()), {}), 1);
    for (const char* file : {"index.html", "tables/t.csv", "figures/a.svg"})
      EXPECT_TRUE(std::filesystem::exists(target / file)) << file;
  }
}

}  // namespace
}  // namespace metastable::reports
