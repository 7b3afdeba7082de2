#include "reports/output/page.h"

#include <kainjow/mustache.hpp>
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
<title>{{title}}</title>
<style>
:root { --ink: #1c1f23; --soft: #5b636e; --rule: #d9dee4; --link: #0b5c96; }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: #fff; font: 16px/1.55 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; }
header, main, footer { max-width: 120rem; margin: 0 auto; padding: 0 1.25rem; }
header { padding-top: 2.5rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .75rem; }
h2 { font-size: 1.3rem; line-height: 1.3; margin: 0 0 .35rem; }
p { margin: 0 0 .75rem; max-width: 46rem; }
a { color: var(--link); }
nav ul { list-style: none; margin: 1rem 0 0; padding: .6rem 0; border: solid var(--rule); border-width: 1px 0; display: flex; flex-wrap: wrap; gap: .2rem 1.4rem; }
section { margin: 2.5rem 0; }
.reading { color: var(--soft); }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 28rem), 1fr)); gap: 1rem 1.5rem; }
figure { margin: 0 0 1.25rem; min-width: 0; }
figure svg { display: block; width: 100%; max-width: 44rem; height: auto; }
figcaption { font-size: .95rem; max-width: 46rem; }
figure.table figcaption { font-weight: 600; margin-bottom: .4rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums; border-top: 2px solid var(--ink); border-bottom: 2px solid var(--ink); }
th, td { padding: .3rem .8rem; text-align: right; white-space: nowrap; vertical-align: top; }
th { white-space: normal; max-width: 11rem; border-bottom: 1px solid var(--ink); font-weight: 600; vertical-align: bottom; }
th.text, td.text { text-align: left; }
td.text, td.said { white-space: normal; max-width: 36rem; overflow-wrap: break-word; }
.long { min-width: 14rem; }
td.said { max-width: 16rem; color: var(--soft); }
tbody tr:nth-child(even) { background: #f5f7f9; }
.unit { font-weight: 400; color: var(--soft); }
.note, .files, dl { font-size: .88rem; color: var(--soft); }
.note { margin: .4rem 0 0; }
.files { margin: -.75rem 0 1.5rem; }
.files a { margin-right: .9rem; }
footer { padding-top: 1rem; padding-bottom: 2.5rem; }
footer ul { margin: 0; padding: .8rem 1rem; list-style: none; background: #f5f7f9; font: .82rem/1.5 ui-monospace, Menlo, Consolas, monospace; overflow-wrap: anywhere; }
@media print { body { font-size: 10.5pt; } nav, .files { display: none; } figure, tr { break-inside: avoid; } h2 { break-after: avoid; } .scroll { overflow: visible; } th, td { padding: .15rem .4rem; } a { color: inherit; } }
</style>
</head>
<body>
<header>
<h1>{{title}}</h1>
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
<div class="figures">
{{#figures}}
<figure id="figure-{{id}}">
{{{svg}}}
<figcaption>{{caption}}</figcaption>
</figure>
{{/figures}}
</div>
{{#tables}}
{{{table}}}
<p class="files">{{#files}}<a href="{{href}}">{{text}}</a>{{/files}}</p>
{{/tables}}
</section>
{{/sections}}
</main>
<footer>
<h2>How this was made</h2>
<ul>
{{#provenance}}
<li>{{text}}</li>
{{/provenance}}
</ul>
</footer>
</body>
</html>
)html";

/// Returns the SVG element alone, with every id made unique by `prefix`: pages hold many figures, and gnuplot gives all
/// of them the same ids.
std::string inline_svg(std::string_view svg, const std::string& prefix) {
  const std::size_t start = svg.find("<svg");
  if (start == std::string_view::npos) throw std::invalid_argument("figure '" + prefix + "' is no SVG");
  svg.remove_prefix(start);
  std::string out = "<svg role=\"img\"";
  svg.remove_prefix(std::string_view("<svg").size());
  while (!svg.empty()) {
    bool is_id = false;
    for (const std::string_view opening : {" id='", " id=\"", "href='#", "href=\"#", "url(#"}) {
      if (!svg.starts_with(opening)) continue;
      out += opening;
      out += prefix + "-";
      svg.remove_prefix(opening.size());
      is_id = true;
      break;
    }
    if (is_id) continue;
    out += svg.front();
    svg.remove_prefix(1);
  }
  return out;
}

mustache::data texts(const std::vector<std::string>& lines) {
  mustache::data list{mustache::data::type::list};
  for (const std::string& line : lines) list << mustache::data{"text", line};
  return list;
}

mustache::data section_data(const PageSection& section) {
  mustache::data figures{mustache::data::type::list};
  for (const PageFigure& figure : section.figures) {
    mustache::data item;
    item.set("id", figure.id);
    item.set("svg", inline_svg(figure.svg, figure.id));
    item.set("caption", figure.caption);
    figures << item;
  }
  mustache::data tables{mustache::data::type::list};
  for (const PageTable& entry : section.tables) {
    mustache::data files{mustache::data::type::list};
    for (const PageLink& link : entry.files) {
      mustache::data item;
      item.set("text", link.text);
      item.set("href", link.href);
      files << item;
    }
    mustache::data item;
    item.set("table", to_html(entry.table));
    item.set("files", files);
    tables << item;
  }
  mustache::data data;
  data.set("id", section.id);
  data.set("heading", section.heading);
  data.set("reading", section.reading);
  data.set("figures", figures);
  data.set("tables", tables);
  return data;
}

}  // namespace

std::string render_page(const Page& page) {
  mustache::data data;
  data.set("title", page.title);
  data.set("intro", texts(page.intro));
  mustache::data sections{mustache::data::type::list};
  for (const PageSection& section : page.sections) sections << section_data(section);
  data.set("sections", sections);
  data.set("provenance", texts(provenance_lines(page.provenance)));
  mustache::mustache renderer(page_template);
  return renderer.render(data);
}

}  // namespace metastable::reports
