#include <cstdio>

#include "check.hpp"

int main() {
  int failures = 0;
  for (const checks::Test& test : checks::tests) {
    std::printf("  %s\n", test.sentence);
    std::fflush(stdout);
    try {
      test.body();
    } catch (const checks::Failed&) {
      ++failures;
    }
  }
  std::printf("%zu tests, %d failed\n", checks::tests.size(), failures);
  return failures == 0 && !checks::tests.empty() ? 0 : 1;
}
