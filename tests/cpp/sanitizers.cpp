// Does on purpose what the sanitizers are there to stop: a test that passes when they do.
#include <cstring>
#include <limits>
#include <memory>

int main(int count, char** arguments) {
  if (count > 1 && std::strcmp(arguments[1], "overflow") == 0) {
    return std::numeric_limits<int>::max() - 1 + count;
  }
  const auto numbers = std::make_unique<int[]>(4);
  return numbers.get()[count + 3];
}
