#include "reports/experiment_commands/blind_command.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <stdexcept>

#include "analysis/blind/blind_cases.h"
#include "analysis/experiment/experiment.h"
#include "markov/parallel.h"
#include "reports/diagnosis/blind_json.h"
#include "reports/diagnosis/blind_tables.h"
#include "reports/output/file_lock.h"
#include "reports/output/input_file.h"
#include "reports/output/interrupt.h"
#include "reports/output/output_file.h"
#include "reports/output/page_folder.h"
#include "reports/output/progress.h"
#include "reports/output/seal.h"
#include "reports/output/version.h"

extern char** environ;

namespace metastable::reports {
namespace {

namespace fs = std::filesystem;

std::optional<std::string> file_text(const fs::path& path) {
  if (!fs::is_regular_file(path)) return std::nullopt;
  return read_file(path);
}

std::string name_of(int number) { return fmt::format("{:04}", number); }

struct Places {
  fs::path run, cases, answers, record, sealed, marker, plan, planned;
  explicit Places(const BlindRequest& request)
      : run(request.folder),
        cases(run / "cases"),
        answers(run / "answers"),
        record(answers / "record.csv"),
        sealed(request.sealed.empty() ? fs::path(request.folder + "-sealed") : fs::path(request.sealed)),
        marker(sealed / "opened.csv"),
        plan(sealed / "plan.txt"),
        planned(cases / "planned.txt") {}
  fs::path case_folder(int number) const { return cases / name_of(number); }
  fs::path truth(int number) const { return sealed / (name_of(number) + ".json"); }
  fs::path answer(int number) const { return answers / (name_of(number) + ".json"); }
  fs::path errors(int number) const { return answer(number).string() + ".err"; }
};

// A folder's name tells the number of its case.
int case_number(const fs::path& folder) {
  const std::string name = folder.filename().string();
  int number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc{} || number < 1 || name != name_of(number))
    throw std::invalid_argument(
        fmt::format("{}: holds a seal.txt, but its name is not that of a case (0001, 0002, ...)", folder.string()));
  return number;
}

// Returns the numbers of the cases that are complete, ascending.
std::vector<int> case_numbers(const Places& places) {
  std::vector<int> numbers;
  if (fs::is_directory(places.cases))
    for (const auto& entry : fs::directory_iterator(places.cases))
      if (fs::exists(entry.path() / "seal.txt")) numbers.push_back(case_number(entry.path()));
  std::sort(numbers.begin(), numbers.end());
  if (numbers.empty())
    throw std::invalid_argument(
        fmt::format("{}: holds no blind case; `blind make` writes them", places.cases.string()));
  return numbers;
}

// Returns how many cases there are to be, made or not.
std::size_t planned_cases(const Places& places, std::size_t made) {
  std::size_t planned = 0;
  std::sscanf(file_text(places.planned).value_or("").c_str(), "%zu", &planned);
  return std::max(planned, made);
}

std::string now() {
  const std::time_t time = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  gmtime_r(&time, &parts);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday,
                     parts.tm_hour, parts.tm_min, parts.tm_sec);
}

std::uint64_t entropy() {
  std::random_device device;
  return (static_cast<std::uint64_t>(device()) << 32) | device();
}

void write_case(const Places& places, const analysis::BlindCase& made, const std::string& salt) {
  const int number = made.truth.number;
  const std::string truth = truth_json(made.truth, salt);
  const fs::path folder = places.case_folder(number);
  make_folder(folder);
  write_file(places.truth(number), truth);
  const std::string& trials = made.walks ? made.walks->trials_csv : made.files.files.trials_csv;
  if (made.walks)
    write_file(folder / "steps.csv", made.walks->steps_csv);
  else
    write_file(folder / "collisions.csv", made.files.files.collisions_csv);
  if (!trials.empty()) write_file(folder / "trials.csv", trials);
  if (!made.catalogue.empty()) {
    std::string ids;
    for (const std::string& id : made.catalogue) ids += (ids.empty() ? "" : ",") + id;
    write_file(folder / "catalogue.txt", ids + "\n");
  }
  write_file(folder / "experiment.toml", made.walks ? made.walks->experiment_toml : made.files.files.experiment_toml);
  write_file(folder / "seal.txt", sha256(truth) + "\n");  // last: without it there is no case
}

// Runs a program to its end; its standard output goes nowhere, its errors to a file. It returns the exit code.
int run_program(const std::vector<std::string>& words, const fs::path& errors) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, errors.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  pid_t child = 0;
  const int failed = posix_spawnp(&child, arguments.front(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw std::invalid_argument(fmt::format("--tool: {} cannot be run", words.front()));
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

std::vector<RecordedAnswer> checked_record(const Places& places) {
  return read_record(places.record.string(), file_text(places.record).value_or(""));
}

// The record is a chain of digests, which one process at a time may lengthen.
FileLock lock_answers(const Places& places) {
  FileLock lock(places.answers / ".lock", FileLock::Missing::create);
  if (!lock.held()) throw OutputError(places.answers, "another `blind answer` is writing there");
  return lock;
}

// Begins the last line of the errors beside an answer that the tool failed to give; a tool that was killed with this
// program, or still runs, leaves none.
constexpr std::string_view failed_line = "exit code ";
constexpr int interrupted_code = 128 + SIGINT;

bool tool_failed(const Places& places, int number) {
  return file_text(places.errors(number)).value_or("").find(failed_line) != std::string::npos;
}

std::string trimmed(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  return text;
}

// Says what a run was made with; equal texts make equal cases.
std::string plan_text(const analysis::BlindSize& size, std::uint64_t seed) {
  std::string text =
      fmt::format("seed {}\neffect {}\nnone {}\npairs {}\noutside {}\nleft_out {}\n", seed,
                  size.per_effect_and_strength, size.none, size.pairs, size.outside, size.left_out_per_effect);
  // Plans without these kinds, of one law or of wheels are written as they were before there were any.
  if (size.walkers) text += "walker compass\n";
  if (size.mixed > 0) text += fmt::format("mixed {}\n", size.mixed);
  if (size.many > 0) text += fmt::format("many {}\n", size.many);
  if (size.laws != analysis::BlindSize{}.laws)
    for (const dynamics::Law law : size.laws) text += fmt::format("law {}\n", dynamics::law_name(law));
  return text;
}

// Makes the folders of a run, or finds that they are there; returns the run's seed.
std::uint64_t begin_run(const Places& places, const BlindRequest& request) {
  std::uint64_t seed = request.seed ? *request.seed : entropy();
  if (analysis::blind_plan(request.size, seed).empty())
    throw std::invalid_argument("blind make: no case of any kind is asked for");
  make_folder(places.sealed);
  make_folder(places.cases);
  if (const std::optional<std::string> before = file_text(places.plan)) {
    if (!request.seed) std::sscanf(before->c_str(), "seed %lu", &seed);
    if (*before != plan_text(request.size, seed))
      throw OutputError(places.sealed, "belongs to a run of another seed or size; choose another folder");
  } else {
    write_file(places.plan, plan_text(request.size, seed));
  }
  return seed;
}

void make_case(const Places& places, const analysis::BlindPlan& plan, int number, std::uint64_t seed) {
  analysis::BlindCase made = analysis::blind_case(plan, number, seed, [](const auto& design, const auto& effects) {
    // Under settled an experiment's likelihood takes seconds to set up.
    const bool slow = design.conditions.front().setting.law == dynamics::Law::settled;
    return analysis::expected_power(design, effects, slow ? 1 : 3);
  });
  analysis::complete_truth(made);
  write_case(places, made, sha256(fmt::format("salt {} {}", seed, number)));
}

// Returns those of the cases 1 to `planned` that are not complete.
std::vector<int> missing_cases(const Places& places, std::size_t planned) {
  std::vector<int> missing;
  for (int number = 1; static_cast<std::size_t>(number) <= planned; ++number)
    if (!fs::exists(places.case_folder(number) / "seal.txt")) missing.push_back(number);
  return missing;
}

// Runs the tool on a case; returns its exit code. @throws Interrupted, with nothing left
int run_tool(std::vector<std::string> words, const Places& places, int number, const fs::path& fresh,
             const CaseProgress& progress) {
  const fs::path folder = places.case_folder(number), errors = places.errors(number);
  words.insert(words.end(), {"diagnose", folder.string(), "--json", fresh.string(), "--threads", "1"});
  if (const std::optional<std::string> catalogue = file_text(folder / "catalogue.txt")) {
    words.emplace_back("--catalogue");
    words.push_back(trimmed(*catalogue));
  }
  const int code = run_program(words, errors);
  try {
    progress.check();
    if (code == interrupted_code) throw Interrupted(SIGINT);  // Ctrl-C reached the tool first
  } catch (...) {
    fs::remove(errors);
    throw;
  }
  return code;
}

// Enters what the tool wrote to `fresh` as the answer to a case. Returns whether it did; a failed tool's errors stay
// beside where the answer would be.
bool enter_answer(const Places& places, int number, int code, const fs::path& fresh,
                  std::vector<RecordedAnswer>& record) {
  const fs::path errors = places.errors(number);
  const std::optional<std::string> text = file_text(fresh);
  if (code != 0 || !text) {
    write_file(errors, fmt::format("{}{}{}\n", file_text(errors).value_or(""), failed_line, code));
    return false;
  }
  read_answer(fresh.string(), *text);
  fs::rename(fresh, places.answer(number));
  fs::remove(errors);
  record.push_back(record_answer(record.empty() ? "" : record.back().chain, number, now(), *text));
  std::string lines;
  for (const RecordedAnswer& entry : record) lines += record_line(entry);
  write_file(places.record, lines);
  return true;
}

// Returns the truths of the cases, whose seals are whole.
std::vector<analysis::BlindTruth> unsealed(const Places& places, const std::vector<int>& numbers) {
  std::vector<analysis::BlindTruth> truths;
  for (const int number : numbers) {
    const fs::path path = places.truth(number);
    const std::optional<std::string> text = file_text(path);
    if (!text)
      throw std::invalid_argument(
          fmt::format("{}: there is no such file; it holds the sealed truth of case {}", path.string(), number));
    if (sha256(*text) != trimmed(file_text(places.case_folder(number) / "seal.txt").value_or("")))
      throw std::invalid_argument(fmt::format("{}: the seal of case {} is broken", path.string(), number));
    truths.push_back(read_truth(path.string(), *text));
  }
  return truths;
}

// Returns the recorded answers by the number of their case. They are as they were recorded.
std::map<int, analysis::BlindAnswer> recorded_answers(const Places& places, const std::vector<RecordedAnswer>& record) {
  std::map<int, analysis::BlindAnswer> given;
  for (const RecordedAnswer& entry : record) {
    const fs::path path = places.answer(entry.number);
    const std::optional<std::string> text = file_text(path);
    if (!text)
      throw std::invalid_argument(fmt::format("{}: the answer to case {} is missing", path.string(), entry.number));
    if (sha256(*text) != entry.digest)
      throw std::invalid_argument(
          fmt::format("{}: the answer to case {} was changed since it was recorded", path.string(), entry.number));
    given[entry.number] = read_answer(path.string(), *text);
  }
  return given;
}

// Closes the record, from the first opening on. @throws std::invalid_argument if it has grown since
void close_record(const Places& places, const std::vector<RecordedAnswer>& record) {
  const std::string head = fmt::format("{},{}\n", record.size(), record.back().chain);
  if (const std::optional<std::string> marker = file_text(places.marker)) {
    if (*marker != head)
      throw std::invalid_argument(
          fmt::format("{}: answers were written after the truths had been opened", places.record.string()));
  } else {
    write_file(places.marker, head);
  }
}

// Holds the cases that were reached, each with what was answered; nothing where the tool failed.
struct Reached {
  std::vector<analysis::BlindTruth> truths;
  std::vector<std::optional<analysis::BlindAnswer>> answers;
};

// Leaves out the cases that were not reached; one that the tool failed on is an answer, and a wrong one.
Reached reached_cases(const Places& places, const std::vector<analysis::BlindTruth>& truths,
                      const std::map<int, analysis::BlindAnswer>& given) {
  Reached reached;
  for (const analysis::BlindTruth& truth : truths) {
    const bool answered = given.contains(truth.number);
    if (!answered && !tool_failed(places, truth.number)) continue;
    reached.truths.push_back(truth);
    reached.answers.push_back(answered ? std::optional(given.at(truth.number)) : std::nullopt);
  }
  return reached;
}

// Names cases, runs of them by their ends: "0001, 0004 to 0009".
std::string names_of(const std::vector<int>& numbers) {
  std::string names;
  for (std::size_t first = 0, next; first < numbers.size(); first = next) {
    for (next = first + 1; next < numbers.size() && numbers[next] == numbers[next - 1] + 1;) ++next;
    names += (first > 0 ? ", " : "") + name_of(numbers[first]);
    if (next - first > 1) names += (next - first > 2 ? " to " : ", ") + name_of(numbers[next - 1]);
  }
  return names;
}

// Refuses to open a run of which the answers to some cases are missing, or to all. @param answered  how many are
// recorded  @param reached  those and what the tool failed on
void require_answers(const BlindRequest& request, const Places& places, std::size_t answered,
                     const std::vector<analysis::BlindTruth>& reached, std::size_t planned) {
  std::vector<int> missing;
  for (int number = 1; static_cast<std::size_t>(number) <= planned; ++number)
    if (std::ranges::find(reached, number, &analysis::BlindTruth::number) == reached.end()) missing.push_back(number);
  const std::vector<int> unmade = missing_cases(places, planned);
  if (missing.empty() && answered == 0)
    throw std::invalid_argument(
        fmt::format("{}: the diagnosis failed on every case; see {}/*.err", request.folder, places.answers.string()));
  if (!missing.empty())
    throw std::invalid_argument(
        fmt::format("{}: no answer to {} of {} cases ({}), and opening the truths ends the run: answer {} first "
                    "({}`blind answer`){}",
                    request.folder, missing.size(), planned, names_of(missing), missing.size() == 1 ? "it" : "them",
                    unmade.empty() ? "" : fmt::format("`blind make` for {}, then ", names_of(unmade)),
                    answered == 0 ? "" : ", or give --partial to grade the others alone"));
}

void complete_truths(const Places& places, std::vector<analysis::BlindTruth>& truths, int threads) {
  markov::parallel_for(truths.size(), threads, [&places, &truths](std::size_t i) {
    analysis::BlindTruth& truth = truths[i];
    if (truth.effects.empty()) return;
    const fs::path folder = places.case_folder(truth.number);
    if (truth.slope_deg)
      analysis::complete_each(truth, *analysis::read_walks(folder));
    else
      analysis::complete_each(truth, analysis::read_experiment(folder));
  });
}

// Writes the page of the tables; returns its path.
std::string write_page(const fs::path& out, const std::vector<Table>& tables, const Provenance& provenance) {
  PageFolder folder(out);
  Page& page = folder.page();
  page.title = "Blind check of the diagnosis";
  page.intro = {
      "Cases from the virtual laboratories, which share no formula with the models. Truths were sealed before "
      "the diagnosis saw the folders; seals and the record of answers were checked."};
  page.provenance = provenance;
  for (const Table& table : tables) folder.section(table.id + "-section", table.title, "", {}, {table});
  folder.write_index();
  return (out / "index.html").string();
}

}  // namespace

BlindMade make_blind(const BlindRequest& request, const CaseProgress& progress) {
  const Places places(request);
  if (lies_in(places.sealed, places.run) || same_file(places.sealed, places.run))
    throw std::invalid_argument(
        fmt::format("--sealed: {} lies inside {}; truths must be kept apart", places.sealed.string(), request.folder));
  const std::uint64_t seed = begin_run(places, request);
  const std::vector<analysis::BlindPlan> plan = analysis::blind_plan(request.size, seed);
  const std::vector<int> open = missing_cases(places, plan.size());
  write_file(places.planned, fmt::format("{}\n", plan.size()));
  progress.begin(plan.size(), plan.size() - open.size());
  try {
    markov::parallel_for(open.size(), request.threads, [&](std::size_t k) {
      progress.check();
      make_case(places, plan[static_cast<std::size_t>(open[k] - 1)], open[k], seed);
      progress.done();
    });
  } catch (const Interrupted& interrupted) {
    throw Interrupted(interrupted, fmt::format("{} of {} cases kept; the same command goes on",
                                               plan.size() - missing_cases(places, plan.size()).size(), plan.size()));
  }
  return {plan.size(), places.sealed.string()};
}

BlindAnswered answer_blind(const BlindRequest& request, const CaseProgress& progress) {
  const Places places(request);
  const std::vector<int> numbers = case_numbers(places);
  if (fs::exists(places.marker))
    throw OutputError(places.sealed, "was opened; an answer written now would not be blind");
  make_folder(places.answers);
  const FileLock alone = lock_answers(places);
  std::vector<RecordedAnswer> record = checked_record(places);
  std::set<int> answered;
  for (const RecordedAnswer& entry : record) answered.insert(entry.number);
  std::vector<int> open;
  for (const int number : numbers)
    if (!answered.contains(number)) open.push_back(number);
  const std::vector<std::string> tool =
      request.tool.empty() ? std::vector{fs::read_symlink("/proc/self/exe").string()} : request.tool;
  std::mutex mutex;
  std::size_t failed = 0;
  progress.begin(open.size(), 0);
  const std::size_t planned = planned_cases(places, numbers.size());
  try {
    markov::parallel_for(open.size(), request.threads, [&](std::size_t i) {
      progress.check();
      const fs::path fresh = places.answer(open[i]).string() + ".new";
      const int code = run_tool(tool, places, open[i], fresh, progress);
      const std::lock_guard lock(mutex);
      if (!enter_answer(places, open[i], code, fresh, record)) ++failed;
      progress.done();
    });
  } catch (const Interrupted& interrupted) {
    throw Interrupted(interrupted,
                      fmt::format("{} of {} cases answered; the same command goes on", record.size(), planned));
  }
  return {planned, record.size(), failed, places.answers.string()};
}

BlindOpened open_blind(const BlindRequest& request, Unanswered unanswered) {
  const Places places(request);
  const std::vector<int> numbers = case_numbers(places);
  const std::vector<analysis::BlindTruth> truths = unsealed(places, numbers);
  const std::optional<FileLock> alone =
      fs::is_directory(places.answers) ? std::optional(lock_answers(places)) : std::nullopt;
  const std::vector<RecordedAnswer> record = checked_record(places);
  Reached reached = reached_cases(places, truths, recorded_answers(places, record));
  if (record.empty() || (unanswered == Unanswered::refused && !fs::exists(places.marker)))
    require_answers(request, places, record.size(), reached.truths, planned_cases(places, numbers.size()));
  close_record(places, record);
  complete_truths(places, reached.truths, request.threads);

  std::uint64_t seed = 0;
  std::sscanf(file_text(places.plan).value_or("seed 0").c_str(), "seed %lu", &seed);
  const Provenance provenance{
      request.command,
      fmt::format("{} cases, {} answered; record {}", numbers.size(), record.size(), record.back().chain), seed,
      version()};
  std::vector<Table> tables =
      blind_tables(analysis::grade(reached.truths, reached.answers), reached.truths, reached.answers, provenance);
  const std::string page =
      write_page(request.out.empty() ? places.run / "report" : fs::path(request.out), tables, provenance);
  return {std::move(tables), provenance, page};
}

namespace {

// Shows cases on the progress line; the first of Ctrl-C and SIGTERM stops.
CaseProgress shown_progress(const std::string& label, std::optional<Progress>& line) {
  return {[&line, label](std::size_t all, std::size_t had) {
            line.emplace(label, all);
            line->skip(had);
          },
          check_interrupt, [&line] { line->advance(); }};
}

// Truths, cases and answers are not replaced by what a command says.
void check_json(const BlindRequest& request) {
  const Places places(request);
  for (const fs::path& folder : {places.sealed, places.cases, places.answers})
    if (lies_in(request.json, folder))
      throw std::invalid_argument(
          fmt::format("--json: {} lies in {}, which the blind check alone writes", request.json, folder.string()));
}

}  // namespace

void run_blind_make(const BlindRequest& request) {
  check_json(request);
  Answer answer(request.json);
  std::optional<Progress> line;
  const BlindMade made = make_blind(request, shown_progress("making cases", line));
  line.reset();
  answer.say("{}: {} cases; truths sealed in {}", request.folder, made.cases, made.sealed);
  answer.fact("cases", made.cases);
  answer.fact("sealed", made.sealed);
  answer.finish({request.command, {}, request.seed.value_or(0), version()});
}

void run_blind_answer(const BlindRequest& request) {
  check_json(request);
  Answer answer(request.json);
  std::optional<Progress> line;
  const BlindAnswered told = answer_blind(request, shown_progress("answering", line));
  line.reset();
  answer.say("{}: {} of {} cases answered{}", request.folder, told.answered, told.cases,
             told.failed > 0 ? fmt::format("; {} failed, see {}/*.err", told.failed, told.answers) : "");
  answer.fact("cases", told.cases);
  answer.fact("answered", told.answered);
  answer.fact("failed", told.failed);
  answer.finish({request.command, {}, request.seed.value_or(0), version()});
}

void run_blind_open(const BlindRequest& request, Unanswered unanswered) {
  check_json(request);
  Answer answer(request.json);
  const BlindOpened opened = open_blind(request, unanswered);
  for (const Table& table : opened.tables)
    if (&table == &opened.tables.front())
      answer.show(table);
    else
      answer.table(table);
  answer.say("{}", opened.page);
  answer.file(opened.page);
  answer.finish(opened.provenance);
}

}  // namespace metastable::reports
