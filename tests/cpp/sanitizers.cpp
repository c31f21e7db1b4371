// Does on purpose what the sanitizers are there to stop.
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>

int main(int count, char** arguments) {
  volatile int result = 0;
  if (count > 1 && std::strcmp(arguments[1], "overflow") == 0) {
    result = std::numeric_limits<int>::max() - 1 + count;
  } else {
    const auto numbers = std::make_unique<int[]>(4);
    result = numbers.get()[count + 3];
  }
  std::puts("survived");
}
