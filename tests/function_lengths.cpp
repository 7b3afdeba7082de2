// Holds every function of the libraries and the program to 60 lines, tables excepted: longer ones are told by steps
// that have names of their own. A function's lines are those from its first word to its closing brace.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace metastable {
namespace {

constexpr int most_lines = 60;
// Functions that are nothing but a table.
constexpr std::array<std::string_view, 1> tables{"make_catalogue"};
constexpr std::array<const char*, 4> folders{"markov", "dynamics", "analysis", "reports"};

bool in_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }
bool blank(char c) { return std::isspace(static_cast<unsigned char>(c)); }

// Finds where a comment, a literal or a line of the preprocessor ends that begins at a place of the text; the place
// itself if none does.
std::size_t end_of_no_code(std::string_view text, std::size_t at) {
  const auto after = [&](std::string_view what, std::size_t from) {
    const std::size_t found = text.find(what, from);
    return found == std::string_view::npos ? text.size() : found + what.size();
  };
  const std::string_view here = text.substr(at);
  const char before = at > 0 ? text[at - 1] : '\n';
  if (here.starts_with("//")) return std::min(text.find('\n', at), text.size());
  if (here.starts_with("/*")) return after("*/", at + 2);
  if (here.starts_with("R\"") && !in_word(before)) {
    const std::size_t open = text.find('(', at);
    return after(")" + std::string(text.substr(at + 2, open - at - 2)) + "\"", open);
  }
  const bool digits = here.front() == '\'' && in_word(before);  // of a number, which they group
  if (here.front() == '"' || (here.front() == '\'' && !digits)) {
    std::size_t end = at + 1;
    while (end < text.size() && text[end] != here.front()) end += text[end] == '\\' ? 2 : 1;
    return std::min(end + 1, text.size());
  }
  if (here.front() != '#') return at;
  const std::size_t line = text.rfind('\n', at) + 1;  // 0 where there is none
  if (!std::all_of(text.begin() + static_cast<std::ptrdiff_t>(line), text.begin() + static_cast<std::ptrdiff_t>(at),
                   blank))
    return at;
  std::size_t end = text.find('\n', at);
  while (end != std::string_view::npos && text[end - 1] == '\\') end = text.find('\n', end + 1);
  return std::min(end, text.size());
}

// Returns the text with blanks for all that is no code; lines stay where they are.
std::string code_of(std::string_view text) {
  std::string code;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = end_of_no_code(text, at);
    if (end == at) code += text[at++];
    for (; at < end; ++at) code += text[at] == '\n' ? '\n' : ' ';
  }
  return code;
}

// The words before an opening brace, from the last brace or semicolon on.
struct Head {
  std::string text;
  int line = 0;  // of its first word

  void add(char c, int at_line) {
    if (text.empty() && blank(c)) return;
    if (text.empty()) line = at_line;
    text += c;
    if (c == ':' && (text == "public:" || text == "private:" || text == "protected:")) text.clear();
  }
  // Returns it without attributes and parameters of templates.
  std::string plain() const {
    std::string words;
    for (std::size_t at = 0; at < text.size();) {
      const std::string_view here = std::string_view(text).substr(at);
      if (here.starts_with("[[")) {
        at = std::min(text.find("]]", at), text.size() - 2) + 2;
      } else if (here.starts_with("template")) {
        int open = 0;
        at = std::min(text.find('<', at), text.size());
        do open += at >= text.size() ? -open : text[at] == '<' ? 1 : text[at] == '>' ? -1 : 0;
        while (++at < text.size() && open > 0);
      } else if (words.empty() && blank(here.front())) {
        ++at;
      } else {
        words += text[at++];
      }
    }
    while (!words.empty() && blank(words.back())) words.pop_back();
    return words;
  }
};

// Says whether a head opens what holds functions: a namespace or a type.
bool opens_scope(const std::string& head) {
  std::string_view words = head;
  for (const std::string_view before : {"inline ", "typedef ", "static "})
    if (words.starts_with(before)) words.remove_prefix(before.size());
  for (const std::string_view word : {"namespace", "extern", "class", "struct", "enum", "union"})
    if (words.starts_with(word) && (words.size() == word.size() || !in_word(words[word.size()])))
      return !words.ends_with(')');
  return false;
}

// Says whether the brace after a head opens a value: a default argument, or a member that a constructor initialises.
bool opens_value(const std::string& head) {
  if (std::ranges::count(head, '(') > std::ranges::count(head, ')')) return true;
  if (head.find('(') == std::string::npos || !in_word(head.back())) return false;
  std::size_t at = head.size();
  while (at > 0 && in_word(head[at - 1])) --at;
  while (at > 0 && blank(head[at - 1])) --at;
  return at > 1 && (head[at - 1] == ',' || (head[at - 1] == ':' && head[at - 2] != ':'));
}

std::string name_in(const std::string& head) {
  const std::size_t open = head.find('(');
  std::size_t from = open;
  while (from > 0 && (in_word(head[from - 1]) || head[from - 1] == ':' || head[from - 1] == '~')) --from;
  const std::string name = head.substr(from, open - from);
  return name.ends_with("operator") ? name + "()" : name;
}

struct Function {
  std::string name;
  int line, lines;
  bool operator==(const Function&) const = default;
};

void PrintTo(const Function& f, std::ostream* out) { *out << f.line << ": " << f.name << ": " << f.lines; }

// Lists the functions of a source in the order in which they end. What stands inside of one counts as its lines.
// @throws std::invalid_argument if braces do not match
std::vector<Function> functions_of(std::string_view text) {
  enum class Opened { scope, value, function, other };
  std::vector<std::pair<Opened, Function>> open;
  std::vector<Function> found;
  Head head;
  int line = 1;
  for (const char c : code_of(text)) {
    if (c == '{') {
      const bool outside = std::ranges::all_of(open, [](const auto& o) { return o.first == Opened::scope; });
      const std::string words = outside ? head.plain() : "";
      Opened kind = Opened::other;
      if (outside && opens_scope(words))
        kind = Opened::scope;
      else if (outside && opens_value(words))
        kind = Opened::value;
      else if (outside && words.find('(') != std::string::npos && !words.ends_with('=') &&
               !words.starts_with("concept"))
        kind = Opened::function;
      open.push_back({kind, {kind == Opened::function ? name_in(words) : "", head.line, 0}});
      if (kind != Opened::value) head = {};
    } else if (c == '}') {
      if (open.empty()) throw std::invalid_argument("a brace closes nothing in line " + std::to_string(line));
      auto [kind, function] = open.back();
      open.pop_back();
      function.lines = line - function.line + 1;
      if (kind == Opened::function) found.push_back(function);
      if (kind != Opened::value) head = {};
    } else if (open.empty() || open.back().first != Opened::value) {
      head.add(c, line);
      if (c == ';') head = {};
    }
    line += c == '\n';
  }
  if (!open.empty()) throw std::invalid_argument("a brace stays open");
  return found;
}

// Lists those of them that are too long, tables included.
std::vector<Function> long_functions_of(std::string_view text) {
  std::vector<Function> all = functions_of(text);
  std::erase_if(all, [](const Function& f) { return f.lines <= most_lines; });
  return all;
}

std::string function_of_lines(const std::string& name, int lines) {
  std::string text = "double " + name + "(double x) {\n";
  for (int i = 0; i < lines - 2; ++i) text += "  x += 1;\n";
  return text + "}\n";
}

TEST(FunctionLengths, AreTooLongFromSixtyOneOn) {
  const std::string text =
      "#include <vector>\nnamespace a {\n" + function_of_lines("f", 60) + function_of_lines("g", 61) + "}\n";
  EXPECT_EQ(functions_of(text), (std::vector<Function>{{"f", 3, 60}, {"g", 63, 61}}));
  EXPECT_EQ(long_functions_of(text), (std::vector<Function>{{"g", 63, 61}}));
}

TEST(FunctionLengths, PassOverBracesThatAreNoCode) {
  const std::string text = R"text(// {
#define BOTH(x) { \
  x }}
int f() {  /* { */
  return 1'000 + '{' + "{\"{"[0] + R"(}"})"[0];
}
)text";
  EXPECT_EQ(functions_of(text), (std::vector<Function>{{"f", 4, 3}}));
}

TEST(FunctionLengths, KnowFunctionsFromTypesAndValues) {
  const std::string text = R"text(
template <class T>
struct Pair : Base<int(int)> {
 public:
  explicit Pair(Wheel w = {}, int n = 1)
      : first_{w.legs()},
        second_(n) {
  }
  auto operator()(int x) const -> std::pair<int, int> {
    const auto twice = [](int y) {
      return 2 * y;
    };
    return {twice(x), 0};
  }
  std::function<void(int)> call = {};
  std::vector<int> first_{1, 2};
};
enum class Law { published };
constexpr std::array<double, 2> numbers{
    1, 2};
const Table table = make({
    1, 2});
[[gnu::always_inline]] inline double Pair<int>::square(
    double x) {
  return x * x;
}
)text";
  EXPECT_EQ(functions_of(text), (std::vector<Function>{{"Pair", 5, 4}, {"operator()", 9, 6}, {"::square", 23, 4}}));
}

TEST(FunctionLengths, RefuseBracesThatDoNotMatch) {
  EXPECT_THROW(functions_of("int f() {"), std::invalid_argument);
  EXPECT_THROW(functions_of("int f() {}\n}"), std::invalid_argument);
}

TEST(FunctionLengths, AreAtMostSixtyButForTables) {
  namespace fs = std::filesystem;
  const fs::path root = METASTABLE_SOURCE_DIR;
  std::vector<std::string> long_tables;
  for (const char* folder : folders)
    for (const fs::directory_entry& file : fs::recursive_directory_iterator(root / folder)) {
      if (file.path().extension() != ".h" && file.path().extension() != ".cpp") continue;
      std::ifstream in(file.path());
      const std::string text(std::istreambuf_iterator<char>(in), {});
      const std::string name = fs::relative(file.path(), root).string();
      std::vector<Function> all;
      ASSERT_NO_THROW(all = long_functions_of(text)) << name;
      for (const Function& f : all)
        if (std::ranges::find(tables, f.name) != tables.end())
          long_tables.push_back(f.name);
        else
          ADD_FAILURE() << name << ":" << f.line << ": " << f.name << " has " << f.lines << " lines, more than "
                        << most_lines;
    }
  // A table that has become short, or is gone, does not stay on the list.
  EXPECT_EQ(long_tables, std::vector<std::string>(tables.begin(), tables.end()));
}

}  // namespace
}  // namespace metastable
