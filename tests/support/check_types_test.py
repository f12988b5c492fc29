#!/usr/bin/env python3
"""check_types.py finds the types that other files see, and refuses one that two files define."""
import os
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import check_types  # noqa: E402

SAMPLE = '''#include "a.h"
#define OPEN struct Macro \\
  {
namespace trigpoint {

struct Forward;
class Shape final : public Base<int>, private Other {
  Q_OBJECT
 public:
  enum class Kind : int { kA = '{', kB = 1'000 };
  struct Inner {
    void Method() {
      struct InFunction { int n; };
    }
  };
  struct {
    int n;
  } nameless;
};

namespace {  // struct Comment {
struct Hidden {};
}  // namespace

template <typename T, class U>
struct Pair {};
template <>
struct Pair<int, std::vector<int>> {};
template <class T>
void Function(struct stat* s, const char* text = "struct Text {") {}
struct stat Status() { return {}; }
struct Shape::Parts : Base {};
const char* kText = R"(struct Raw {)";

namespace inner::deep {
union Both { int n; };
}
}  // namespace trigpoint
enum Global { kC };
'''


class CheckTypes(unittest.TestCase):
    def test_finds(self):
        self.assertEqual(check_types.types(SAMPLE), [
            "trigpoint::Shape", "trigpoint::Shape::Kind", "trigpoint::Shape::Inner", "trigpoint::Pair",
            "trigpoint::Pair<int, std::vector<int>>", "trigpoint::Shape::Parts", "trigpoint::inner::deep::Both", "Global"])

    def check(self, first, second):
        with tempfile.TemporaryDirectory() as root:
            os.makedirs(os.path.join(root, "app"))
            os.makedirs(os.path.join(root, "eval"))
            for file, text in (("app/a.cc", first), ("eval/b.cc", second)):
                with open(os.path.join(root, file), "w", encoding="utf-8") as source:
                    source.write(text)
            done = subprocess.run([sys.executable, "-B", os.path.join(HERE, "check_types.py"), root], capture_output=True,
                                  text=True, check=False)
        return done.returncode, done.stdout

    def test_refuses_a_second_definition(self):
        named, other = "namespace trigpoint {\nstruct Job {\n};\n}\n", "namespace elsewhere {\nstruct Job {};\n}\n"
        hidden = "namespace trigpoint {\nnamespace {\nstruct Job {\n};\n}\n}\n"
        code, text = self.check(named, named)
        self.assertEqual(code, 1)
        self.assertIn("trigpoint::Job is defined in app/a.cc and in eval/b.cc", text)
        for second in (hidden, other, "namespace trigpoint {\nstruct Job;\n}\n"):
            self.assertEqual(self.check(named, second)[0], 0, second)
        self.assertEqual(self.check(hidden, hidden)[0], 0)


if __name__ == "__main__":
    unittest.main()
