#!/usr/bin/env python3
"""check_functions.py measures functions as they stand in our sources, and refuses long ones."""
import os
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import check_functions  # noqa: E402

SAMPLE = '''#include <vector>

namespace trigpoint {
namespace {

constexpr int kTable[] = {
    1,
    2,
};

// A comment with a brace {
template <typename T>
std::vector<T> Free(const std::vector<T>& values,
                    int n) {
  if (n > 0) {
    return values;
  }
  return {};
}

const char* kText = R"(
int NotAFunction() {
}
)";

int OneLine() { return 1; }

}  // namespace

class Shape {
 public:
  explicit Shape(int n)
      : n_(n) {
    n_ += 1;
  }
  bool operator==(const Shape& other) const {
    return n_ == other.n_;
  }
  struct Inner {
    void Method() {
      const auto f = [] {
        return 1;
      };
    }
  };

 private:
  int n_;
};

std::pair<int, int> Shape::Outside(const std::function<void(int)>& f) const {
  f(1);
  return {};
}

TEST(Suite, Case) {
  EXPECT_TRUE(true);
}

}  // namespace trigpoint
'''


class CheckFunctions(unittest.TestCase):
    def test_measures(self):
        self.assertEqual(check_functions.functions(SAMPLE), [
            ("Free", 12, 8), ("Shape::Shape", 32, 4), ("Shape::operator==", 36, 3), ("Shape::Inner::Method", 40, 5),
            ("Shape::Outside", 51, 4), ("Suite.Case", 56, 3)])

    def problems(self, lines, path="eval/a.cc"):
        with tempfile.TemporaryDirectory() as root:
            os.makedirs(os.path.join(root, os.path.dirname(path)))
            with open(os.path.join(root, path), "w", encoding="utf-8") as source:
                source.write("void Long() {\n" + "  Step();\n" * (lines - 2) + "}\n")
            found = check_functions.all_functions(root)
        return check_functions.check(found)

    def test_refuses_long_ones(self):
        self.assertEqual(self.problems(60), [])
        self.assertEqual(len(self.problems(61)), 1)
        self.assertEqual(self.problems(100, "app/cli/a.cc"), [])
        self.assertEqual(len(self.problems(101, "app/cli/a.cc")), 1)


if __name__ == "__main__":
    unittest.main()
