#include "reports/output/figure.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "reports/output/interrupt.h"
#include "tests/message_of.h"
#include "tests/own_folder.h"

namespace metastable::reports {
namespace {

Figure sample_figure() {
  return {
      .id = "map",
      .title = "It's <a> \"map\" `date` $x_1^2$",
      .x = {"ω²", "rad²/s²"},
      .y = {"speed", "rad/s"},
      .series = {{.label = "mean", .x = {0, 1, 2}, .y = {0, 1.5, 1}},
                 {.label = "interval", .style = Style::band, .x = {0, 1, 2}, .lower = {0, 1, 0}, .upper = {1, 2, 2}}},
      .provenance = {"metastable report --a <b>", "", 3, "0.1.0"}};
}

HeatMap sample_map() {
  return {.x = {0.05, 0.1},
          .y = {0.2, 0.3},
          .value = {{10, 1e9}, {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN()}},
          .label = "steps",
          .logarithmic = true};
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

std::string error_of(const Figure& figure) {
  return message_of([&] { gnuplot_script(figure); });
}

TEST(Figure, SvgIsWholeAndCarriesTitleAndProvenance) {
  const std::string svg = render_svg(sample_figure());
  EXPECT_TRUE(svg.starts_with("<?xml"));
  EXPECT_TRUE(svg.ends_with("</svg>\n\n") || svg.ends_with("</svg>\n"));
  EXPECT_NE(svg.find("<title>It&#39;s &lt;a&gt; &quot;map&quot; `date` $x_1^2$</title>"), std::string::npos);
  EXPECT_NE(svg.find("<desc>command: metastable report --a &lt;b&gt;\nseed: 3\nversion: 0.1.0\n</desc>"),
            std::string::npos);
  EXPECT_NE(svg.find("ω² [rad²/s²]"), std::string::npos);
}

// gnuplot takes the label of a tick for a number format and a quote at a text's end for its own.
TEST(Figure, AnyTextIsALabel) {
  for (const std::string text : {"50%", "%d %s", "'quoted'", "'", "it's", "a\\b'", "`date`'", "@HOME $x", "x\"y'"}) {
    Figure bars{.id = "bars", .title = text, .x = {text}, .y = {text}};
    bars.bars = BarChart{.name = {text, "b"}, .value = {1, 2}};
    Figure map{.id = "map", .title = text, .x = {text}, .y = {text}, .heat_map = sample_map()};
    map.heat_map->label = text;
    map.heat_map->x_names = map.heat_map->y_names = {text, text + "2"};
    Figure lines = sample_figure();
    lines.title = lines.series[0].label = lines.x.label = text;
    lines.reference_lines = {{.vertical = true, .at = 1, .label = text}};
    for (const Figure& figure : {bars, map, lines}) {
      const std::string svg = render_svg(figure), shown = ">" + text + "<";
      EXPECT_GE(count(svg, shown), 2u) << figure.id << " " << shown;
    }
  }
}

TEST(Figure, TheSameFigureGivesTheSameBytes) {
  const std::string once = render_svg(sample_figure());
  setenv("GNUTERM", "dumb", 1);
  setenv("LC_ALL", "de_DE.UTF-8", 1);
  EXPECT_EQ(render_svg(sample_figure()), once);
  unsetenv("GNUTERM");
  unsetenv("LC_ALL");
}

TEST(Figure, EveryStyleDraws) {
  for (const Style style : {Style::line, Style::dashed, Style::points, Style::dots, Style::steps, Style::impulses,
                            Style::area, Style::band}) {
    Figure figure = sample_figure();
    figure.series = {{.label = "only", .style = style, .x = {1, 2, 3}, .y = {1, 4, 2}, .lower = {}, .upper = {}}};
    if (style == Style::band) {
      figure.series[0].lower = {1, 2, 1};
      figure.series[0].upper = {2, 4, 3};
    }
    figure.reference_lines = {{true, 1.5, "barrier"}, {false, 2, "one"}};
    figure.diagonal = Diagonal::yes;
    const std::string svg = render_svg(figure);
    EXPECT_NE(svg.find("only"), std::string::npos);
    EXPECT_NE(svg.find("barrier"), std::string::npos);
    EXPECT_EQ(svg.find("nan"), std::string::npos);
    figure.y.logarithmic = true;
    EXPECT_NE(render_svg(figure).find("only"), std::string::npos);
  }
}

TEST(Figure, PointsMayHaveBars) {
  Figure figure = sample_figure();
  figure.series = {{.style = Style::points, .x = {1, 2}, .y = {1, 2}, .lower = {0, 1}, .upper = {3, 3}}};
  EXPECT_NE(gnuplot_script(figure).find("yerrorbars"), std::string::npos);
  EXPECT_FALSE(render_svg(figure).empty());
}

TEST(Figure, ValuesThatAreNotFiniteLeaveAGap) {
  Figure figure = sample_figure();
  figure.series = {{.x = {0, 1, 2, 3, 4},
                    .y = {1, 2, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1}}};
  EXPECT_EQ(count(gnuplot_script(figure), "NaN"), 2u);
  EXPECT_FALSE(render_svg(figure).empty());
}

TEST(Figure, HeatMapMayHaveWordsOnItsScaleAndNoNumbers) {
  Figure figure{.id = "verdicts", .title = "", .x = {""}, .y = {""}, .heat_map = HeatMap{}};
  HeatMap& map = *figure.heat_map;
  map.x = {0}, map.y = {0, 1}, map.value = {{1}, {-1}};
  map.x_names = {"law"}, map.y_names = {"this", "that"};
  map.digits = 0, map.limit = 1;
  map.scale_names = {{-1, "reproduced"}, {1, "it's not"}};
  const std::string svg = render_svg(figure);
  EXPECT_EQ(count(svg, ">reproduced<"), 1u) << svg;
  EXPECT_EQ(count(svg, ">it's not<") + count(svg, ">it&#39;s not<") + count(svg, ">it&apos;s not<"), 1u) << svg;
  EXPECT_EQ(count(svg, ">1<") + count(svg, ">-1<") + count(svg, ">1.0<"), 0u) << svg;
}

TEST(Figure, HeatMapLabelsCells) {
  Figure figure{.id = "grid", .title = "", .x = {"sd of μ", ""}, .y = {"sd of η", ""}, .heat_map = sample_map()};
  const std::string svg = render_svg(figure);
  for (const char* label : {"10.0", "1.00×10⁹", "∞", "0.05", "steps"})
    EXPECT_NE(svg.find(label), std::string::npos) << label;
  figure.heat_map->value = {{5, 5}, {5, 5}};
  EXPECT_EQ(count(render_svg(figure), ">5.00<"), 4u);
  figure.heat_map->value = {{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()},
                            {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()}};
  EXPECT_EQ(count(render_svg(figure), "∞"), 4u);
}

TEST(Figure, HeatMapLabelsShrinkAndThenGo) {
  const auto script = [](std::size_t n) {
    HeatMap map{
        .x = std::vector<double>(n, 1.0), .y = {1.0}, .value = {std::vector<double>(n, 1.234e7)}, .label = "steps"};
    return gnuplot_script({.id = "grid", .title = "", .x = {}, .y = {}, .heat_map = map});
  };
  EXPECT_NE(script(4).find("1.23×10⁷"), std::string::npos);
  EXPECT_NE(script(4).find("labels noenhanced font ',14'"), std::string::npos);
  EXPECT_NE(script(12).find("\"1×10⁷\""), std::string::npos);
  EXPECT_EQ(script(40).find("with labels"), std::string::npos);
}

TEST(Figure, BadDataIsNamed) {
  Figure figure = sample_figure();
  figure.series[0].y.pop_back();
  EXPECT_EQ(error_of(figure), "figure 'map', series 1 ('mean'): x, y, lower and upper have 3, 2, 0 and 0 values");
  figure.series.clear();
  EXPECT_EQ(error_of(figure), "figure 'map' has no series");
  figure.heat_map = sample_map();
  figure.heat_map->value[0].pop_back();
  EXPECT_EQ(error_of(figure), "figure 'map', heat map: 1 cells in a row for 2 values of x");
  figure.heat_map->value[0] = {0, 1};
  EXPECT_EQ(error_of(figure), "figure 'map', heat map: 0 has no logarithm");
}

TEST(Figure, MissingGnuplotIsSaid) {
  const std::string path = std::getenv("PATH");
  setenv("PATH", "/nonexistent", 1);
  const std::string message = message_of<std::runtime_error>([&] { render_svg(sample_figure()); });
  setenv("PATH", path.c_str(), 1);
  EXPECT_EQ(message, "gnuplot, which draws the figures, was not found: install the package gnuplot-nox");
}

/// Puts a gnuplot on the PATH that starts another program and never ends; both are in the file `group`.
class HangingGnuplot : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "gnuplot") << "#!/bin/sh\nsleep 1000 &\necho $$ $! > " << (folder / "group").string()
                                      << "\nwait\n";
    std::filesystem::permissions(folder / "gnuplot", std::filesystem::perms::owner_all);
    setenv("PATH", (folder.string() + ":" + path).c_str(), 1);
  }
  void TearDown() override {
    setenv("PATH", path.c_str(), 1);
    std::filesystem::remove_all(folder);
  }
  /// Says whether neither runs any more; a zombie that waits for its parent does not.
  bool all_ended() const {
    for (int looks = 0; looks < 200; ++looks) {
      std::ifstream in(folder / "group");
      bool running = false;
      for (long id = 0; in >> id;) {
        std::ifstream status("/proc/" + std::to_string(id) + "/stat");
        std::string line;
        std::getline(status, line);
        running = running || (!line.empty() && line.find(") Z ") == std::string::npos);
      }
      if (!running) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }

  const std::string path = std::getenv("PATH");
  const std::filesystem::path folder = metastable::test::own_folder();
};

TEST_F(HangingGnuplot, IsEndedAtTheLimit) {
  const std::string message =
      message_of<std::runtime_error>([&] { render_svg(sample_figure(), std::chrono::milliseconds(300)); });
  EXPECT_EQ(message, "figure 'map' was not drawn: gnuplot did not end within 0.3 s and was ended");
  EXPECT_TRUE(all_ended());
}

TEST_F(HangingGnuplot, IsEndedByASignal) {
  catch_interrupts();
  std::thread signals([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    std::raise(SIGINT);
  });
  EXPECT_THROW(render_svg(sample_figure()), Interrupted);
  signals.join();
  clear_interrupt();
  EXPECT_TRUE(all_ended());
}

TEST(Figure, BarsAreNamedAndValuedTopDown) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  Figure figure{.id = "bars", .title = "", .x = {"p"}, .y = {""}};
  figure.bars =
      BarChart{.name = {"leg_contact", "none"}, .value = {0.5, -0.25}, .lower = {0.4, none}, .upper = {0.6, none}};
  const std::string script = gnuplot_script(figure);
  for (const char* part :
       {"0 0 0.5 0 0x0072B2", "-0.25 1 0 1 0x0072B2", "0.5 0 0.4 0.6\nEND", "'leg_contact' 0, 'none' 1"})
    EXPECT_NE(script.find(part), std::string::npos) << part << "\n" << script;
  const std::string svg = render_svg(figure);
  EXPECT_NE(svg.find("leg_contact"), std::string::npos);  // not taken for a subscript
  figure.bars->name[0] = "leg_contact+\ninertia";
  EXPECT_NE(gnuplot_script(figure).find("(\"leg_contact+\\ninertia\" 0,"), std::string::npos) << gnuplot_script(figure);
  figure.bars->value.pop_back();
  EXPECT_THROW(gnuplot_script(figure), std::invalid_argument);
}

TEST(Figure, HeatMapTakesNamesAndAScaleAroundZero) {
  Figure figure{.id = "named", .title = "", .x = {""}, .y = {""}};
  HeatMap map{
      .x = {0, 1}, .y = {0}, .value = {{-9, 0.25}}, .label = "score", .digits = 1, .format = NumberFormat::fixed};
  map.x_names = {"mean", "spread_2"};
  map.limit = 6;
  figure.heat_map = map;
  const std::string script = gnuplot_script(figure);
  for (const char* part : {"set cbrange [-6:6]", "'mean' 0, 'spread_2' 1", "\"−9.0\"", "\"0.2\""})
    EXPECT_NE(script.find(part), std::string::npos) << part << "\n" << script;
  figure.heat_map->x_names.pop_back();
  EXPECT_THROW(gnuplot_script(figure), std::invalid_argument);
}

}  // namespace
}  // namespace metastable::reports
