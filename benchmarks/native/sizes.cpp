// sizes: prints the bytes of every estimator, without and with a change detector, and with outlier
// rejection too.
#include <cstdio>

#include "palpate/palpate.hpp"

namespace {

template <class Estimator>
void print(const char* name) {
  using palpate::WithChangeDetector, palpate::WithOutlierRejection;
  std::printf("%s %zu %zu %zu\n", name, sizeof(Estimator), sizeof(WithChangeDetector<Estimator>),
              sizeof(WithOutlierRejection<WithChangeDetector<Estimator>>));
}

}  // namespace

int main() {
  print<palpate::KelvinVoigtRLS>("KelvinVoigtRLS");
  print<palpate::ExtendedKelvinVoigtRLS>("ExtendedKelvinVoigtRLS");
  print<palpate::SingleStageRLS>("SingleStageRLS");
  print<palpate::DoubleStageRLS>("DoubleStageRLS");
  print<palpate::VariableProjection>("VariableProjection");
  print<palpate::VariableProjectionWithSurface>("VariableProjectionWithSurface");
  print<palpate::DriftTracking>("DriftTracking");
}
