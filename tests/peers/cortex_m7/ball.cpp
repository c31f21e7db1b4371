// The ball, probed for two seconds: what a method identifies, as the bits of doubles.
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <palpate/viscoelastic_estimators.hpp>

namespace {

// Not by <random>, whose distributions differ between libraries.
double noise() {
  static unsigned state = 62;
  double sum = -6.0;
  for (int i = 0; i < 12; ++i) {
    state = 1664525u * state + 1013904223u;
    sum += state / 4294967296.0;
  }
  return 0.05 * sum;
}

void print(double number) {
  std::uint32_t bits[2];
  std::memcpy(bits, &number, sizeof bits);
  std::printf(" %08" PRIx32 "%08" PRIx32, bits[1], bits[0]);
}

template <class Estimator>
void identify(const char* name) {
  static Estimator estimator;
  constexpr palpate::HuntCrossley ball{2000.0, 2000.0, 1.0};
  // A rotation by 11 and 15 rad/s: sines without the library's.
  double c1 = 1.0, s1 = 0.0, c2 = 1.0, s2 = 0.0;
  constexpr double a1 = 0.011, a2 = 0.015;
  for (int k = 0; k < 2000; ++k) {
    const double x = 10e-3 + 1.8e-3 * (s1 + s2), v = 1.8e-3 * (11.0 * c1 + 15.0 * c2);
    estimator.update(x, v, x * (ball.K + ball.B * v) + noise());
    const double t1 = c1 - a1 * s1, t2 = c2 - a2 * s2;
    s1 += a1 * t1;
    c1 = t1;
    s2 += a2 * t2;
    c2 = t2;
  }
  const auto response = estimator.response(8e-3);
  std::printf("%s %u", name, static_cast<unsigned>(sizeof(Estimator)));
  print(response.stiffness.value);
  print(response.damping.value);
  for (const double number : estimator.law().parameters()) print(number);
  std::printf("\n");
}

}  // namespace

int main() {
  identify<palpate::SingleStageRLS>("single-stage");
  identify<palpate::VariableProjection>("variable-projection");
  identify<palpate::ViscoelasticContact>("viscoelastic");
}
