#include "reports/output/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "analysis/experiment/csv_field.h"

namespace metastable::reports {
namespace {

constexpr std::string_view minus_sign = "−";
constexpr std::string_view infinite_word = "infinite";
constexpr std::size_t html_long = 60, html_some = 24;  // characters of a text that wants a wide column, a wider one
constexpr std::size_t html_few = 12;                   // cells that are shown in large letters, at most
constexpr std::size_t html_columns = 7;                // beyond, smaller type
constexpr std::size_t html_cards = 90;  // cells beyond which rows stay rows on a narrow screen, and scroll

std::string full_precision(double number) {
  if (std::isinf(number)) return number > 0 ? std::string(infinite_word) : "-" + std::string(infinite_word);
  std::array<char, 32> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number).ptr;
  return {buffer.data(), end};
}

bool has_nan(const Cell::Value& value) {
  if (const double* number = std::get_if<double>(&value)) return std::isnan(*number);
  const NotShown* hidden = std::get_if<NotShown>(&value);
  const Estimate* e = hidden ? &hidden->number : std::get_if<Estimate>(&value);
  return e && (std::isnan(e->value) || std::isnan(e->lower) || std::isnan(e->upper));
}

void validate(const Table& table) {
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    if (table.rows[i].size() != table.columns.size()) {
      throw std::invalid_argument(fmt::format("table '{}', row {}: {} cells for {} columns", table.id, i + 1,
                                              table.rows[i].size(), table.columns.size()));
    }
    for (std::size_t j = 0; j < table.columns.size(); ++j) {
      if (has_nan(table.rows[i][j].value())) {
        throw std::invalid_argument(
            fmt::format("table '{}', row {}, column '{}': not a number (NaN)", table.id, i + 1, table.columns[j].name));
      }
    }
  }
}

template <typename T>
bool column_has(const Table& table, std::size_t column) {
  return std::ranges::any_of(table.rows,
                             [&](const auto& row) { return std::holds_alternative<T>(row[column].value()); });
}

bool has_interval(const Table& table, std::size_t column) {
  return column_has<Estimate>(table, column) || std::ranges::any_of(table.rows, [&](const auto& row) {
           const NotShown* hidden = std::get_if<NotShown>(&row[column].value());
           return hidden && hidden->number.lower < hidden->number.upper;
         });
}

/// Text columns are set flush left, all others flush right.
bool is_text(const Table& table, std::size_t column) {
  return column_has<std::string>(table, column) && !column_has<double>(table, column) &&
         !column_has<std::int64_t>(table, column) && !column_has<Estimate>(table, column) &&
         !column_has<NotShown>(table, column);
}

std::string heading(const Column& column, std::string_view suffix = "") {
  std::string text = column.name + std::string(suffix);
  return column.unit.empty() ? text : text + " [" + column.unit + "]";
}

/// Writes a cell as people read it. `escape` is for text, `number` for a Decimal.
template <typename Escape, typename Number>
std::string show(const Cell& cell, const Column& column, Escape escape, Number number) {
  struct Visitor {
    const Column& column;
    Escape& escape;
    Number& number;
    std::string operator()(const std::string& text) const { return escape(text); }
    std::string operator()(std::int64_t whole) const {
      std::string text = fmt::format("{}", whole);
      if (whole < 0) text.replace(0, 1, minus_sign);
      return escape(text);
    }
    std::string operator()(double value) const { return number(to_decimal(value, column.format, column.digits)); }
    std::string operator()(const Estimate& estimate) const {
      const DecimalEstimate e = to_decimal(estimate, column.format, column.digits);
      return number(e.value) + " (" + number(e.lower) + escape(" to ") + number(e.upper) + ")";
    }
    std::string operator()(Infinite) const { return std::string(infinite_word); }
    std::string operator()(const NotShown& hidden) const { return escape(hidden.said); }
  };
  return std::visit(Visitor{column, escape, number}, cell.value());
}

// CSV

void append_comment(std::string& out, std::string_view prefix, std::string_view text) {
  while (true) {
    const std::size_t end = text.find('\n');
    out += fmt::format("{}{}\n", prefix, text.substr(0, end));
    if (end == std::string_view::npos) return;
    text.remove_prefix(end + 1);
  }
}

void append_csv_cell(std::vector<std::string>& fields, const Cell& cell, bool with_interval) {
  const std::size_t first = fields.size();
  struct Visitor {
    std::vector<std::string>& fields;
    void operator()(const std::string& text) const { fields.push_back(csv_field(text)); }
    void operator()(std::int64_t whole) const { fields.push_back(fmt::format("{}", whole)); }
    void operator()(double number) const { fields.push_back(full_precision(number)); }
    void operator()(const Estimate& e) const {
      for (const double number : {e.value, e.lower, e.upper}) fields.push_back(full_precision(number));
    }
    void operator()(const NotShown& hidden) const { (*this)(hidden.number); }
    void operator()(Infinite) const { fields.emplace_back(infinite_word); }
  };
  std::visit(Visitor{fields}, cell.value());
  fields.resize(first + (with_interval ? 3 : 1));
}

// Markdown

std::string escape_markdown(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\n') {
      out += "<br>";
      continue;
    }
    if (c == '<') {
      out += "&lt;";
      continue;
    }
    if (std::string_view("\\`*_[]|").find(c) != std::string_view::npos) out += '\\';
    out += c;
  }
  return out;
}

// LaTeX

constexpr std::pair<std::string_view, std::string_view> latex_commands[] = {
    {"\\", "\\textbackslash{}"},
    {"&", "\\&"},
    {"%", "\\%"},
    {"$", "\\$"},
    {"#", "\\#"},
    {"_", "\\_"},
    {"{", "\\{"},
    {"}", "\\}"},
    {"~", "\\textasciitilde{}"},
    {"^", "\\textasciicircum{}"},
    {"<", "$<$"},
    {">", "$>$"},
    {"|", "$|$"},
    {"\"", "''"},
    {"\n", " "},
    {"--", "-{}-"},
    {"α", "$\\alpha$"},
    {"β", "$\\beta$"},
    {"γ", "$\\gamma$"},
    {"δ", "$\\delta$"},
    {"ε", "$\\varepsilon$"},
    {"η", "$\\eta$"},
    {"θ", "$\\theta$"},
    {"κ", "$\\kappa$"},
    {"λ", "$\\lambda$"},
    {"μ", "$\\mu$"},
    {"µ", "$\\mu$"},
    {"ν", "$\\nu$"},
    {"π", "$\\pi$"},
    {"ρ", "$\\rho$"},
    {"σ", "$\\sigma$"},
    {"τ", "$\\tau$"},
    {"φ", "$\\varphi$"},
    {"χ", "$\\chi$"},
    {"ψ", "$\\psi$"},
    {"ω", "$\\omega$"},
    {"Δ", "$\\Delta$"},
    {"Σ", "$\\Sigma$"},
    {"Φ", "$\\Phi$"},
    {"Ω", "$\\Omega$"},
    {"°", "$^{\\circ}$"},
    {"±", "$\\pm$"},
    {"×", "$\\times$"},
    {"·", "$\\cdot$"},
    {"≤", "$\\le$"},
    {"≥", "$\\ge$"},
    {"≈", "$\\approx$"},
    {"≠", "$\\ne$"},
    {"∞", "$\\infty$"},
    {"→", "$\\to$"},
    {"√", "$\\surd$"},
    {"∈", "$\\in$"},
    {"−", "$-$"},
    {"–", "--"},
    {"—", "---"},
    {"…", "\\ldots{}"},
    {"’", "'"},
    {"‘", "`"},
    {"“", "``"},
    {"”", "''"},
    {"′", "'"},
    {"⁰", "$^{0}$"},
    {"¹", "$^{1}$"},
    {"²", "$^{2}$"},
    {"³", "$^{3}$"},
    {"⁴", "$^{4}$"},
    {"⁵", "$^{5}$"},
    {"⁶", "$^{6}$"},
    {"⁷", "$^{7}$"},
    {"⁸", "$^{8}$"},
    {"⁹", "$^{9}$"},
    {"⁻", "$^{-}$"},
    {"⁺", "$^{+}$"},
    {"₀", "$_{0}$"},
    {"₁", "$_{1}$"},
    {"₂", "$_{2}$"},
    {"₃", "$_{3}$"},
    {"₄", "$_{4}$"},
    {"₅", "$_{5}$"},
    {"₆", "$_{6}$"},
    {"₇", "$_{7}$"},
    {"₈", "$_{8}$"},
    {"₉", "$_{9}$"},
    {"\u00a0", "~"},
    {"\u202f", "\\,"},
};

/// Neighbouring formulas become one: "ω²" is $\omega^{2}$, "s⁻¹" is s$^{-1}$.
std::string escape_latex(std::string_view text) {
  std::string out;
  bool in_formula = false;
  char script = '\0';  // '^' or '_' if the formula ends with one
  while (!text.empty()) {
    const auto* command =
        std::ranges::find_if(latex_commands, [&](const auto& c) { return text.starts_with(c.first); });
    if (command == std::end(latex_commands)) {
      out += text.front();
      text.remove_prefix(1);
      in_formula = false;
      continue;
    }
    text.remove_prefix(command->first.size());
    if (!command->second.starts_with('$')) {
      out += command->second;
      in_formula = false;
      continue;
    }
    std::string_view formula = command->second.substr(1);
    const char new_script = formula.front() == '^' || formula.front() == '_' ? formula.front() : '\0';
    if (!in_formula) {
      out += '$';
    } else {
      out.pop_back();  // the closing $
      if (new_script != '\0' && new_script == script) {
        out.pop_back();  // the closing brace
        formula.remove_prefix(2);
      } else if (new_script != '\0' && script != '\0') {
        out += "{}";
      }
    }
    out += formula;
    in_formula = true;
    script = new_script;
  }
  return out;
}

std::string latex_number(const Decimal& d) {
  if (d.infinite) return (d.negative ? "$-$" : "") + std::string(infinite_word);
  if (d.exponent == 0 && !d.negative) return d.mantissa;
  const std::string power =
      d.exponent == 0 ? "" : fmt::format("{}10^{{{}}}", d.mantissa.empty() ? "" : " \\times ", d.exponent);
  return fmt::format("${}{}{}{}$", d.less_than ? "< " : "", d.negative ? "-" : "", d.mantissa, power);
}

constexpr std::size_t latex_page = 45;          // rows of a page; longer tables break
constexpr std::size_t latex_wrapped_page = 20;  // where text wraps
constexpr std::size_t latex_word = 12;          // characters of a heading's line, if it has spaces
constexpr std::size_t latex_wrapped = 24;       // characters beyond which text is wrapped
constexpr std::size_t latex_many_columns = 6;   // beyond, smaller type
constexpr std::size_t latex_very_many_columns = 8;
constexpr double latex_share = 0.6;  // of the line, for all columns of wrapped text

// Says how a table fits a page.
struct LatexLayout {
  std::string packages = "booktabs", columns;
  std::vector<bool> wrapped;  // by column
  std::string_view size = "\\small";
  bool is_long = false;
};

LatexLayout latex_layout(const Table& table) {
  LatexLayout layout;
  std::vector<bool>& wrapped = layout.wrapped;
  wrapped.resize(table.columns.size());
  for (const auto& row : table.rows)
    for (std::size_t j = 0; j < row.size(); ++j)
      if (const auto* text = std::get_if<std::string>(&row[j].value()))
        wrapped[j] = wrapped[j] || (is_text(table, j) && text->size() > latex_wrapped);
  const auto count = std::ranges::count(wrapped, true);
  for (std::size_t j = 0; j < table.columns.size(); ++j)
    layout.columns += wrapped[j] ? fmt::format(">{{\\raggedright\\arraybackslash}}p{{{:.2g}\\linewidth}}",
                                               latex_share / static_cast<double>(count + 1))
                                 : std::string(1, is_text(table, j) ? 'l' : 'r');
  layout.is_long = table.rows.size() > (count > 0 ? latex_wrapped_page : latex_page);
  if (count > 0) layout.packages += ",array";
  if (layout.is_long) layout.packages += ",longtable";
  if (table.columns.size() > latex_very_many_columns)
    layout.size = "\\tiny\\setlength{\\tabcolsep}{2pt}";
  else if (table.columns.size() > latex_many_columns)
    layout.size = "\\scriptsize\\setlength{\\tabcolsep}{3pt}";
  return layout;
}

// Names of effects and parameters may break after an underscore or a plus.
std::string breakable(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    out += text[i];
    if (text[i] == '+' || (text[i] == '_' && i > 0 && text[i - 1] == '\\')) out += "\\allowbreak{}";
  }
  return out;
}

// Long names take several lines, units stand below. Braces: a [ right after \\ would be read as its optional argument.
std::string latex_heading(const Column& column, bool text) {
  std::string lines;
  std::size_t length = 0;
  for (std::size_t from = 0; from < column.name.size();) {
    const std::size_t to = std::min(column.name.find(' ', from), column.name.size());
    const std::string word = column.name.substr(from, to - from);
    if (length > 0) lines += length + 1 + word.size() > latex_word ? "\\\\{}" : " ";
    length = length > 0 && length + 1 + word.size() <= latex_word ? length + 1 + word.size() : word.size();
    lines += escape_latex(word);
    from = to + 1;
  }
  if (!column.unit.empty()) lines += "\\\\{}[" + escape_latex(column.unit) + "]";
  if (lines.find("\\\\") == std::string::npos) return "{" + lines + "}";
  return fmt::format("\\begin{{tabular}}[b]{{@{{}}{}@{{}}}}{}\\end{{tabular}}", text ? 'l' : 'r', lines);
}

}  // namespace

std::vector<std::string> provenance_lines(const Provenance& provenance) {
  std::vector<std::string> lines;
  const auto add = [&](std::string_view name, std::string_view text) {
    if (text.empty()) return;
    std::ranges::replace(lines.emplace_back(fmt::format("{}: {}", name, text)), '\n', ' ');
  };
  add("command", provenance.command);
  std::string_view settings = provenance.settings;
  while (!settings.empty()) {
    const std::size_t end = settings.find('\n');
    add("settings", settings.substr(0, end));
    settings.remove_prefix(end == std::string_view::npos ? settings.size() : end + 1);
  }
  if (!lines.empty()) add("seed", fmt::format("{}", provenance.seed));
  add("version", provenance.version);
  return lines;
}

std::string escape_html(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string csv_field(const std::string& text) { return analysis::csv_field(text); }

std::string to_csv(const Table& table) {
  validate(table);
  std::string out;
  append_comment(out, "# ", table.title);
  for (const std::string& note : table.notes) append_comment(out, "# ", note);
  for (const std::string& line : provenance_lines(table.provenance)) append_comment(out, "# ", line);

  const auto append_row = [&](const std::vector<std::string>& fields) {
    out += fmt::format("{}\n", fmt::join(fields, ","));
  };
  std::vector<std::string> fields;
  for (std::size_t j = 0; j < table.columns.size(); ++j) {
    fields.push_back(csv_field(heading(table.columns[j])));
    if (!has_interval(table, j)) continue;
    for (const char* end : {"low", "high"})
      fields.push_back(csv_field(heading(table.columns[j], fmt::format(" {}{}", end, table.columns[j].level))));
  }
  append_row(fields);
  for (const auto& row : table.rows) {
    fields.clear();
    for (std::size_t j = 0; j < row.size(); ++j) append_csv_cell(fields, row[j], has_interval(table, j));
    append_row(fields);
  }
  return out;
}

std::string to_markdown(const Table& table) {
  validate(table);
  std::string out = fmt::format("**{}**\n\n|", escape_markdown(table.title));
  for (const Column& column : table.columns) out += fmt::format(" {} |", escape_markdown(heading(column)));
  out += "\n|";
  for (std::size_t j = 0; j < table.columns.size(); ++j) out += is_text(table, j) ? " :-- |" : " --: |";
  for (const auto& row : table.rows) {
    out += "\n|";
    for (std::size_t j = 0; j < row.size(); ++j) {
      out += fmt::format(" {} |", show(row[j], table.columns[j], escape_markdown,
                                       [](const Decimal& d) { return escape_markdown(plain_text(d)); }));
    }
  }
  out += '\n';
  for (const std::string& note : table.notes) out += fmt::format("\n{}\n", escape_markdown(note));
  out += '\n';
  for (const std::string& line : provenance_lines(table.provenance))
    out += fmt::format("- {}\n", escape_markdown(line));
  return out;
}

std::string to_latex(const Table& table) {
  validate(table);
  const LatexLayout layout = latex_layout(table);
  const std::vector<std::string> provenance = provenance_lines(table.provenance);
  std::string out = fmt::format("% Needs \\usepackage{{{}}}.\n", layout.packages);
  for (const std::string& line : provenance) append_comment(out, "% ", line);
  const std::string title = fmt::format("\\caption{{{}}}\n\\label{{tab:{}}}", escape_latex(table.title), table.id);
  // A wide table spans both columns of a two-column paper; in one column the two are the same.
  const std::string_view environment = layout.is_long ? "longtable" : table.columns.size() > 4 ? "table*" : "table";
  if (layout.is_long)
    out += fmt::format("{{{}\n\\begin{{longtable}}{{{}}}\n{} \\\\\n", layout.size, layout.columns, title);
  else
    out += fmt::format("\\begin{{{}}}[htbp]\n\\centering{}\n{}\n\\begin{{tabular}}{{{}}}\n", environment, layout.size,
                       title, layout.columns);
  out += "\\toprule\n";

  const auto append_row = [&](const std::vector<std::string>& cells) {
    out += fmt::format("{} \\\\\n", fmt::join(cells, " & "));
  };
  std::vector<std::string> cells;
  for (std::size_t j = 0; j < table.columns.size(); ++j)
    cells.push_back(latex_heading(table.columns[j], is_text(table, j)));
  append_row(cells);
  out += layout.is_long ? "\\midrule\n\\endhead\n" : "\\midrule\n";
  for (const auto& row : table.rows) {
    cells.clear();
    for (std::size_t j = 0; j < row.size(); ++j) {
      std::string text = show(row[j], table.columns[j], escape_latex, latex_number);
      if (layout.wrapped[j]) text = breakable(text);
      cells.push_back(text.starts_with('[') || text.starts_with('*') ? "{" + text + "}" : text);
    }
    append_row(cells);
  }
  out += layout.is_long ? "\\bottomrule\n\\end{longtable}}\n\n" : "\\bottomrule\n\\end{tabular}\n\n\\medskip\n";
  out += "\\noindent\\begin{minipage}{\\linewidth}\\footnotesize\n";
  for (const std::string& note : table.notes) out += escape_latex(note) + "\\par\n";
  for (const std::string& line : provenance) out += escape_latex(line) + "\\par\n";
  out += "\\end{minipage}\n";
  if (!layout.is_long) out += fmt::format("\\end{{{}}}\n", environment);
  return out;
}

std::string to_html(const Table& table) {
  validate(table);
  std::string out = fmt::format("<figure class=\"table\" id=\"table-{}\">\n<figcaption>{}</figcaption>\n",
                                escape_html(table.id), escape_html(table.title));
  const std::size_t cells = table.rows.size() * table.columns.size();
  std::string classes = cells <= html_few ? "cards few" : cells <= html_cards ? "cards" : "rows";
  if (table.columns.size() > html_columns) classes += " dense";
  out += fmt::format("<div class=\"scroll\" tabindex=\"0\"><table class=\"{}\">\n<thead><tr>", classes);
  const auto kind = [&](std::size_t j) -> std::string_view {
    if (!is_text(table, j)) return "";
    std::size_t longest = 0;
    for (const auto& row : table.rows)
      if (const auto* text = std::get_if<std::string>(&row[j].value())) longest = std::max(longest, text->size());
    return longest > html_long   ? " class=\"text long\""
           : longest > html_some ? " class=\"text some\""
                                 : " class=\"text\"";
  };
  for (std::size_t j = 0; j < table.columns.size(); ++j) {
    out += fmt::format("<th scope=\"col\"{}>{}", kind(j), escape_html(table.columns[j].name));
    if (!table.columns[j].unit.empty()) {
      out += fmt::format(" <span class=\"unit\">[{}]</span>", escape_html(table.columns[j].unit));
    }
    out += "</th>";
  }
  out += "</tr></thead>\n<tbody>\n";
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (std::size_t j = 0; j < row.size(); ++j) {
      const bool said = std::holds_alternative<NotShown>(row[j].value());
      std::string shown =
          show(row[j], table.columns[j], escape_html, [](const Decimal& d) { return escape_html(plain_text(d)); });
      // An interval stands below its number.
      if (const std::size_t at = shown.find(" ("); at != std::string::npos && std::get_if<Estimate>(&row[j].value()))
        shown = fmt::format("{} <span class=\"interval\">{}</span>", shown.substr(0, at), shown.substr(at + 1));
      out += fmt::format("<td{} data-label=\"{}\">{}</td>", said ? " class=\"said\"" : kind(j),
                         escape_html(heading(table.columns[j])), shown);
    }
    out += "</tr>\n";
  }
  out += "</tbody></table></div>\n";
  for (const std::string& note : table.notes) out += fmt::format("<p class=\"note\">{}</p>\n", escape_html(note));
  return out + "</figure>\n";
}

}  // namespace metastable::reports
