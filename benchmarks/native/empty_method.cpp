// The minimum: a compiled method of three floats that does nothing, called from Python.
#include <nanobind/nanobind.h>

namespace {

struct Nothing {
  void update(double, double, double) const noexcept {}
};

}  // namespace

NB_MODULE(empty_method, module) {
  nanobind::class_<Nothing>(module, "Nothing")
      .def(nanobind::init<>())
      .def("update", &Nothing::update);
}
