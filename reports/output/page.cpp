#include "reports/output/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <kainjow/mustache.hpp>
#include <optional>
#include <stdexcept>
#include <string_view>

namespace metastable::reports {
namespace {

namespace mustache = kainjow::mustache;

constexpr const char* page_template = R"html(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{{title}}</title>
<style>
:root { color-scheme: light dark; --page: #fff; --card: #f5f7f9; --ink: #1c1f23; --soft: #59626d; --rule: #d9dee4; --link: #0b5c96; --shade: rgb(0 0 0 / .22);
--axis: #444; --grid: #e4e4e4; --mark: #777; --c0: #0072b2; --c1: #d55e00; --c2: #009e73; --c3: #cc79a7; --c4: #e69f00; --c5: #56b4e9; }
@media (prefers-color-scheme: dark) { :root { --page: #14171b; --card: #1e2329; --ink: #e8eaed; --soft: #a4adb8; --rule: #363d46; --link: #7cc0f4; --shade: rgb(0 0 0 / .75);
--axis: #a9b0b8; --grid: #31373e; --mark: #98a0a9; --c0: #4aa8e6; --c1: #f0803a; --c2: #2fc79a; --c3: #dd93bb; --c4: #f0b43c; --c5: #7fcaf3; } }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: var(--page); font: 16px/1.55 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; }
header, main, footer { max-width: 86rem; margin: 0 auto; padding: 0 clamp(1rem, 3vw, 2rem); }
header { padding-top: clamp(1.25rem, 3vw, 2.5rem); }
h1 { font-size: 1.15rem; line-height: 1.3; margin: 0 0 .6rem; color: var(--soft); font-weight: 600; }
h1.alone { font-size: 1.9rem; color: inherit; }
h2 { font-size: 1.4rem; line-height: 1.3; margin: 0 0 .4rem; }
p { margin: 0 0 .75rem; max-width: 50rem; }
p.lead { font-size: clamp(1.2rem, .9rem + 1.1vw, 1.75rem); line-height: 1.35; margin: 0 0 .7rem; max-width: 72rem; font-weight: 500; text-wrap: pretty; }
a { color: var(--link); }
nav ul { list-style: none; margin: 1.1rem 0 0; padding: .6rem 0; border: solid var(--rule); border-width: 1px 0; display: flex; flex-wrap: wrap; gap: .2rem 1.4rem; }
section { margin: 2.75rem 0; scroll-margin-top: 1rem; }
.reading { color: var(--soft); }
.beside { display: grid; gap: 0 2.5rem; align-items: start; }
@media (min-width: 68rem) { .beside { grid-template-columns: minmax(0, 1fr) minmax(0, 1.1fr); } }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, max(25rem, 34%)), 1fr)); gap: .5rem 2rem; margin-top: .75rem; }
.figures.one { grid-template-columns: minmax(0, 44rem); }
figure { margin: 0 0 1.25rem; min-width: 0; }
figure.wide { grid-column: 1 / -1; }
figure svg { display: block; width: 100%; max-width: 44rem; height: auto; }
.scroll > svg { min-width: 40rem; }
figcaption { font-size: .95rem; max-width: 46rem; }
figure.table { margin-top: .75rem; }
figure.table figcaption { font-weight: 600; margin-bottom: .4rem; }
.scroll { overflow-x: auto; background: linear-gradient(to right, var(--page) 40%, transparent) left / 2.5rem 100% no-repeat local, linear-gradient(to left, var(--page) 40%, transparent) right / 2.5rem 100% no-repeat local, linear-gradient(to right, var(--shade), transparent) left / .8rem 100% no-repeat scroll, linear-gradient(to left, var(--shade), transparent) right / .8rem 100% no-repeat scroll; }
table { border-collapse: collapse; font-size: .92rem; line-height: 1.4; font-variant-numeric: tabular-nums; border-top: 2px solid var(--ink); border-bottom: 2px solid var(--ink); }
th, td { padding: .4rem .8rem; text-align: right; white-space: nowrap; vertical-align: baseline; }
tbody tr + tr > * { border-top: 1px solid var(--rule); }
th { white-space: normal; max-width: 11rem; border-bottom: 1px solid var(--ink); font-weight: 600; vertical-align: bottom; }
th.text, td.text { text-align: left; }
td.text, td.said { white-space: normal; max-width: 36rem; overflow-wrap: break-word; }
th.some { min-width: 9rem; }
th.long { min-width: 14rem; }
td.said { max-width: 16rem; color: var(--soft); }
.interval { display: block; font-size: .85em; color: var(--soft); }
.unit { font-weight: 400; color: var(--soft); }
table.dense { font-size: .82rem; }
table.dense th, table.dense td { padding: .35rem .55rem; }
table.dense th.long { min-width: 8.5rem; }
table.dense th.some { min-width: 7rem; }
table.few { font-size: 1.05rem; }
table.few td { padding: .55rem .8rem; }
table.few td:not(.text) { font-size: 1.15em; }
table.few .interval { font-size: .72em; }
.note, .files, dl { font-size: .88rem; color: var(--soft); }
.note { margin: .4rem 0 0; }
.files { margin: -.75rem 0 1.25rem; }
.files a { margin-right: .9rem; }
details { border: solid var(--rule); border-width: 1px 0; margin-top: -1px; }
summary { cursor: pointer; padding: .6rem 0; font-weight: 600; }
summary:hover { color: var(--link); }
details[open] { padding-bottom: .75rem; }
footer { padding-top: .5rem; padding-bottom: 2.5rem; }
footer ul { margin: 0; padding: .8rem 1rem; list-style: none; background: var(--card); font: .82rem/1.5 ui-monospace, Menlo, Consolas, monospace; overflow-wrap: anywhere; }
@media (max-width: 40rem) {
section { margin: 2rem 0; }
table.cards, table.cards tbody, table.cards tr, table.cards td { display: block; }
table.cards { border: 0; width: 100%; }
table.cards thead { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
table.cards tr { border: 1px solid var(--rule); border-radius: .4rem; background: var(--card); padding: .35rem .8rem; margin: 0 0 .6rem; }
table.cards tbody tr + tr > * { border-top: 0; }
table.cards td, table.cards td.text { display: grid; grid-template-columns: minmax(0, 1fr) minmax(0, 1.3fr); gap: 0 1rem; padding: .25rem 0; text-align: right; white-space: normal; max-width: none; }
table.cards td > * { grid-column: 2; }
table.cards td::before { content: attr(data-label); color: var(--soft); text-align: left; font-weight: 400; font-size: .92rem; }
table.cards td.text:first-child { display: block; text-align: left; font-weight: 600; padding-bottom: .3rem; }
table.cards td.text:first-child::before { content: none; }
table.cards td:empty { display: none; }
table.rows th:first-child, table.rows td:first-child { position: sticky; left: 0; background: var(--page); max-width: 9.5rem; min-width: 0; white-space: normal; border-right: 1px solid var(--rule); }
}
@media print { body { font-size: 10.5pt; } nav, .files { display: none; } figure, tr { break-inside: avoid; } h2 { break-after: avoid; } .scroll { overflow: visible; } th, td { padding: .15rem .4rem; } a { color: inherit; } }
</style>
</head>
<body>
<header>
<h1{{^lead_given}} class="alone"{{/lead_given}}>{{title}}</h1>
{{#lead}}
<p class="lead">{{text}}</p>
{{/lead}}
{{#intro}}
<p>{{text}}</p>
{{/intro}}
<nav aria-label="Sections"><ul>
{{#sections}}
<li><a href="#{{id}}">{{heading}}</a></li>
{{/sections}}
</ul></nav>
</header>
<main>
{{#sections}}
<section id="{{id}}">
<h2>{{heading}}</h2>
<p class="reading">{{reading}}</p>
{{{body}}}</section>
{{/sections}}
</main>
<footer>
<details>
<summary>How this was made</summary>
<ul>
{{#provenance}}
<li>{{text}}</li>
{{/provenance}}
</ul>
</details>
</footer>
</body>
</html>
)html";

struct PageColour {
  std::array<int, 3> drawn;  ///< red, green, blue in the SVG
  std::string_view name;     ///< of the page's colour
};

// These are the greys and the palette of figure.cpp. What stands on coloured cells keeps its colour.
constexpr PageColour page_colours[] = {
    {{0x22, 0x22, 0x22}, "--ink"},  {{0x44, 0x44, 0x44}, "--axis"}, {{0xe4, 0xe4, 0xe4}, "--grid"},
    {{0x77, 0x77, 0x77}, "--mark"}, {{0x55, 0x55, 0x55}, "--soft"}, {{0, 0, 0}, "--ink"},
    {{0xfe, 0xfe, 0xfe}, "--page"}, {{0x00, 0x72, 0xb2}, "--c0"},   {{0xd5, 0x5e, 0x00}, "--c1"},
    {{0x00, 0x9e, 0x73}, "--c2"},   {{0xcc, 0x79, 0xa7}, "--c3"},   {{0xe6, 0x9f, 0x00}, "--c4"},
    {{0x56, 0xb4, 0xe9}, "--c5"}};

/// Reads "rgb( 68,  68,  68)" at the beginning of the text. @param length of it
std::optional<std::array<int, 3>> rgb_at(std::string_view text, std::size_t& length) {
  constexpr std::string_view opening = "rgb(";
  if (!text.starts_with(opening)) return std::nullopt;
  std::array<int, 3> colour{};
  std::size_t at = opening.size(), part = 0;
  for (; at < text.size() && text[at] != ')'; ++at) {
    if (text[at] == ',' && ++part == colour.size()) return std::nullopt;
    if (text[at] >= '0' && text[at] <= '9') colour[part] = 10 * colour[part] + (text[at] - '0');
  }
  if (at == text.size() || part + 1 != colour.size()) return std::nullopt;
  length = at + 1;
  return colour;
}

/// Returns the SVG element alone, in the page's colours and without a ground of its own, with every id made unique by
/// `prefix`: pages hold many figures, and gnuplot gives all of them the same ids.
std::string inline_svg(std::string_view svg, const std::string& prefix) {
  const std::size_t start = svg.find("<svg");
  if (start == std::string_view::npos) throw std::invalid_argument("figure '" + prefix + "' is no SVG");
  svg.remove_prefix(start);
  std::string out = "<svg role=\"img\"";
  svg.remove_prefix(std::string_view("<svg").size());
  constexpr std::string_view ground = "fill=\"#ffffff\"";
  bool has_ground = false;
  const auto take = [&](std::string_view read, std::string_view written) {
    if (!svg.starts_with(read)) return false;
    out += written;
    svg.remove_prefix(read.size());
    return true;
  };
  while (!svg.empty()) {
    bool taken = false;
    for (const std::string_view opening : {" id='", " id=\"", "href='#", "href=\"#", "url(#"})
      taken = taken || take(opening, std::string(opening) + prefix + "-");
    if (!taken && !has_ground) taken = has_ground = take(ground, "fill=\"none\"");
    std::size_t length = 0;
    if (const auto colour = taken ? std::nullopt : rgb_at(svg, length)) {
      const auto* known = std::ranges::find(page_colours, *colour, &PageColour::drawn);
      const std::string_view drawn = svg.substr(0, length);
      taken = take(drawn, known == std::end(page_colours) ? std::string(drawn) : fmt::format("var({})", known->name));
    }
    if (taken) continue;
    out += svg.front();
    svg.remove_prefix(1);
  }
  return out;
}

std::string figures_html(const std::vector<PageFigure>& figures) {
  if (figures.empty()) return "";
  std::string html = fmt::format("<div class=\"figures{}\">\n", figures.size() == 1 ? " one" : "");
  for (const PageFigure& figure : figures) {
    const std::string svg = inline_svg(figure.svg, figure.id);
    html += fmt::format("<figure id=\"figure-{}\"{}>\n", figure.id, figure.wide ? " class=\"wide\"" : "");
    html += figure.wide ? "<div class=\"scroll\" tabindex=\"0\">" + svg + "</div>\n" : svg + "\n";
    if (!figure.caption.empty()) html += fmt::format("<figcaption>{}</figcaption>\n", escape_html(figure.caption));
    html += "</figure>\n";
  }
  return html + "</div>\n";
}

std::string tables_html(const std::vector<PageTable>& tables) {
  if (tables.empty()) return "";
  std::string html = "<div class=\"tables\">\n";
  for (const PageTable& entry : tables) {
    html += to_html(entry.table) + "<p class=\"files\">";
    for (const PageLink& link : entry.files)
      html += fmt::format("<a href=\"{}\">{}</a>", escape_html(link.href), escape_html(link.text));
    html += "</p>\n";
  }
  return html + "</div>\n";
}

std::string folded_html(const FoldedPart& part) {
  std::string html = fmt::format("<details>\n<summary>{}</summary>\n", escape_html(part.summary));
  for (const std::string& text : part.texts) html += fmt::format("<p>{}</p>\n", escape_html(text));
  return html + figures_html(part.figures) + tables_html(part.tables) + "</details>\n";
}

std::string section_html(const PageSection& section) {
  const std::string figures = figures_html(section.figures), tables = tables_html(section.tables);
  std::string html = section.arrangement == Arrangement::beside
                         ? "<div class=\"beside\">\n" + tables + figures + "</div>\n"
                         : figures + tables;
  for (const FoldedPart& part : section.folded) html += folded_html(part);
  return html;
}

mustache::data texts(const std::vector<std::string>& lines) {
  mustache::data list{mustache::data::type::list};
  for (const std::string& line : lines) list << mustache::data{"text", line};
  return list;
}

mustache::data section_data(const PageSection& section) {
  mustache::data data;
  data.set("id", section.id);
  data.set("heading", section.heading);
  data.set("reading", section.reading);
  data.set("body", section_html(section));
  return data;
}

}  // namespace

std::string render_page(const Page& page) {
  mustache::data data;
  data.set("title", page.title);
  data.set("lead", texts(page.lead));
  data.set("lead_given", !page.lead.empty());
  data.set("intro", texts(page.intro));
  mustache::data sections{mustache::data::type::list};
  for (const PageSection& section : page.sections) sections << section_data(section);
  data.set("sections", sections);
  data.set("provenance", texts(provenance_lines(page.provenance)));
  mustache::mustache renderer(page_template);
  return renderer.render(data);
}

}  // namespace metastable::reports
