// As much of a test framework as these tests need: sentences, checks, and the first failure's
// place.
#pragma once

#include <cmath>
#include <cstdio>
#include <exception>
#include <vector>

namespace checks {

struct Test {
  const char* sentence;
  void (*body)();
};

inline std::vector<Test> tests;

struct Registered {
  Registered(const char* sentence, void (*body)()) { tests.push_back({sentence, body}); }
};

struct Failed : std::exception {};

inline void require(bool holds, const char* what, const char* file, int line) {
  if (holds) return;
  std::printf("    %s:%d: %s\n", file, line, what);
  throw Failed();
}

inline void require_near(double value, double expected, double tolerance, const char* what,
                         const char* file, int line) {
  if (std::abs(value - expected) <= tolerance) return;
  std::printf("    %s:%d: %s = %.17g, not %.17g within %g\n", file, line, what, value, expected,
              tolerance);
  throw Failed();
}

}  // namespace checks

#define CHECKS_JOIN_(a, b) a##b
#define CHECKS_JOIN(a, b) CHECKS_JOIN_(a, b)

// TEST("a sentence that holds") { ... }
#define TEST(sentence)                                                \
  static void CHECKS_JOIN(test_, __LINE__)();                         \
  static const checks::Registered CHECKS_JOIN(registered_, __LINE__)( \
      sentence, &CHECKS_JOIN(test_, __LINE__));                       \
  static void CHECKS_JOIN(test_, __LINE__)()

#define CHECK(...) checks::require((__VA_ARGS__), #__VA_ARGS__, __FILE__, __LINE__)
#define CHECK_NEAR(value, expected, tolerance) \
  checks::require_near((value), (expected), (tolerance), #value, __FILE__, __LINE__)
