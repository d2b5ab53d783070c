#include "qp/build_facts.h"

#include <cstdlib>
#include <cstring>

namespace islet::qp {

std::vector<const char*> RunnableKernels() {
  std::vector<const char*> names{"sse2"};
#ifdef ISLET_WIDE_KERNELS
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return names;
  names.push_back("avx2");
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq"))
    names.push_back("avx512");
#endif
  return names;
}

int KernelWidth(const char* name) {
  const std::vector<const char*> names = RunnableKernels();
  for (size_t width = 0; width < names.size(); ++width)
    if (std::strcmp(names[width], name) == 0) return static_cast<int>(width);
  return -1;
}

int ChosenKernelWidth() {
  static const int chosen = [] {
    const char* const wanted = std::getenv("ISLET_KERNELS");
    const int width = wanted ? KernelWidth(wanted) : -1;
    return width >= 0 ? width : static_cast<int>(RunnableKernels().size()) - 1;
  }();
  return chosen;
}

const char* ChosenKernels() { return RunnableKernels()[ChosenKernelWidth()]; }

}  // namespace islet::qp
