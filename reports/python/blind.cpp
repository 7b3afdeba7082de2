// Binds the blind check of the diagnosis.

#include <fmt/format.h>

#include <atomic>

#include "reports/command_line/requests.h"
#include "reports/experiment_commands/blind_command.h"
#include "reports/output/table_json.h"
#include "reports/output/text_table.h"
#include "reports/python/answer.h"
#include "reports/python/arguments.h"

namespace metastable::reports::python {
namespace {

BlindRequest blind_request_of(const py::dict& options, const std::string& command) {
  const Arguments given(options);
  LooseOptions asked(declare_blind);
  asked->give("DIR", {given.text("folder")});
  for (const char* name : {"sealed", "out"})
    if (given.given(name)) asked->give(name, {given.text(name)});
  given.without({"sealed", "out", "tool"}).give(*asked);
  asked->check_given();
  BlindRequest request = blind_request(*asked, command);
  request.tool = given.texts("tool");
  return request;
}

/// Tells a call of cases.
class Cases {
 public:
  explicit Cases(Call& call) : call_(call) {}
  CaseProgress progress() {
    return {[this](std::size_t all, std::size_t had) {
              all_ = all;
              done_ = had;
              tell();
            },
            [this] { tell(); },
            [this] {
              ++done_;
              tell();
            }};
  }

 private:
  void tell() { call_.tell(all_ > 0 ? static_cast<double>(done_) / static_cast<double>(all_) : 1, "cases"); }
  Call& call_;
  std::atomic<std::size_t> all_ = 0, done_ = 0;
};

// Returns what `work` (make_blind, answer_blind) tells of the run that the options name.
template <typename Work>
auto of_cases(const Work& work, const py::dict& options, const std::string& command, const py::object& progress) {
  const BlindRequest request = blind_request_of(options, command);
  decltype(work(request, CaseProgress{})) told;
  Call call(progress);
  Cases cases(call);
  call.run([&] { told = work(request, cases.progress()); });
  return told;
}

py::dict make(const py::dict& options, const std::string& command, const py::object& progress) {
  const BlindMade made = of_cases(make_blind, options, command, progress);
  py::dict told;
  told["cases"] = made.cases;
  told["sealed"] = made.sealed;
  return told;
}

py::dict answer_cases(const py::dict& options, const std::string& command, const py::object& progress) {
  const BlindAnswered found = of_cases(answer_blind, options, command, progress);
  py::dict told;
  told["cases"] = found.cases;
  told["answered"] = found.answered;
  told["failed"] = found.failed;
  return told;
}

py::dict open_cases(const py::dict& options, const std::string& command, const py::object& progress) {
  const BlindRequest request = blind_request_of(options, command);
  const Unanswered unanswered = Arguments(options).flag("partial") ? Unanswered::left_out : Unanswered::refused;
  BlindOpened opened;
  Call call(progress);
  call.run([&] { opened = open_blind(request, unanswered); });
  std::string text;
  for (const Table& table : opened.tables) text += to_text(table, 1000, line_width) + "\n";
  return answer(tables_json(opened.tables, opened.provenance), text + opened.page + "\n", tables_html(opened.tables));
}

}  // namespace

void add_blind(py::module_& module) {
  module.def("blind_make", make);
  module.def("blind_answer", answer_cases);
  module.def("blind_open", open_cases);
}

}  // namespace metastable::reports::python
