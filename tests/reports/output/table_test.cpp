#include "reports/output/table.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>
#include <locale>
#include <string>

#include "tests/message_of.h"

namespace metastable::reports {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan_value = std::numeric_limits<double>::quiet_NaN();

Table sample() {
  return {.id = "ramps",
          .title = "Expected steps, 95 % interval",
          .notes = {"First step counted."},
          .columns = {{"law"},
                      {"slope", "deg", NumberFormat::general, 4},
                      {"steps", "", NumberFormat::significant, 3},
                      {"cells"}},
          .rows = {{"published", 7.02, Estimate{1234567.0, 1.2e6, 1.3e6}, 200},
                   {"coulomb, \"smooth\"", 9.59, Infinite{}, -400}},
          .provenance = {"metastable report", "law = published\ncells = 200", 1, "0.1.0"}};
}

TEST(Table, CsvHasProvenanceFullPrecisionAndIntervalColumns) {
  EXPECT_EQ(to_csv(sample()),
            "# Expected steps, 95 % interval\n"
            "# First step counted.\n"
            "# command: metastable report\n"
            "# settings: law = published\n"
            "# settings: cells = 200\n"
            "# seed: 1\n"
            "# version: 0.1.0\n"
            "law,slope [deg],steps,steps low95,steps high95,cells\n"
            "published,7.02,1234567,1200000,1300000,200\n"
            "\"coulomb, \"\"smooth\"\"\",9.59,infinite,,,-400\n");
}

TEST(Table, IntervalsOfAnotherLevelAndNumbersThatSayNothing) {
  const Table table{.id = "t",
                    .title = "T",
                    .columns = {{.name = "closed (90 %)", .level = 90}, {"p", "", NumberFormat::p_value, 2}},
                    .rows = {{Estimate{0.97, 0.93, 1.01}, 0.031},
                             {NotShown{{1.37, -1.41, 1.42}, "not known: wider than 1 & the gap"}, 1e-23}}};
  EXPECT_EQ(to_csv(table),
            "# T\nclosed (90 %),closed (90 %) low90,closed (90 %) high90,p\n"
            "0.97,0.93,1.01,0.031\n1.37,-1.41,1.42,1e-23\n");
  EXPECT_NE(
      to_markdown(table).find("| 0.97 (0.93 to 1.01) | 0.031 |\n| not known: wider than 1 & the gap | &lt; 10⁻¹² |"),
      std::string::npos)
      << to_markdown(table);
  EXPECT_NE(
      to_html(table).find("<td class=\"said\" data-label=\"closed (90 %)\">not known: wider than 1 &amp; the gap</td>"
                          "<td data-label=\"p\">&lt; 10⁻¹²</td>"),
      std::string::npos)
      << to_html(table);
  EXPECT_NE(to_latex(table).find("not known: wider than 1 \\& the gap & $< 10^{-12}$ \\\\"), std::string::npos)
      << to_latex(table);
}

TEST(Table, HtmlGivesLongTextAWideColumn) {
  const Table table{.id = "t",
                    .title = "T",
                    .columns = {{"where"}, {"claim"}},
                    .rows = {{"Fig. 4", std::string(61, 'x')}, {"Fig. 6", "short"}}};
  const std::string html = to_html(table);
  EXPECT_NE(html.find("<td class=\"text\" data-label=\"where\">Fig. 6</td>"
                      "<td class=\"text long\" data-label=\"claim\">short</td>"),
            std::string::npos)
      << html;
}

TEST(Table, HtmlPutsIntervalsBelowTheirNumbersAndNothingElse) {
  const Table table{.id = "t",
                    .title = "T",
                    .columns = {{"steps", "1"}, {"text"}},
                    .rows = {{Estimate{6.41, 6.36, 6.54}, "as (it) is"}}};
  EXPECT_NE(to_html(table).find("<td data-label=\"steps [1]\">6.41 <span class=\"interval\">(6.36 to 6.54)</span></td>"
                                "<td class=\"text\" data-label=\"text\">as (it) is</td>"),
            std::string::npos)
      << to_html(table);
}

// On a narrow screen the rows of a small table become cards; a large one keeps its rows and scrolls.
TEST(Table, HtmlOfASmallTableTurnsIntoCards) {
  Table table{.id = "t", .title = "T", .columns = {{"a"}, {"b"}}, .rows = {{1, 2}}};
  EXPECT_NE(to_html(table).find("<table class=\"cards few\">"), std::string::npos);
  table.rows.resize(20, {1, 2});
  EXPECT_NE(to_html(table).find("<table class=\"cards\">"), std::string::npos);
  table.rows.resize(60, {1, 2});
  EXPECT_NE(to_html(table).find("<table class=\"rows\">"), std::string::npos);
}

TEST(Table, CsvNumbersReadBackExactly) {
  for (const double value : {0.1, 1.0 / 3, 6.02214076e23, 5e-324, -1.7976931348623157e308}) {
    Table table{.id = "t", .title = "t", .columns = {{"x"}}, .rows = {{value}}};
    const std::string csv = to_csv(table);
    EXPECT_EQ(std::strtod(csv.c_str() + csv.find("x\n") + 2, nullptr), value);
  }
}

TEST(Table, CsvQuotesWhatCouldBeMisread) {
  Table table{.id = "t",
              .title = "two\nlines",
              .columns = {{"a,b"}},
              .rows = {{"# no comment"}, {"line\nbreak"}, {"=1+1"}, {""}}};
  EXPECT_EQ(to_csv(table), "# two\n# lines\n\"a,b\"\n\"# no comment\"\n\"line\nbreak\"\n'=1+1\n\n");
}

TEST(Table, Markdown) {
  EXPECT_EQ(to_markdown(sample()),
            "**Expected steps, 95 % interval**\n\n"
            "| law | slope \\[deg\\] | steps | cells |\n"
            "| :-- | --: | --: | --: |\n"
            "| published | 7.02 | 1.23×10⁶ (1.20×10⁶ to 1.30×10⁶) | 200 |\n"
            "| coulomb, \"smooth\" | 9.59 | infinite | −400 |\n"
            "\nFirst step counted.\n"
            "\n- command: metastable report\n- settings: law = published\n- settings: cells = 200\n- seed: 1\n"
            "- version: 0.1.0\n");
}

TEST(Table, MarkdownEscapesItsMarks) {
  Table table{.id = "t", .title = "a_b*c*", .columns = {{"x|y"}}, .rows = {{"`<b>`\nz"}}};
  const std::string text = to_markdown(table);
  EXPECT_TRUE(text.starts_with("**a\\_b\\*c\\***\n"));
  EXPECT_NE(text.find("| x\\|y |"), std::string::npos);
  EXPECT_NE(text.find("| \\`&lt;b>\\`<br>z |"), std::string::npos);
}

TEST(Table, Latex) {
  EXPECT_EQ(
      to_latex(sample()),
      "% Needs \\usepackage{booktabs}.\n"
      "% command: metastable report\n"
      "% settings: law = published\n"
      "% settings: cells = 200\n"
      "% seed: 1\n"
      "% version: 0.1.0\n"
      "\\begin{table}[htbp]\n\\centering\\small\n"
      "\\caption{Expected steps, 95 \\% interval}\n\\label{tab:ramps}\n"
      "\\begin{tabular}{lrrr}\n\\toprule\n"
      "{law} & \\begin{tabular}[b]{@{}r@{}}slope\\\\{}[deg]\\end{tabular} & {steps} & {cells} \\\\\n\\midrule\n"
      "published & 7.02 & $1.23 \\times 10^{6}$ ($1.20 \\times 10^{6}$ to $1.30 \\times 10^{6}$) & 200 \\\\\n"
      "coulomb, ''smooth'' & 9.59 & infinite & $-$400 \\\\\n"
      "\\bottomrule\n\\end{tabular}\n\n\\medskip\n\\noindent\\begin{minipage}{\\linewidth}\\footnotesize\n"
      "First step counted.\\par\n"
      "command: metastable report\\par\nsettings: law = published\\par\nsettings: cells = 200\\par\nseed: 1\\par\n"
      "version: 0.1.0\\par\n"
      "\\end{minipage}\n\\end{table}\n");
}

// Long tables break over pages, long text over lines, long headings too.
TEST(Table, LatexFitsThePage) {
  Table table{.id = "t", .title = "T", .columns = {{"cause"}, {"observed, low 90 %"}}};
  const std::string name = "speed_dependent_restitution+leg_contact";
  for (int k = 0; k < 21; ++k) table.rows.push_back({name, 1.5});
  const std::string latex = to_latex(table);
  EXPECT_TRUE(latex.starts_with("% Needs \\usepackage{booktabs,array,longtable}.\n")) << latex;
  EXPECT_NE(latex.find("\\begin{longtable}{>{\\raggedright\\arraybackslash}p{0.3\\linewidth}r}"), std::string::npos);
  EXPECT_NE(latex.find("observed,\\\\{}low 90 \\%"), std::string::npos) << latex;
  EXPECT_NE(latex.find("speed\\_\\allowbreak{}dependent\\_\\allowbreak{}restitution+\\allowbreak{}leg"),
            std::string::npos);
  EXPECT_NE(latex.find("\\endhead\n"), std::string::npos);
  EXPECT_EQ(latex.find("{tabular}{"), std::string::npos);
  table.rows.resize(20);
  EXPECT_NE(to_latex(table).find("\\begin{tabular}{>{"), std::string::npos);
}

TEST(Table, LatexEscapesSpecialsAndGreek) {
  const auto title = [](const std::string& text) {
    const std::string latex = to_latex({.id = "t", .title = text, .columns = {{"x"}}});
    const std::size_t from = latex.find("\\caption{") + 9;
    return latex.substr(from, latex.find("}\n\\label") - from);
  };
  EXPECT_EQ(title("a_b & 5 % of $1 #2 {x} ~ ^ \\"),
            "a\\_b \\& 5 \\% of \\$1 \\#2 \\{x\\} \\textasciitilde{} \\textasciicircum{} \\textbackslash{}");
  EXPECT_EQ(title("ω² [rad²/s²]"), "$\\omega^{2}$ [rad$^{2}$/s$^{2}$]");
  EXPECT_EQ(title("s⁻¹²"), "s$^{-12}$");
  EXPECT_EQ(title("λ₁²"), "$\\lambda_{1}{}^{2}$");
  EXPECT_EQ(title("$η"), "\\$$\\eta$");
  EXPECT_EQ(title("--seed"), "-{}-seed");
}

TEST(Table, HtmlIsEscaped) {
  Table table{.id = "t", .title = "a < b & c", .columns = {{"<x>", "\"u\""}}, .rows = {{"<script>'"}}};
  const std::string html = to_html(table);
  EXPECT_EQ(html.find("<script>"), std::string::npos);
  EXPECT_NE(html.find("&lt;script&gt;&#39;"), std::string::npos);
  EXPECT_NE(html.find("a &lt; b &amp; c"), std::string::npos);
  EXPECT_NE(html.find("[&quot;u&quot;]"), std::string::npos);
}

TEST(Table, RefusesNanAndRaggedRows) {
  const auto message = [](const Table& table) -> std::string { return message_of([&] { to_markdown(table); }); };
  Table table{.id = "t", .title = "t", .columns = {{"x"}, {"y"}}, .rows = {{1.0, 2.0}, {1.0, nan_value}}};
  EXPECT_EQ(message(table), "table 't', row 2, column 'y': not a number (NaN)");
  table.rows = {{1.0, Estimate{1, nan_value, 2}}};
  EXPECT_EQ(message(table), "table 't', row 1, column 'y': not a number (NaN)");
  table.rows = {{1.0}};
  EXPECT_EQ(message(table), "table 't', row 1: 1 cells for 2 columns");
}

TEST(FormatNumber, SignificantDigits) {
  constexpr auto format = NumberFormat::significant;
  EXPECT_EQ(format_number(7.02, format, 4), "7.020");
  EXPECT_EQ(format_number(12345, format, 3), "12300");
  EXPECT_EQ(format_number(99999, format, 3), "1.00×10⁵");
  EXPECT_EQ(format_number(0.00123456, format, 3), "0.00123");
  EXPECT_EQ(format_number(0.000123456, format, 3), "1.23×10⁻⁴");
  EXPECT_EQ(format_number(9.9996, format, 4), "10.00");
  EXPECT_EQ(format_number(0, format, 3), "0");
  EXPECT_EQ(format_number(-0.0, format, 3), "0");
  EXPECT_EQ(format_number(-1.5, format, 2), "−1.5");
  EXPECT_EQ(format_number(1e-300, format, 1), "1×10⁻³⁰⁰");
}

TEST(FormatNumber, GeneralAndFixed) {
  EXPECT_EQ(format_number(7.02, NumberFormat::general, 6), "7.02");
  EXPECT_EQ(format_number(100, NumberFormat::general, 6), "100");
  EXPECT_EQ(format_number(2e7, NumberFormat::general, 6), "2×10⁷");
  EXPECT_EQ(format_number(0.05, NumberFormat::fixed, 2), "0.05");
  EXPECT_EQ(format_number(-0.001, NumberFormat::fixed, 2), "0.00");
  EXPECT_EQ(format_number(infinity, NumberFormat::fixed, 2), "infinite");
  EXPECT_THROW(format_number(nan_value, NumberFormat::fixed, 2), std::invalid_argument);
}

/// A locale with decimal commas and grouped thousands, without one being installed.
struct CommaNumbers : std::numpunct<char> {
  char do_decimal_point() const override { return ','; }
  char do_thousands_sep() const override { return '.'; }
  std::string do_grouping() const override { return "\3"; }
};

TEST(Table, TheLocaleChangesNothing) {
  const std::string csv = to_csv(sample()), markdown = to_markdown(sample()), latex = to_latex(sample());
  const std::locale before = std::locale::global(std::locale(std::locale::classic(), new CommaNumbers));
  EXPECT_EQ(to_csv(sample()), csv);
  EXPECT_EQ(to_markdown(sample()), markdown);
  EXPECT_EQ(to_latex(sample()), latex);
  std::locale::global(before);
}

TEST(Provenance, OneLineForEachPart) {
  EXPECT_EQ(provenance_lines({"a\nb", "c\n\nd\n", 7, "1.0"}),
            (std::vector<std::string>{"command: a b", "settings: c", "settings: d", "seed: 7", "version: 1.0"}));
}

}  // namespace
}  // namespace metastable::reports
