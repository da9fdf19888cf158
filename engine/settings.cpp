// Reads the engine's settings.
#include "settings.hpp"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

namespace engine {
namespace {

constexpr std::size_t max_numbers = 100000;

/// A count and so many numbers; false where there are fewer, more, or something else.
bool read_numbers(std::istringstream& line, std::vector<double>& numbers) {
  std::size_t count = 0;
  if (!(line >> count) || count > max_numbers) return false;
  numbers.clear();
  std::string word;
  while (line >> word) {
    char* end = nullptr;
    numbers.push_back(std::strtod(word.c_str(), &end));
    if (end == word.c_str() || *end != 0) return false;
  }
  return numbers.size() == count;
}

}  // namespace

const std::vector<double>& Settings::of(const std::string& name) const {
  static const std::vector<double> none;
  const auto found = numbers.find(name);
  return found == numbers.end() ? none : found->second;
}

double Settings::one(const std::string& name, double otherwise) const {
  const std::vector<double>& found = of(name);
  return found.size() == 1 ? found[0] : otherwise;
}

std::string read_settings(const std::string& path, Settings& settings) {
  std::ifstream file(path);
  if (!file) return path + ": not readable, expected the settings of a session";
  std::string text;
  int at = 0;
  bool known = false;
  while (std::getline(file, text)) {
    ++at;
    std::istringstream line(text);
    std::string key;
    if (!(line >> key) || key[0] == '#') continue;
    const auto wrong = [&](const std::string& expected) {
      return path + ":" + std::to_string(at) + ": found \"" + text.substr(0, 60) + "\", expected " + expected;
    };
    if (key == "pellucid-engine") {
      int version = 0;
      known = (line >> version) && version == 1;
      if (!known) return wrong("version 1");
    } else if (!known) {
      return wrong("\"pellucid-engine 1\" in the first line");
    } else if (key == "period_ns") {
      if (!(line >> settings.period_ns) || settings.period_ns < 100000 || settings.period_ns > 100000000)
        return wrong("a period of 100,000 to 100,000,000 ns");
    } else if (key == "late_ns") {
      if (!(line >> settings.late_ns) || settings.late_ns < 0) return wrong("a bound of at least 0 ns");
    } else if (key == "session_timeout_s") {
      if (!(line >> settings.session_timeout) || !(settings.session_timeout > 0)) return wrong("a time above 0 s");
    } else if (key == "seed") {
      if (!(line >> settings.seed)) return wrong("a whole number");
    } else if (key == "device") {
      if (!(line >> settings.device)) return wrong("the kind of a device");
      line >> settings.address;
    } else if (key == "numbers") {
      std::string name;
      std::vector<double> numbers;
      if (!(line >> name) || !read_numbers(line, numbers)) return wrong("a name, a count and so many numbers");
      settings.numbers[name] = numbers;
    } else if (key == "condition") {
      Condition condition;
      int worn = 0;
      if (!(line >> condition.name >> condition.kind >> worn)) return wrong("a name, a law, and 1 where the robot is worn");
      condition.worn = worn != 0;
      settings.conditions.push_back(condition);
    } else if (key == "law" || key == "supervisor") {
      std::vector<double> numbers;
      if (settings.conditions.empty() || !read_numbers(line, numbers)) return wrong("a count and so many numbers, after a condition");
      (key == "law" ? settings.conditions.back().numbers : settings.conditions.back().supervisor) = numbers;
    } else {
      return wrong("period_ns, late_ns, session_timeout_s, seed, device, numbers, condition, law or supervisor");
    }
  }
  if (settings.conditions.empty()) return path + ": found no condition, expected at least one";
  for (Condition& condition : settings.conditions) {
    const std::string wrong = condition.make();
    if (!wrong.empty()) return path + ": " + wrong;
  }
  return "";
}

}  // namespace engine
